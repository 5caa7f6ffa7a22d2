//! `NumPy` structured arrays of one dimension: events from and to `.npy`.
//!
//! A file has the bytes `\x93NUMPY`, the version (two bytes), the length of the header (16 bits in
//! version 1, 32 in 2 and 3), the header, and the records. The header is the text of a Python
//! dictionary with the keys `descr`, a list of the fields' names and types, `fortran_order` and
//! `shape`. Source: the documentation of `numpy.lib.format`.
//!
//! The reader finds the fields t (microseconds), x, y and p or `on` by name, in any order. They are
//! integers of any width and byte order, or floats ([`field`]); p may also be booleans, 0/1 or
//! -1/+1. Other fields and padding are skipped. Times as floats are whole microseconds, or in the
//! unit that the caller names, or in seconds if any of them has four or more decimals, as in a
//! text. Odd records are left out and counted unless the reader is strict. Four arrays of an `.npz`
//! are assembled to records ([`joined`]). The writer writes `[('t', '<i8'), ('x', '<u2'), ('y',
//! '<u2'), ('p', '|u1')]`. The header names no sensor.

mod field;
mod integers;

use std::io::{self, Write};

use meissner_engine::Event;

use crate::bytes::Bytes;
use crate::csv::TimeUnit;
use crate::csv::layout::DECIMALS_OF_SECONDS;
use crate::error::{IoError, shown};
use crate::format::{Format, POLARITY, TIME, X, Y};
use crate::left_out::{LeftOutKind, PassedOver};
use crate::limits::NPY_HEADER_BYTES;
use crate::options::ReadOptions;
use crate::prophesee::WrappingClock;
use crate::recording::Recording;
use crate::seek::Records;
use crate::text::Number;
use field::Field;
pub(crate) use integers::Integers;

/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";

/// The events of the file `bytes`.
pub(crate) fn decode(bytes: &[u8], options: ReadOptions) -> Result<Recording, IoError> {
    let file = Bytes::file(Format::Npy.name(), bytes);
    let layout = Layout::open(file, options)?;
    let records = file.after(layout.start);
    let (promised, there) = (layout.promised(), records.len() as u64);
    if there < promised && !options.salvage {
        return Err(file.truncated("array", layout.start, promised, false));
    }
    let salvaged = (there < promised).then(|| {
        let rest = records.len().checked_rem(layout.stride).unwrap_or(0);
        file.salvage("array", bytes.len() - rest)
    });
    if there > promised {
        let expected = format!("the end of the file after {} events", layout.count);
        return Err(file.malformed("array", layout.start, expected, format!("{there} bytes of events")));
    }
    Ok(Recording { salvaged, ..layout.events(records)? })
}

/// The layout of the records.
#[derive(Clone)]
pub(crate) struct Layout {
    /// Time, column, row and polarity.
    fields: [Field; 4],
    /// Bytes of a record.
    stride: usize,
    /// Number of records according to the header.
    count: u64,
    /// Byte of the file at which the first record starts.
    start: usize,
    strict: bool,
    /// The unit of the times, if the caller names it; otherwise it is found from the floats.
    unit: Option<TimeUnit>,
}

/// The content of the header of an array of `N` dimensions; `descr` has its type.
struct Header<T, const N: usize> {
    /// Byte of the file at which the text starts.
    text_at: usize,
    /// Byte of the file at which the content starts.
    start: usize,
    descr: T,
    shape: [u64; N],
}

