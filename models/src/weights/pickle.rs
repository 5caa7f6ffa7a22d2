//! Reads the part of pickle (protocol 2) that a state dict needs, as data.
//!
//! Enters: the bytes of `data.pkl`. Leaves: a tree of plain values, with tensors as references to storages. Nothing is
//! executed. A global outside a fixed list is refused. REDUCE knows three callables, each of which only makes a value here.
//! BUILD only drops attributes. Invariant: every value costs at least one byte of input, and containers live in arenas.
//! Memory is therefore linear in the input, and deeply nested values need no recursion.

use super::error::FormatError;
use super::tensor::Float;

/// A value. Containers are indices into an arena.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Str(&'a str),
    Tuple(usize),
    /// A list, whose contents no state dict needs.
    List,
    Dict(usize),
    Global(Global),
    Storage(Storage<'a>),
    Tensor(usize),
}

/// A global that a pickle may name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Global {
    OrderedDict,
    RebuildTensor,
    RebuildParameter,
    Storage(Scalar),
}

/// Type of a storage's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    Float(Float),
    /// Integers and truth values, by their `PyTorch` name.
    Other(&'static str),
}

/// An entry of the archive, by its key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Storage<'a> {
    pub(super) key: &'a str,
    pub(super) scalar: Scalar,
    /// Number of values.
    pub(super) values: usize,
}

/// A tensor as a view of a storage.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct View<'a> {
    pub(super) storage: Storage<'a>,
    pub(super) offset: usize,
    pub(super) shape: Vec<usize>,
    pub(super) strides: Vec<usize>,
}

/// The content of a pickle.
#[derive(Debug)]
pub(super) struct Pickle<'a> {
    pub(super) root: Value<'a>,
    pub(super) dicts: Vec<Vec<(Value<'a>, Value<'a>)>>,
    pub(super) tensors: Vec<View<'a>>,
}

/// Reads a pickle.
pub(super) fn read(bytes: &[u8]) -> Result<Pickle<'_>, FormatError> {
    let mut unpickler = Unpickler { bytes, ..Unpickler::default() };
    loop {
        unpickler.opcode = unpickler.at;
        if let Some(root) = unpickler.step()? {
            return Ok(Pickle { root, dicts: unpickler.dicts, tensors: unpickler.tensors });
        }
    }
}

#[derive(Default)]
struct Unpickler<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Where the current instruction starts, for messages.
    opcode: usize,
    stack: Vec<Value<'a>>,
    /// Heights of the stack at the marks.
    marks: Vec<usize>,
    memo: std::collections::BTreeMap<u32, Value<'a>>,
    tuples: Vec<Vec<Value<'a>>>,
    dicts: Vec<Vec<(Value<'a>, Value<'a>)>>,
    tensors: Vec<View<'a>>,
}

impl<'a> Unpickler<'a> {
    fn refuse<T>(&self, expected: &'static str, found: impl Into<String>) -> Result<T, FormatError> {
        Err(FormatError::Pickle { at: self.opcode, expected, found: found.into() })
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], FormatError> {
        let taken = self.at.checked_add(length).and_then(|end| self.bytes.get(self.at..end));
        match taken {
            Some(taken) => {
                self.at += length;
                Ok(taken)
            }
            None => self.refuse("more bytes", "the end of the pickle"),
        }
    }

    /// A little-endian number of `length` bytes, at most 8.
    fn number(&mut self, length: usize) -> Result<u64, FormatError> {
        let taken = self.take(length)?;
        Ok(taken.iter().rev().fold(0, |n, &b| n << 8 | u64::from(b)))
    }

