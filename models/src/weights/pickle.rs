//! Reads the part of pickle (protocol 2) that a state dict needs, as data.
//!
//! Input: the bytes of `data.pkl`. Output: a tree of plain values, with tensors as references to
//! storages. Nothing is executed: globals come from a fixed list, REDUCE knows three callables that
//! make values here, BUILD only drops attributes. Invariant: each value takes at least a byte of
//! input, and containers are in arenas: memory is linear, and nesting needs no recursion.

use safetensors::Dtype;

use super::error::{FormatError, quoted};

/// A value. Containers are indices into an arena. For values that no state dict needs, only the
/// kind is kept.
#[derive(Clone, Copy, Debug)]
pub(super) enum Value<'a> {
    /// The start of the items of the next tuple, list or dict.
    Mark,
    None,
    Bool,
    Int(i64),
    Float,
    Str(&'a str),
    Tuple(usize),
    List,
    Dict(usize),
    Global(Global),
    Storage(Storage<'a>),
    Tensor(usize),
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Global {
    OrderedDict,
    RebuildTensor,
    RebuildParameter,
    Storage(Scalar),
}

/// Type of a storage's values.
#[derive(Clone, Copy, Debug)]
pub(super) enum Scalar {
    Float(Dtype),
    /// Integers and truth values, by their `PyTorch` name.
    Other(&'static str),
}

/// Modules, names and the globals that they name.
const GLOBALS: [(&str, &str, Global); 13] = [
    ("collections", "OrderedDict", Global::OrderedDict),
    ("torch._utils", "_rebuild_tensor_v2", Global::RebuildTensor),
    ("torch._utils", "_rebuild_parameter", Global::RebuildParameter),
    ("torch", "FloatStorage", Global::Storage(Scalar::Float(Dtype::F32))),
    ("torch", "DoubleStorage", Global::Storage(Scalar::Float(Dtype::F64))),
    ("torch", "HalfStorage", Global::Storage(Scalar::Float(Dtype::F16))),
    ("torch", "BFloat16Storage", Global::Storage(Scalar::Float(Dtype::BF16))),
    ("torch", "LongStorage", Global::Storage(Scalar::Other("int64"))),
    ("torch", "IntStorage", Global::Storage(Scalar::Other("int32"))),
    ("torch", "ShortStorage", Global::Storage(Scalar::Other("int16"))),
    ("torch", "CharStorage", Global::Storage(Scalar::Other("int8"))),
    ("torch", "ByteStorage", Global::Storage(Scalar::Other("uint8"))),
    ("torch", "BoolStorage", Global::Storage(Scalar::Other("bool"))),
];

/// An entry of the archive, by its key.
#[derive(Clone, Copy, Debug)]
pub(super) struct Storage<'a> {
    pub(super) key: &'a str,
    pub(super) scalar: Scalar,
    pub(super) values: usize,
}

/// A tensor as a view of a storage.
#[derive(Clone, Debug)]
pub(super) struct View<'a> {
    pub(super) storage: Storage<'a>,
    pub(super) offset: usize,
    pub(super) shape: Vec<usize>,
    pub(super) strides: Vec<usize>,
}

#[derive(Debug)]
pub(super) struct Pickle<'a> {
    pub(super) root: Value<'a>,
    pub(super) dicts: Vec<Vec<(Value<'a>, Value<'a>)>>,
    pub(super) tensors: Vec<View<'a>>,
}

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
    /// Start of the current instruction, for messages.
    opcode: usize,
    stack: Vec<Value<'a>>,
    memo: std::collections::BTreeMap<u64, Value<'a>>,
    tuples: Vec<Vec<Value<'a>>>,
    dicts: Vec<Vec<(Value<'a>, Value<'a>)>>,
    tensors: Vec<View<'a>>,
}

impl<'a> Unpickler<'a> {
    fn refuse<T>(&self, expected: &'static str, found: impl Into<String>) -> Result<T, FormatError> {
        Err(FormatError::Pickle { at: self.opcode, expected, found: found.into() })
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], FormatError> {
        let Some(taken) = self.bytes[self.at..].get(..length) else {
            return self.refuse("more bytes", "the end of the pickle");
        };
        self.at += length;
        Ok(taken)
    }