impl<T, const N: usize> Header<T, N> {
    /// Reads magic, version and header, with `descr` for the type.
    fn parse<'a>(
        file: Bytes<'a>,
        descr: impl Fn(&mut Scanner<'a>) -> Result<T, IoError>,
    ) -> Result<Self, IoError> {
        let what = "magic and version";
        let magic = file.get(what, 0, 8)?;
        let (length, text_at) = match (magic.starts_with(MAGIC), magic[6]) {
            (true, 1) => (u64::from(file.u16("length of the header", 8)?), 10),
            (true, 2 | 3) => (u64::from(file.u32("length of the header", 8)?), 12),
            _ => {
                let expected = "\\x93NUMPY and version 1, 2 or 3";
                return Err(file.malformed(what, 0, expected, magic.escape_ascii()));
            }
        };
        if length > NPY_HEADER_BYTES {
            return Err(file.too_large("header", text_at, NPY_HEADER_BYTES, length, false));
        }
        let start = text_at + file.get("header", text_at, length as usize)?.len();
        let mut scanner = Scanner { file: Bytes { data: &file.data[..start], ..file }, at: text_at };
        let (mut found, mut sizes) = (None, None);
        scanner.expect(b'{')?;
        while !scanner.eat(b'}') {
            let key = scanner.string()?;
            scanner.expect(b':')?;
            match key {
                b"descr" => found = Some(descr(&mut scanner)?),
                b"shape" => sizes = Some(shape(&mut scanner)?),
                // With one dimension, both orders are the same.
                b"fortran_order" if matches!((scanner.word(), N), (b"False", _) | (b"True", 1)) => {}
                _ => {
                    let orders = if N == 1 { "True or False" } else { "False" };
                    let expected = format!("the keys descr, fortran_order ({orders}) and shape");
                    return Err(scanner.error(&expected));
                }
            }
            if scanner.peek() != Some(b'}') {
                scanner.expect(b',')?;
            }
        }
        if scanner.peek().is_some() {
            return Err(scanner.error("nothing after the dictionary"));
        }
        let Some((descr, shape)) = found.zip(sizes) else {
            return Err(scanner.error("the keys descr and shape"));
        };
        Ok(Self { text_at, start, descr, shape })
    }
}

/// An array of `N` dimensions of values of `W` bytes, in C order.
pub(crate) struct Array<'a, const N: usize, const W: usize> {
    pub(crate) shape: [u64; N],
    /// The values; their number is that of the shape.
    pub(crate) values: &'a [[u8; W]],
    /// Byte of the file at which the values start.
    pub(crate) start: usize,
}

/// The array in the file `bytes`, whose values have the type `expected`, such as `<f4`.
pub(crate) fn array_of<'a, const N: usize, const W: usize>(
    bytes: &'a [u8],
    expected: &'static str,
) -> Result<Array<'a, N, W>, IoError> {
    let file = Bytes::file(Format::Npy.name(), bytes);
    let descr = |scanner: &mut Scanner<'_>| match scanner.string()? {
        found if found == expected.as_bytes() => Ok(()),
        other => Err(scanner.error(&format!("the type {expected} before this, not {}", shown(other)))),
    };
    let Header { start, shape, .. } = Header::<_, N>::parse(file, descr)?;
    check_size(file, start, W, &shape)?;
    // A multiple of the width, as promised.
    Ok(Array { shape, values: bytes[start..].as_chunks().0, start })
}

/// `Ok` if `file` has the values of `width` bytes that `shape` promises from byte `start` on.
fn check_size(file: Bytes<'_>, start: usize, width: usize, shape: &[u64]) -> Result<(), IoError> {
    let promised = shape.iter().fold(width as u64, |bytes, &size| bytes.saturating_mul(size));
    let found = file.len() - start;
    if found as u64 == promised {
        return Ok(());
    }
    let expected = format!("{promised} bytes of the shape {shape:?}");
    Err(file.malformed("array", start, expected, found))
}

/// A column of the records by its name; `None`: it is skipped because of its type.
type Column<'a> = (&'a [u8], Option<Field>);

impl Records for Layout {
    const PERIOD: Option<i64> = None;