    fn text(&mut self, length: usize) -> Result<&'a str, FormatError> {
        let taken = self.take(length)?;
        std::str::from_utf8(taken).or_else(|_| self.refuse("text in UTF-8", "other bytes"))
    }

    /// A line of text, without its end.
    fn line(&mut self) -> Result<&'a str, FormatError> {
        let rest = &self.bytes[self.at..];
        let Some(length) = rest.iter().position(|&b| b == b'\n') else {
            return self.refuse("a line", "the end of the pickle");
        };
        let line = self.text(length)?;
        self.at += 1;
        Ok(line)
    }

    fn pop(&mut self) -> Result<Value<'a>, FormatError> {
        // Values below a mark belong to it.
        let floor = self.marks.last().copied().unwrap_or(0);
        match self.stack.pop() {
            Some(value) if self.stack.len() >= floor => Ok(value),
            _ => self.refuse("a value on the stack", "none"),
        }
    }

    /// The values above the last mark, which is removed.
    fn pop_mark(&mut self) -> Result<Vec<Value<'a>>, FormatError> {
        match self.marks.pop() {
            Some(height) => Ok(self.stack.split_off(height.min(self.stack.len()))),
            None => self.refuse("a mark on the stack", "none"),
        }
    }

    fn push_tuple(&mut self, values: Vec<Value<'a>>) {
        self.tuples.push(values);
        self.stack.push(Value::Tuple(self.tuples.len() - 1));
    }

    fn tuple_of(&mut self, count: usize) -> Result<(), FormatError> {
        let mut values = Vec::new();
        for _ in 0..count {
            values.push(self.pop()?);
        }
        values.reverse();
        self.push_tuple(values);
        Ok(())
    }

    fn push_dict(&mut self) {
        self.dicts.push(Vec::new());
        self.stack.push(Value::Dict(self.dicts.len() - 1));
    }

    fn set(&mut self, items: &[Value<'a>]) -> Result<(), FormatError> {
        let Some(&Value::Dict(dict)) = self.stack.last() else {
            return self.refuse("a dict to put values into", self.kind_on_top());
        };
        if !items.len().is_multiple_of(2) {
            return self.refuse("pairs of keys and values", "a key alone");
        }
        self.dicts[dict].extend(items.chunks_exact(2).map(|pair| (pair[0], pair[1])));
        Ok(())
    }

    fn kind_on_top(&self) -> &'static str {
        self.stack.last().map_or("nothing", |v| v.kind())
    }

    /// Reads one instruction; returns the result at STOP.
    fn step(&mut self) -> Result<Option<Value<'a>>, FormatError> {
        let opcode = self.take(1)?[0];
        match opcode {
            0x80 => match self.take(1)?[0] {
                2 => {}
                other => return self.refuse("protocol 2", format!("protocol {other}")),
            },
            b'.' => return self.pop().map(Some),
            b'(' => self.marks.push(self.stack.len()),
            b'N' => self.stack.push(Value::None),
            0x88 => self.stack.push(Value::Bool(true)),
            0x89 => self.stack.push(Value::Bool(false)),
            b'K' => self.push_integer(1, false)?,
            b'M' => self.push_integer(2, false)?,
            b'J' => self.push_integer(4, true)?,
            0x8a => {
                let length = usize::from(self.take(1)?[0]);
                self.push_integer(length, true)?;
            }
            b'G' => {
                let bits = self.number(8)?.swap_bytes();
                self.stack.push(Value::Float(f64::from_bits(bits)));
            }
            b'X' => {
                let length = self.number(4)? as usize;
                let text = self.text(length)?;
                self.stack.push(Value::Str(text));
            }
            b')' => self.push_tuple(Vec::new()),
            0x85..=0x87 => self.tuple_of(usize::from(opcode - 0x84))?,
            b't' => {
                let values = self.pop_mark()?;
                self.push_tuple(values);
            }
            b']' => self.stack.push(Value::List),
            b'a' | b'e' => self.append(opcode)?,
            b'}' => self.push_dict(),
            b's' => {
                let (value, key) = (self.pop()?, self.pop()?);
                self.set(&[key, value])?;
            }
            b'u' => {
                let items = self.pop_mark()?;
                self.set(&items)?;
            }
            b'q' | b'r' => {
                let place = self.number(if opcode == b'q' { 1 } else { 4 })? as u32;
                let Some(&value) = self.stack.last() else {
                    return self.refuse("a value to remember", "none");
                };
                self.memo.insert(place, value);
            }
            b'h' | b'j' => {
                let place = self.number(if opcode == b'h' { 1 } else { 4 })? as u32;
                let Some(&value) = self.memo.get(&place) else {
                    return self.refuse("a remembered value", format!("none at {place}"));
                };
                self.stack.push(value);
            }
            b'c' => self.global()?,
            b'Q' => self.persistent()?,
            b'R' => self.reduce()?,
            b'b' => self.build()?,
            other => {
                let found = format!("opcode {other:#04x}");
                return self.refuse("an instruction that a state dict needs", found);
            }
        }
        Ok(None)
    }

    /// An integer of `length` bytes, in two's complement where it is `signed`.
    fn push_integer(&mut self, length: usize, signed: bool) -> Result<(), FormatError> {
        if length > 8 {
            return self.refuse("an integer of at most 8 bytes", length.to_string());
        }
        let number = self.number(length)? as i64;
        let unused = if signed && length > 0 { 64 - 8 * length as u32 } else { 0 };
        self.stack.push(Value::Int(number << unused >> unused));
        Ok(())
    }

    /// APPEND and APPENDS: the contents of a list are dropped.
    fn append(&mut self, opcode: u8) -> Result<(), FormatError> {
        if opcode == b'a' {
            self.pop()?;
        } else {
            self.pop_mark()?;
        }
        match self.stack.last() {
            Some(Value::List) => Ok(()),
            _ => self.refuse("a list to append to", self.kind_on_top()),
        }
    }

    fn global(&mut self) -> Result<(), FormatError> {
        let (module, name) = (self.line()?, self.line()?);
        let storage = |name: &str| {
            Some(Global::Storage(match name {
                "FloatStorage" => Scalar::Float(Float::F32),
                "DoubleStorage" => Scalar::Float(Float::F64),
                "HalfStorage" => Scalar::Float(Float::F16),
                "BFloat16Storage" => Scalar::Float(Float::Bf16),
                "LongStorage" => Scalar::Other("int64"),
                "IntStorage" => Scalar::Other("int32"),
                "ShortStorage" => Scalar::Other("int16"),
                "CharStorage" => Scalar::Other("int8"),
                "ByteStorage" => Scalar::Other("uint8"),
                "BoolStorage" => Scalar::Other("bool"),
                _ => return None,
            }))
        };
        let global = match (module, name) {
            ("collections", "OrderedDict") => Some(Global::OrderedDict),
            ("torch._utils", "_rebuild_tensor_v2") => Some(Global::RebuildTensor),
            ("torch._utils", "_rebuild_parameter") => Some(Global::RebuildParameter),
            ("torch", name) => storage(name),
            _ => None,
        };
        let Some(global) = global else {
            let found = format!("{module}.{name}").chars().take(120).collect::<String>();
            return self.refuse("OrderedDict, a tensor, a parameter or a storage", format!("{found:?}"));
        };
        self.stack.push(Value::Global(global));
        Ok(())
    }

    /// BINPERSID: ("storage", type, key, location, number of values).
    fn persistent(&mut self) -> Result<(), FormatError> {
        let id = self.pop()?;
        let fields = self.tuple(id)?;
        match fields {
            &[
                Value::Str("storage"),
                Value::Global(Global::Storage(scalar)),
                Value::Str(key),
                Value::Str(_),
                Value::Int(values),
            ] if values >= 0 => {
                self.stack.push(Value::Storage(Storage { key, scalar, values: values as usize }));
                Ok(())
            }
            _ => self.refuse("a storage's type, key, location and number of values", "other fields"),
        }
    }

    fn tuple(&self, value: Value<'a>) -> Result<&[Value<'a>], FormatError> {
        match value {
            Value::Tuple(tuple) => Ok(&self.tuples[tuple]),
            other => self.refuse("a tuple", other.kind()),
        }
    }

    /// A tuple of numbers from 0.
    fn sizes(&self, value: Value<'a>) -> Result<Vec<usize>, FormatError> {
        let sizes = self.tuple(value)?.iter().map(|v| match *v {
            Value::Int(size) => usize::try_from(size).ok(),
            _ => None,
        });
        sizes.collect::<Option<_>>().map_or_else(|| self.refuse("a tuple of numbers from 0", "others"), Ok)
    }

    /// REDUCE: the three callables there are.
    fn reduce(&mut self) -> Result<(), FormatError> {
        let (arguments, callable) = (self.pop()?, self.pop()?);
        let arguments = self.tuple(arguments)?;
        match (callable, arguments) {
            (Value::Global(Global::OrderedDict), []) => self.push_dict(),
            (
                Value::Global(Global::RebuildTensor),
                &[
                    Value::Storage(storage),
                    Value::Int(offset),
                    shape,
                    strides,
                    Value::Bool(_),
                    Value::Dict(_),
                    ..,
                ],
            ) if arguments.len() <= 7 && offset >= 0 => {
                let view = View {
                    storage,
                    offset: offset as usize,
                    shape: self.sizes(shape)?,
                    strides: self.sizes(strides)?,
                };
                if view.shape.len() != view.strides.len() || view.shape.len() > 16 {
                    return self
                        .refuse("as many strides as sizes, at most 16", view.strides.len().to_string());
                }
                self.tensors.push(view);
                self.stack.push(Value::Tensor(self.tensors.len() - 1));
            }
            (
                Value::Global(Global::RebuildParameter),
                &[tensor @ Value::Tensor(_), Value::Bool(_), Value::Dict(_)],
            ) => self.stack.push(tensor),
            (callable, _) => {
                return self.refuse("an OrderedDict(), a tensor or a parameter", callable.kind());
            }
        }
        Ok(())
    }

    /// BUILD: attributes of an `OrderedDict` (a state dict's `_metadata`), which do not concern its tensors.
    fn build(&mut self) -> Result<(), FormatError> {
        self.pop()?;
        match self.stack.last() {
            Some(Value::Dict(_)) => Ok(()),
            _ => self.refuse("an OrderedDict to give attributes", self.kind_on_top()),
        }
    }
}

impl Value<'_> {
    /// Its kind, for messages.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::None => "None",
            Self::Bool(_) => "a truth value",
            Self::Int(_) => "an integer",
            Self::Float(_) => "a float",
            Self::Str(_) => "a string",
            Self::Tuple(_) => "a tuple",
            Self::List => "a list",
            Self::Dict(_) => "a dict",
            Self::Global(_) => "a global",
            Self::Storage(_) => "a storage",
            Self::Tensor(_) => "a tensor",
        }
    }
}