    /// A little-endian number of `length` bytes, at most 8.
    fn number(&mut self, length: usize) -> Result<u64, FormatError> {
        let taken = self.take(length)?;
        Ok(taken.iter().rev().fold(0, |n, &b| n << 8 | u64::from(b)))
    }

    fn text(&mut self, length: usize) -> Result<&'a str, FormatError> {
        let taken = self.take(length)?;
        str::from_utf8(taken).or_else(|_| self.refuse("text in UTF-8", "other bytes"))
    }

    /// A line of text, without its end.
    fn line(&mut self) -> Result<&'a str, FormatError> {
        let Some(length) = self.bytes[self.at..].iter().position(|&b| b == b'\n') else {
            return self.refuse("a line", "the end of the pickle");
        };
        let line = self.text(length)?;
        self.at += 1;
        Ok(line)
    }

    /// The value on top of the stack. Values below a mark belong to it.
    fn top(&self) -> Result<Value<'a>, FormatError> {
        match self.stack.last() {
            None | Some(Value::Mark) => self.refuse("a value on the stack", "none"),
            Some(&value) => Ok(value),
        }
    }

    fn pop(&mut self) -> Result<Value<'a>, FormatError> {
        let value = self.top()?;
        self.stack.pop();
        Ok(value)
    }

    /// The values above the last mark, which is removed.
    fn pop_mark(&mut self) -> Result<Vec<Value<'a>>, FormatError> {
        let Some(mark) = self.stack.iter().rposition(|value| matches!(value, Value::Mark)) else {
            return self.refuse("a mark on the stack", "none");
        };
        let values = self.stack.split_off(mark + 1);
        self.stack.pop();
        Ok(values)
    }

    fn push_tuple(&mut self, values: Vec<Value<'a>>) {
        self.tuples.push(values);
        self.stack.push(Value::Tuple(self.tuples.len() - 1));
    }

    fn push_dict(&mut self) {
        self.dicts.push(Vec::new());
        self.stack.push(Value::Dict(self.dicts.len() - 1));
    }

    /// Puts keys and values, one after the other, into the dict on top of the stack.
    fn set(&mut self, items: &[Value<'a>]) -> Result<(), FormatError> {
        let Value::Dict(dict) = self.top()? else {
            return self.refuse("a dict to put values into", self.top()?.kind());
        };
        let (pairs, []) = items.as_chunks() else {
            return self.refuse("pairs of keys and values", "a key alone");
        };
        self.dicts[dict].extend(pairs.iter().map(|&[key, value]| (key, value)));
        Ok(())
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
            b'(' => self.stack.push(Value::Mark),
            b'N' => self.stack.push(Value::None),
            0x88 | 0x89 => self.stack.push(Value::Bool),
            b'K' => self.push_integer(1, false)?,
            b'M' => self.push_integer(2, false)?,
            b'J' => self.push_integer(4, true)?,
            0x8a => {
                let length = usize::from(self.take(1)?[0]);
                self.push_integer(length, true)?;
            }
            b'G' => {
                self.take(8)?;
                self.stack.push(Value::Float);
            }
            b'X' => {
                let length = self.number(4)? as usize;
                let text = self.text(length)?;
                self.stack.push(Value::Str(text));
            }
            b')' => self.push_tuple(Vec::new()),
            0x85..=0x87 => {
                let mut values = (0x84..opcode).map(|_| self.pop()).collect::<Result<Vec<_>, _>>()?;
                values.reverse();
                self.push_tuple(values);
            }
            b't' => {
                let values = self.pop_mark()?;
                self.push_tuple(values);
            }
            b']' => self.stack.push(Value::List),
            b'a' => {
                self.pop()?;
                self.append()?;
            }
            b'e' => {
                self.pop_mark()?;
                self.append()?;
            }
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
                let place = self.number(if opcode == b'q' { 1 } else { 4 })?;
                self.memo.insert(place, self.top()?);
            }
            b'h' | b'j' => {
                let place = self.number(if opcode == b'h' { 1 } else { 4 })?;
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

    /// An integer of `length` bytes, in two's complement if it is `signed`.
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
    fn append(&self) -> Result<(), FormatError> {
        match self.top()? {
            Value::List => Ok(()),
            other => self.refuse("a list to append to", other.kind()),
        }
    }

    fn global(&mut self) -> Result<(), FormatError> {
        let (module, name) = (self.line()?, self.line()?);
        let Some((_, _, global)) = GLOBALS.iter().find(|(m, n, _)| (*m, *n) == (module, name)) else {
            let found = format!("{module}.{name}").chars().take(120).collect::<String>();
            if self.makes_instance() {
                return Err(FormatError::Object { at: self.opcode, class: quoted(&found) });
            }
            return self.refuse(
                "OrderedDict, a tensor, a parameter or a storage, as torch.save(model.state_dict(), FILE) writes them",
                format!("{found:?}"),
            );
        };
        self.stack.push(Value::Global(*global));
        Ok(())
    }

    /// Whether the next instructions make an instance of the preceding class: no arguments, then
    /// NEWOBJ, perhaps after the memo of the class.
    fn makes_instance(&self) -> bool {
        let rest = &self.bytes[self.at..];
        let memo = match rest.first() {
            Some(b'q') => 2,
            Some(b'r') => 5,
            _ => 0,
        };
        rest.get(memo..).is_some_and(|rest| rest.starts_with(b")\x81"))
    }

    /// BINPERSID: ("storage", type, key, location, number of values).
    fn persistent(&mut self) -> Result<(), FormatError> {
        let id = self.pop()?;
        let &[
            Value::Str("storage"),
            Value::Global(Global::Storage(scalar)),
            Value::Str(key),
            Value::Str(_),
            Value::Int(values @ 0..),
        ] = self.tuple(id)?
        else {
            return self.refuse("a storage's type, key, location and number of values", "other fields");
        };
        self.stack.push(Value::Storage(Storage { key, scalar, values: values as usize }));
        Ok(())
    }

    fn tuple(&self, value: Value<'a>) -> Result<&[Value<'a>], FormatError> {
        match value {
            Value::Tuple(tuple) => Ok(&self.tuples[tuple]),
            other => self.refuse("a tuple", other.kind()),
        }
    }

    /// A tuple of numbers from 0.
    fn sizes(&self, value: Value<'a>) -> Result<Vec<usize>, FormatError> {
        let sizes = self.tuple(value)?.iter().map(|value| match *value {
            Value::Int(size @ 0..) => Ok(size as usize),
            _ => self.refuse("a tuple of numbers from 0", "others"),
        });
        sizes.collect()
    }

    /// REDUCE: the three known callables.
    fn reduce(&mut self) -> Result<(), FormatError> {
        let (arguments, callable) = (self.pop()?, self.pop()?);
        let arguments = self.tuple(arguments)?;
        match (callable, arguments) {
            (Value::Global(Global::OrderedDict), []) => self.push_dict(),
            (
                Value::Global(Global::RebuildTensor),
                &[
                    Value::Storage(storage),
                    Value::Int(offset @ 0..),
                    shape,
                    strides,
                    Value::Bool,
                    Value::Dict(_),
                    ..,
                ],
            ) if arguments.len() <= 7 => {
                let (shape, strides) = (self.sizes(shape)?, self.sizes(strides)?);
                if shape.len() != strides.len() || shape.len() > 16 {
                    return self.refuse("as many strides as sizes, at most 16", strides.len().to_string());
                }
                self.tensors.push(View { storage, offset: offset as usize, shape, strides });
                self.stack.push(Value::Tensor(self.tensors.len() - 1));
            }
            (
                Value::Global(Global::RebuildParameter),
                &[tensor @ Value::Tensor(_), Value::Bool, Value::Dict(_)],
            ) => self.stack.push(tensor),
            _ => return self.refuse("an OrderedDict(), a tensor or a parameter", callable.kind()),
        }
        Ok(())
    }

    /// BUILD: attributes of an `OrderedDict` (`_metadata`), which no tensor needs.
    fn build(&mut self) -> Result<(), FormatError> {
        self.pop()?;
        match self.top()? {
            Value::Dict(_) => Ok(()),
            other => self.refuse("an OrderedDict to give attributes", other.kind()),
        }
    }
}

impl Value<'_> {
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Mark => "a mark",
            Self::None => "None",
            Self::Bool => "a truth value",
            Self::Int(_) => "an integer",
            Self::Float => "a float",
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