    fn open(file: Bytes<'_>, options: ReadOptions) -> Result<Self, IoError> {
        let Header { text_at, start, descr: (columns, stride), shape: [count] } =
            Header::parse(file, columns)?;
        let find = |what: &'static str, known: &[&str]| {
            let is_known = |name: &[u8]| known.iter().any(|k| name.eq_ignore_ascii_case(k.as_bytes()));
            let mut found = columns.iter().filter(|(name, _)| is_known(name));
            let (expected, actual) = match (found.next(), found.next()) {
                (Some(&(_, Some(field))), None) => return Ok(field),
                (Some(_), None) => ("integers or floats".to_owned(), "another type"),
                (None, _) => (format!("a field {}", known.join(" or ")), "none"),
                (Some(_), Some(_)) => ("one field".to_owned(), "two"),
            };
            Err(file.malformed(what, text_at, expected, actual))
        };
        let (t, x) = (find("field t (time)", TIME)?, find("field x", X)?);
        let (y, p) = (find("field y", Y)?, find("field p (polarity)", POLARITY)?);
        Ok(Self {
            fields: [t, x, y, p],
            stride,
            count,
            start,
            strict: options.strict,
            unit: options.text.time_unit,
        })
    }

    fn start(&self) -> usize {
        self.start
    }

    fn stride(&self) -> usize {
        self.stride
    }

    fn is_whole(&self, length: u64) -> bool {
        // The unit of floats is found from all times together.
        length - self.start as u64 == self.promised() && !self.fields[0].is_float()
    }

    fn clock(&self, record: &[u8]) -> Option<i64> {
        let power = self.unit.map_or(0, |unit| unit.name_and_power().1);
        self.fields[0].scaled(record, power)?.try_into().ok()
    }

    fn decode(&self, records: Bytes<'_>, _: WrappingClock, _: bool) -> Result<Recording, IoError> {
        self.events(records)
    }
}

impl Layout {
    /// Bytes of all records according to the header.
    fn promised(&self) -> u64 {
        self.count.saturating_mul(self.stride as u64)
    }

    /// The events of the complete records of `records`.
    fn events(&self, records: Bytes<'_>) -> Result<Recording, IoError> {
        let mut events = Vec::with_capacity((self.count as usize).min(records.len()));
        let mut passed = PassedOver::new(self.strict);
        let power = match self.unit {
            None if self.fields[0].is_float() => self.power_of_floats(records)?,
            unit => unit.map_or(0, |unit| unit.name_and_power().1),
        };
        for (index, record) in records.data.chunks_exact(self.stride).enumerate() {
            let [t, x, y, p] = self.fields;
            let values = [t.scaled(record, power), x.whole(record), y.whole(record), p.whole(record)];
            let [t_us, x, y, p] = values.map(|value| value.unwrap_or(i128::MAX));
            let (field, what, expected) = match (t_us.try_into(), x.try_into(), y.try_into(), p) {
                (Ok(t_us), Ok(x), Ok(y), -1..=1) => {
                    events.push(Event { t_us, x, y, on: p == 1 });
                    continue;
                }
                (Err(_), ..) => (0, "time t", "a time from -2^63 to 2^63 - 1"),
                (_, Err(_), ..) => (1, "column x", "0 to 65535"),
                (_, _, Err(_), _) => (2, "row y", "0 to 65535"),
                _ => (3, "polarity p", "0, 1 or -1"),
            };
            let at = index * self.stride + self.fields[field].offset;
            passed.pass(
                LeftOutKind::Malformed,
                1,
                records.malformed(what, at, expected, self.fields[field].text(record)),
            )?;
        }
        Ok(Recording { left_out: passed.end(), ..Recording::of_events(Format::Npy, None, events) })
    }
}

impl Layout {
    /// The power of ten that converts times as floats to microseconds, if the caller names no unit.
    fn power_of_floats(&self, records: Bytes<'_>) -> Result<i32, IoError> {
        let times = || records.data.chunks_exact(self.stride).map(|record| self.fields[0].text(record));
        let decimals = |time: String| Number::parse(time.as_bytes()).map_or(0, Number::decimals);
        match times().map(decimals).max().unwrap_or(0) {
            0 => Ok(0),
            DECIMALS_OF_SECONDS.. => Ok(TimeUnit::Seconds.name_and_power().1),
            _ => {
                let first = times().find(|time| decimals(time.clone()) > 0).unwrap_or_default();
                let (expected, actual) =
                    ("whole microseconds, seconds, or an option that names the unit", first);
                Err(records.malformed("time t", self.fields[0].offset, expected, actual))
            }
        }
    }
}

