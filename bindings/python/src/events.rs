//! Events from `NumPy`.
//!
//! Input: a structured array with fields in any order, four arrays, or a recording. Output: blocks
//! of [`Event`]. An array is read in place, with any strides and byte order. Invariant: it is read
//! only while the interpreter lock is held, and values are checked before the first block.

use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner::Event;
use meissner::io::EVENT_FIELDS;
use numpy::ndarray::{ArrayView2, Axis, Slice};
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMappingProxy, PySlice, PyTuple};

use crate::error::{Failure, Outcome};
use crate::recording::Recording;

/// Number of events of a block.
const BLOCK: usize = 4096;
/// Time that work runs before signals are handled.
const TURN: Duration = Duration::from_millis(50);

/// The division of work on events.
#[derive(Clone, Copy)]
pub(crate) struct Parts {
    /// Up to so many events do not release the interpreter.
    few: usize,
    /// Number of events between two reads of the clock.
    stride: usize,
}

/// For work of microseconds per event.
const COMPUTED: Parts = Parts { few: 32, stride: 8 };
/// For work that only copies, and that may wait.
pub(crate) const QUEUED: Parts = Parts { few: 0, stride: 512 };

/// A type of integers.
#[derive(Clone, Copy)]
struct Integer {
    size: usize,
    signed: bool,
    /// Whether the byte order differs from this machine's.
    swapped: bool,
}

/// One value of each event, in the memory of an array.
pub(crate) struct Column<'py> {
    /// (events, bytes).
    bytes: PyReadonlyArray2<'py, u8>,
    offset: usize,
    integer: Integer,
}