/// The structured array of four arrays of one dimension: time, column, row and polarity.
pub(crate) fn joined(files: &[Vec<u8>; 4]) -> Result<Vec<u8>, IoError> {
    let (mut types, mut columns, mut counts) = (Vec::new(), Vec::new(), Vec::new());
    for (bytes, name) in files.iter().zip(["t", "x", "y", "p"]) {
        let file = Bytes::file(Format::Npy.name(), bytes);
        let Header { start, descr: (text, width), shape: [count], .. } =
            Header::<_, 1>::parse(file, array_type)?;
        let values = &bytes[start..];
        let promised = count.saturating_mul(width as u64);
        if values.len() as u64 != promised {
            return Err(file.malformed("array", start, format!("{promised} bytes"), values.len()));
        }
        types.push(format!("('{name}', '{}')", text.escape_ascii()));
        columns.push((values, width));
        counts.push(count);
    }
    if counts.iter().any(|count| *count != counts[0]) {
        let file = Bytes::file(Format::Npy.name(), &[]);
        return Err(file.malformed("lengths of t, x, y and p", 0, "one length", format!("{counts:?}")));
    }
    let header =
        format!("{{'descr': [{}], 'fortran_order': False, 'shape': ({},), }}", types.join(", "), counts[0]);
    let mut bytes = [MAGIC, &[1, 0], &(header.len() as u16).to_le_bytes(), header.as_bytes()].concat();
    bytes.reserve(columns.iter().map(|(values, _)| values.len()).sum());
    for index in 0..counts[0] as usize {
        for (values, width) in &columns {
            bytes.extend_from_slice(&values[index * width..][..*width]);
        }
    }
    Ok(bytes)
}

/// The type of an array that can be a column of events, and the bytes of a value.
fn array_type<'a>(scanner: &mut Scanner<'a>) -> Result<(&'a [u8], usize), IoError> {
    let text = scanner.string()?;
    match Field::of_type(text, 0) {
        Some((Some(_), width)) => Ok((text, width)),
        _ => Err(scanner.error(&format!("integers or floats before this, not {}", shown(text)))),
    }
}

/// The role of an array in a recording.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// Records of events.
    Events,
    /// Values of one dimension, which can be a column of events.
    Column,
    Other,
}

/// The role of the array in the file that starts with `start`.
pub(crate) fn part(start: &[u8]) -> Part {
    let file = Bytes::file(Format::Npy.name(), start);
    if Layout::open(file, ReadOptions::default()).is_ok() {
        Part::Events
    } else if Header::<_, 1>::parse(file, array_type).is_ok() {
        Part::Column
    } else {
        Part::Other
    }
}

/// The list of fields, and the bytes of a record.
fn columns<'a>(scanner: &mut Scanner<'a>) -> Result<(Vec<Column<'a>>, usize), IoError> {
    if !scanner.eat(b'[') {
        return Err(scanner.error("a structured array: a list of fields"));
    }
    let (mut columns, mut stride) = (Vec::new(), 0_usize);
    while !scanner.eat(b']') {
        scanner.expect(b'(')?;
        // A field with a title has a pair of title and name instead of the name.
        let has_title = scanner.eat(b'(');
        let mut name = scanner.string()?;
        if has_title {
            scanner.expect(b',')?;
            name = scanner.string()?;
            scanner.expect(b')')?;
        }
        scanner.expect(b',')?;
        let text = scanner.string()?;
        let Some((field, bytes)) = Field::of_type(text, stride) else {
            let expected = format!("a type of fixed size before this, not {}", shown(text));
            return Err(scanner.error(&expected));
        };
        scanner.expect(b')')?;
        columns.push((name, field));
        // The header has at most 2^16 bytes and each field is below 2^32: no overflow in 64 bits.
        stride = stride.saturating_add(bytes);
        if scanner.peek() != Some(b']') {
            scanner.expect(b',')?;
        }
    }
    Ok((columns, stride))
}

/// The lengths of an array of `N` dimensions.
fn shape<const N: usize>(scanner: &mut Scanner<'_>) -> Result<[u64; N], IoError> {
    let mut sizes = [0; N];
    scanner.expect(b'(')?;
    for (i, size) in sizes.iter_mut().enumerate() {
        let before = scanner.at;
        let Some(count) = str::from_utf8(scanner.word()).ok().and_then(|digits| digits.parse().ok()) else {
            scanner.at = before;
            return Err(scanner.error("an integer from 0 to 2^64 - 1"));
        };
        *size = count;
        // Only a tuple with one element needs a comma at its end.
        if i == 0 || i + 1 < N {
            scanner.expect(b',')?;
        }
    }
    let end = scanner.eat(b')') || (N > 1 && scanner.eat(b',') && scanner.eat(b')'));
    let dimensions = if N == 1 { "one dimension".to_owned() } else { format!("{N} dimensions") };
    if end { Ok(sizes) } else { Err(scanner.error(&format!("an array of {dimensions}"))) }
}

/// A tokenizer of the few Python literals of a header.
///
/// It does not recurse: the grammar of a header is fixed, so nested text cannot use up the stack.
struct Scanner<'a> {
    /// The file up to the end of the header.
    file: Bytes<'a>,
    at: usize,
}

impl<'a> Scanner<'a> {
    fn tail(&self) -> &'a [u8] {
        &self.file.data[self.at..]
    }

    /// The next byte that is not a space, without taking it.
    fn peek(&mut self) -> Option<u8> {
        self.at = self.file.len() - self.tail().trim_ascii_start().len();
        self.tail().first().copied()
    }

    /// Takes the byte if it comes next.
    fn eat(&mut self, byte: u8) -> bool {
        let comes = self.peek() == Some(byte);
        self.at += usize::from(comes);
        comes
    }

    fn expect(&mut self, byte: u8) -> Result<(), IoError> {
        if self.eat(byte) { Ok(()) } else { Err(self.error(&format!("`{}`", byte.escape_ascii()))) }
    }

    /// A string in single or double quotes. Escapes are refused: no name of a field needs one.
    fn string(&mut self) -> Result<&'a [u8], IoError> {
        let Some(quote @ (b'\'' | b'"')) = self.peek() else {
            return Err(self.error("a string"));
        };
        let tail = &self.tail()[1..];
        match tail.iter().position(|&b| b == quote || b == b'\\') {
            Some(length) if tail[length] == quote => {
                self.at += length + 2;
                Ok(&tail[..length])
            }
            _ => Err(self.error("a string with an end and without escapes")),
        }
    }

    /// A name such as `True`, or a number.
    fn word(&mut self) -> &'a [u8] {
        self.peek();
        let word = self.tail();
        let length = word.iter().take_while(|b| b.is_ascii_alphanumeric()).count();
        self.at += length;
        &word[..length]
    }

    /// The error of a text that differs from `expected` at this position.
    fn error(&self, expected: &str) -> IoError {
        let actual = match self.tail() {
            [] => "the end of the header".to_owned(),
            tail => shown(&tail[..tail.len().min(24)]),
        };
        self.file.malformed("header", self.at, expected, actual)
    }
}

/// The records start at a multiple of this many bytes, as `numpy.save` does.
const ALIGNMENT: usize = 64;
/// Magic, version, and length of the header.
const FIXED: usize = 10;

/// Writes the header and a record for each of `events`.
pub(crate) fn encode(events: &[Event], out: &mut impl Write) -> io::Result<()> {
    let fields = "[('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', '|u1')]";
    let header = format!("{{'descr': {fields}, 'fortran_order': False, 'shape': ({},), }}", events.len());
    let length = (FIXED + header.len() + 1).next_multiple_of(ALIGNMENT) - FIXED;
    out.write_all(MAGIC)?;
    out.write_all(&[1, 0])?;
    out.write_all(&(length as u16).to_le_bytes())?;
    writeln!(out, "{header:0$}", length - 1)?;
    for event in events {
        out.write_all(&event.t_us.to_le_bytes())?;
        out.write_all(&event.x.to_le_bytes())?;
        out.write_all(&event.y.to_le_bytes())?;
        out.write_all(&[event.on.into()])?;
    }
    Ok(())
}