/// Events from any source.
pub(crate) enum Events<'py> {
    /// t, x, y, p.
    Columns([Column<'py>; 4]),
    Recorded(Arc<Vec<Event>>),
}

impl<'py> Events<'py> {
    /// The events of the arguments of a method `push`: one object, or four arrays.
    pub(crate) fn of_call(
        args: &Bound<'py, PyTuple>,
        keywords: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Self> {
        let mut found = [const { None }; 5];
        if args.len() > 1 {
            return Err(wrong_call(format!("push: expected one argument by place, found {}", args.len())));
        }
        if let Ok(events) = args.get_item(0) {
            found[0] = Some(events);
        }
        for (name, value) in keywords.into_iter().flatten() {
            let name: String = name.extract()?;
            let field = EVENT_FIELDS.iter().position(|names| names.contains(&&*name));
            let place = if name == "events" { Some(0) } else { field.map(|field| field + 1) };
            let place =
                place.ok_or_else(|| wrong_call(format!("push: expected t, x, y and p, found {name}")))?;
            if found[place].is_some() {
                return Err(wrong_call(format!("push: expected {name} once, found it twice")));
            }
            found[place] = Some(value);
        }
        let [events, four @ ..] = found.map(|value| value.filter(|value| !value.is_none()));
        match (events, four) {
            (Some(events), [None, None, None, None]) => Self::new(&events),
            (None, [Some(t), Some(x), Some(y), Some(p)]) => Self::of_four([&t, &x, &y, &p])?.checked(),
            _ => Err(Failure::input("events: expected one array of events, or all of t, x, y and p")),
        }
    }

    /// The events of one object.
    pub(crate) fn new(events: &Bound<'py, PyAny>) -> Outcome<Self> {
        Self::of_object(events)?.checked()
    }

    fn checked(self) -> Outcome<Self> {
        self.check()?;
        Ok(self)
    }

    fn of_object(events: &Bound<'py, PyAny>) -> Outcome<Self> {
        if let Ok(recording) = events.cast::<Recording>() {
            return Ok(Self::Recorded(recording.borrow().events()?));
        }
        let array = as_array("events", events)?;
        let dtype = array.getattr("dtype")?;
        let fields = dtype.getattr("fields")?;
        let Ok(fields) = fields.cast::<PyMappingProxy>() else {
            if array.len()? == 0 {
                return Ok(Self::Recorded(Arc::default()));
            }
            let shape: String = array.getattr("shape")?.str()?.to_string();
            return Err(Failure::dtype(format!(
                "events: expected a structured array with fields t, x, y, p, found an array of {dtype} and shape {shape}; \
                 give columns as t=, x=, y=, p="
            )));
        };
        let bytes = bytes_of(&array)?;
        let found = fields.as_any().call_method0("keys")?.try_iter()?;
        let found: Vec<String> = found.map(|name| name?.extract()).collect::<PyResult<_>>()?;
        let column = |names: &[&'static str]| {
            let of = |name: &&str| found.iter().find(|field| field.to_lowercase() == **name);
            let Some(name) = names.iter().find_map(of) else {
                let expected = names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(" or ");
                let text = format!("events: expected a field {expected}, found {found:?}");
                return Err(Failure::dtype(text));
            };
            let field = fields.get_item(name)?.cast_into::<PyTuple>().map_err(PyErr::from)?;
            let dtype = field.get_item(0)?;
            if is_duration(&dtype)? {
                return Column::of(names[0], &array.get_item(name)?);
            }
            let integer = Integer::of(names[0], &dtype)?;
            let bytes = bytes.clone().try_readonly().map_err(PyErr::from)?;
            Ok(Column { bytes, offset: field.get_item(1)?.extract()?, integer })
        };
        let [t, x, y, p] = EVENT_FIELDS;
        Ok(Self::Columns([column(t)?, column(x)?, column(y)?, column(p)?]))
    }

    fn of_four(four: [&Bound<'py, PyAny>; 4]) -> Outcome<Self> {
        let mut columns = Vec::with_capacity(4);
        for (name, array) in ["t", "x", "y", "p"].into_iter().zip(four) {
            columns.push(Column::of(name, &as_array(name, array)?)?);
        }
        let lengths: Vec<usize> = columns.iter().map(Column::len).collect();
        if lengths.iter().any(|length| *length != lengths[0]) {
            let found = format!("{}, {}, {} and {}", lengths[0], lengths[1], lengths[2], lengths[3]);
            return Err(Failure::input(format!("t, x, y, p: expected equal lengths, found {found}")));
        }
        let columns: [Column<'py>; 4] =
            columns.try_into().unwrap_or_else(|_| unreachable!("there are four columns"));
        Ok(Self::Columns(columns))
    }

    /// Refuses times beyond signed 64 bits, and polarities other than -1, 0 and 1.
    fn check(&self) -> Outcome<()> {
        let Self::Columns([times, .., polarities]) = self else { return Ok(()) };
        if times.integer.size == 8 && !times.integer.signed {
            times.all("t", "at most 2^63 - 1 us", |t| t >= 0, |t| t.cast_unsigned().to_string())?;
        }
        polarities.all("p", "polarities -1, 0 or 1", |p| (-1..=1).contains(&p), |p| p.to_string())
    }

    /// Number of events.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Columns([times, ..]) => times.len(),
            Self::Recorded(events) => events.len(),
        }
    }

    /// Appends the events of `range`. A coordinate beyond 16 bits becomes 65535, which is outside
    /// every sensor.
    fn append(&self, range: Range<usize>, scratch: &mut [Vec<i64>; 4], to: &mut Vec<Event>) {
        match self {
            Self::Recorded(events) => to.extend_from_slice(&events[range]),
            Self::Columns(columns) => {
                for (column, values) in columns.iter().zip(&mut *scratch) {
                    column.read(range.clone(), values);
                }
                let [t, x, y, p] = scratch;
                let pixel = |value: i64| u16::try_from(value).unwrap_or(u16::MAX);
                let events = t.iter().zip(x).zip(y).zip(p);
                to.extend(events.map(|(((t, x), y), p)| Event::new(*t, pixel(*x), pixel(*y), *p > 0)));
            }
        }
    }

    /// All events, checked to have coordinates within 16 bits.
    pub(crate) fn to_vec(&self) -> Outcome<Vec<Event>> {
        if let Self::Columns([_, x, y, _]) = self {
            for (name, column) in [("x", x), ("y", y)] {
                column.all(name, "0 to 65535", |value| u16::try_from(value).is_ok(), |v| v.to_string())?;
            }
        }
        Ok(self.to_vec_clamped())
    }

    /// All events; coordinates beyond 16 bits become 65535.
    pub(crate) fn to_vec_clamped(&self) -> Vec<Event> {
        let (mut events, mut scratch) = (Vec::with_capacity(self.len()), Default::default());
        for start in (0..self.len()).step_by(BLOCK) {
            self.append(start..self.len().min(start + BLOCK), &mut scratch, &mut events);
        }
        events
    }

    /// Passes all events to `work`, in order. Other threads run meanwhile, and signals are handled
    /// about every 50 ms: after an exception of a handler (Ctrl-C), the remaining events are not
    /// processed.
    pub(crate) fn work(
        &self,
        py: Python<'py>,
        work: impl FnMut(&[Event]) -> Outcome<()> + Send,
    ) -> Outcome<()> {
        self.work_in(py, COMPUTED, work)
    }

    /// As [`Self::work`], event by event.
    pub(crate) fn each(&self, py: Python<'py>, mut take: impl FnMut(Event) + Send) -> Outcome<()> {
        self.work(py, |part| {
            part.iter().copied().for_each(&mut take);
            Ok(())
        })
    }

    /// As [`Self::work`], with other parts.
    pub(crate) fn work_in(
        &self,
        py: Python<'py>,
        parts: Parts,
        mut work: impl FnMut(&[Event]) -> Outcome<()> + Send,
    ) -> Outcome<()> {
        let mut block = Vec::with_capacity(self.len().min(BLOCK));
        let mut scratch = Default::default();
        for start in (0..self.len()).step_by(BLOCK) {
            block.clear();
            self.append(start..self.len().min(start + BLOCK), &mut scratch, &mut block);
            if self.len() <= parts.few {
                work(&block)?;
                continue;
            }
            let mut rest = &block[..];
            while !rest.is_empty() {
                let done = py.detach(|| turn(rest, parts.stride, &mut work))?;
                rest = &rest[done..];
                py.check_signals()?;
            }
        }
        Ok(())
    }
}

/// Arguments that fit no signature.
fn wrong_call(message: String) -> Failure {
    PyTypeError::new_err(message).into()
}

/// Works on events until it is time to handle signals; returns the number of them.
fn turn(events: &[Event], stride: usize, work: &mut impl FnMut(&[Event]) -> Outcome<()>) -> Outcome<usize> {
    let begin = Instant::now();
    let mut done = 0;
    for part in events.chunks(stride) {
        work(part)?;
        done += part.len();
        if begin.elapsed() > TURN {
            break;
        }
    }
    Ok(done)
}

impl Integer {
    /// The integers of `dtype`; booleans count as bytes of 0 and 1.
    fn of(name: &str, dtype: &Bound<'_, PyAny>) -> Outcome<Self> {
        let kind: String = dtype.getattr("kind")?.extract()?;
        if !matches!(&*kind, "i" | "u" | "b") {
            let expected = match name {
                "t" => "integers (microseconds) or timedelta64",
                "p" => "booleans or integers (-1, 0, 1)",
                _ => "integers (pixels)",
            };
            return Err(Failure::dtype(format!("{name}: expected {expected}, found {dtype}")));
        }
        let size: usize = dtype.getattr("itemsize")?.extract()?;
        let swapped = !dtype.getattr("isnative")?.extract::<bool>()?;
        Ok(Self { size, signed: kind == "i", swapped })
    }
}

/// Whether values of `dtype` are durations.
fn is_duration(dtype: &Bound<'_, PyAny>) -> PyResult<bool> {
    dtype.getattr("kind")?.eq("m")
}

impl<'py> Column<'py> {
    /// An array of one dimension. An empty one may have any type.
    fn of(name: &str, array: &Bound<'py, PyAny>) -> Outcome<Self> {
        let array = if array.len()? == 0 {
            array.call_method1("astype", ("i8",))?
        } else if name == "t" && is_duration(&array.getattr("dtype")?)? {
            array.py().import("meissner._durations")?.call_method1("microseconds", (array,))?
        } else {
            array.clone()
        };
        let integer = Integer::of(name, &array.getattr("dtype")?)?;
        let bytes = bytes_of(&array)?.try_readonly().map_err(PyErr::from)?;
        Ok(Self { bytes, offset: 0, integer })
    }

    fn len(&self) -> usize {
        self.bytes.as_array().nrows()
    }

    /// Refuses the first value for which `is` is false. The message has `expected` and the text of
    /// `found`.
    fn all(
        &self,
        name: &str,
        expected: &str,
        is: impl Fn(i64) -> bool,
        found: impl Fn(i64) -> String,
    ) -> Outcome<()> {
        let mut values = Vec::new();
        for start in (0..self.len()).step_by(BLOCK) {
            self.read(start..self.len().min(start + BLOCK), &mut values);
            if let Some(at) = values.iter().position(|&value| !is(value)) {
                let (found, at) = (found(values[at]), start + at);
                return Err(Failure::input(format!(
                    "{name}: expected {expected}, found {found} as event {at}"
                )));
            }
        }
        Ok(())
    }

    /// Replaces `values` by the values of `range`. Unsigned values above 2^63 - 1 become negative.
    fn read(&self, range: Range<usize>, values: &mut Vec<i64>) {
        values.clear();
        let bytes = self.bytes.as_array();
        let bytes = bytes.slice_axis(Axis(0), Slice::from(range));
        let bytes = bytes.slice_axis(Axis(1), Slice::from(self.offset..self.offset + self.integer.size));
        let swapped = self.integer.swapped;
        match (self.integer.size, self.integer.signed) {
            (1, true) => fill(bytes, swapped, values, |b| i8::from_ne_bytes(b).into()),
            (1, false) => fill(bytes, swapped, values, |b| u8::from_ne_bytes(b).into()),
            (2, true) => fill(bytes, swapped, values, |b| i16::from_ne_bytes(b).into()),
            (2, false) => fill(bytes, swapped, values, |b| u16::from_ne_bytes(b).into()),
            (4, true) => fill(bytes, swapped, values, |b| i32::from_ne_bytes(b).into()),
            (4, false) => fill(bytes, swapped, values, |b| u32::from_ne_bytes(b).into()),
            _ => fill(bytes, swapped, values, i64::from_ne_bytes),
        }
    }
}

/// Appends a value for each row of `N` bytes.
fn fill<const N: usize>(
    bytes: ArrayView2<'_, u8>,
    swapped: bool,
    values: &mut Vec<i64>,
    value: impl Fn([u8; N]) -> i64,
) {
    values.extend(bytes.outer_iter().map(|row| {
        // The bytes of one value are next to each other in every array.
        let row = row.to_slice().and_then(|row| row.try_into().ok());
        let mut row: [u8; N] = row.expect("a value has its bytes in a row");
        if swapped {
            row.reverse();
        }
        value(row)
    }));
}

/// `object` as an array of one dimension, without a copy if its memory is `NumPy`'s.
fn as_array<'py>(name: &str, object: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyAny>> {
    let numpy = object.py().import("numpy")?;
    let array = numpy.call_method1("atleast_1d", (numpy.call_method1("asarray", (object,))?,))?;
    if array.getattr("size")?.extract::<usize>()? == 0 {
        return Ok(array.call_method0("ravel")?);
    }
    let dimensions: usize = array.getattr("ndim")?.extract()?;
    if dimensions != 1 {
        let shape = array.getattr("shape")?;
        return Err(Failure::input(format!(
            "{name}: expected one dimension, found shape {shape}; give columns as t=, x=, y=, p="
        )));
    }
    Ok(array)
}

/// The memory of an array of one dimension as (elements, bytes), without a copy.
fn bytes_of<'py>(array: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyArray2<u8>>> {
    let py = array.py();
    // The last axis of a view of another size must be contiguous: it gets a single element.
    let column = array.get_item((PySlice::full(py), py.None()))?;
    let bytes = column.call_method1("view", ("u1",))?;
    Ok(bytes.cast_into::<PyArray2<u8>>().map_err(PyErr::from)?)
}
