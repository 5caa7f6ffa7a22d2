//! `NumPy` structured arrays of one dimension: events from and to `.npy`.
//!
//! A file has the bytes `\x93NUMPY`, the version (two bytes), the length of the header (16 bits in version 1, 32 in 2 and 3),
//! the header, and the records. The header is the text of a Python dictionary with the keys `descr`, a list of the fields'
//! names and types, `fortran_order` and `shape`. Source: the documentation of `numpy.lib.format`.
//!
//! The reader finds the fields t (microseconds), x, y and p or `on` by name, in any order. They are integers of any width and
//! byte order, p also booleans, 0/1 or -1/+1; other fields and padding are skipped. The writer writes
//! `[('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', '|u1')]`. The header has no place for the sensor.

use std::io::{self, Write};

use meissner_engine::Event;

use crate::bytes::{Bytes, array};
use crate::error::{IoError, shown};
use crate::format::{Format, POLARITY, TIME, X, Y};
use crate::limits::NPY_HEADER_BYTES;
use crate::recording::Recording;

/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";

/// The events of the file `bytes`.
pub(crate) fn decode(bytes: &[u8], salvage: bool) -> Result<Recording, IoError> {
    let format = Format::Npy;
    let file = Bytes::file(format.name(), bytes);
    let layout = Layout::parse(file)?;
    let records = &bytes[layout.start..];
    let promised = layout.count.saturating_mul(layout.stride as u64);
    let there = records.len() as u64;
    let salvaged = (there < promised && salvage).then(|| {
        let rest = records.len().checked_rem(layout.stride).unwrap_or(0);
        file.salvage("array", bytes.len() - rest)
    });
    if there < promised && !salvage {
        return Err(file.truncated("array", layout.start, promised, false));
    }
    if there > promised {
        let expected = format!("the end of the file after {} events", layout.count);
        return Err(file.malformed("array", layout.start, expected, format!("{there} bytes of events")));
    }

    let mut events = Vec::with_capacity((layout.count as usize).min(records.len()));
    for (index, record) in records.chunks_exact(layout.stride).enumerate() {
        let event = event(&layout, record).map_err(|(what, field, expected)| {
            let at = layout.start + index * layout.stride + field.offset;
            file.malformed(what, at, expected, value(field, record))
        })?;
        events.push(event);
    }
    Ok(Recording { format, sensor: None, events, other_streams: Vec::new(), salvaged })
}

/// The event of a record, or the field with a value that no event has: its name, its position, and the expected values.
fn event(layout: &Layout, record: &[u8]) -> Result<Event, (&'static str, Field, &'static str)> {
    let Layout { t, x, y, p, .. } = *layout;
    Ok(Event {
        t_us: value(t, record).try_into().map_err(|_| ("time t", t, "a time from -2^63 to 2^63 - 1"))?,
        x: value(x, record).try_into().map_err(|_| ("column x", x, "0 to 65535"))?,
        y: value(y, record).try_into().map_err(|_| ("row y", y, "0 to 65535"))?,
        on: match value(p, record) {
            1 => true,
            0 | -1 => false,
            _ => return Err(("polarity p", p, "0, 1 or -1")),
        },
    })
}

/// The value of a field; wide enough for every integer type.
#[inline]
fn value(field: Field, record: &[u8]) -> i128 {
    let bytes = &record[field.offset..];
    let Integer { bytes: width, signed, big_endian } = field.kind;
    let unsigned = match (width, big_endian) {
        (1, _) => bytes[0].into(),
        (2, false) => u16::from_le_bytes(array(bytes)).into(),
        (2, true) => u16::from_be_bytes(array(bytes)).into(),
        (4, false) => u32::from_le_bytes(array(bytes)).into(),
        (4, true) => u32::from_be_bytes(array(bytes)).into(),
        (_, false) => u64::from_le_bytes(array(bytes)),
        (_, true) => u64::from_be_bytes(array(bytes)),
    };
    if signed {
        // The shift up and back down fills the upper bits with the sign bit of the narrow type.
        let shift = 64 - 8 * width as u32;
        i128::from((unsigned << shift) as i64 >> shift)
    } else {
        unsigned.into()
    }
}

/// The position and type of a field in a record.
#[derive(Clone, Copy, Debug)]
struct Field {
    offset: usize,
    kind: Integer,
}

/// An integer type; a boolean is a byte without a sign.
#[derive(Clone, Copy, Debug)]
struct Integer {
    bytes: usize,
    signed: bool,
    big_endian: bool,
}

/// The layout of the records.
#[derive(Debug)]
struct Layout {
    t: Field,
    x: Field,
    y: Field,
    p: Field,
    /// Bytes of a record.
    stride: usize,
    /// Number of records according to the header.
    count: u64,
    /// Byte of the file at which the first record starts.
    start: usize,
}

/// A field of the record; `kind` is `None` if the field is skipped for its type.
struct Column<'a> {
    name: &'a [u8],
    offset: usize,
    kind: Option<Integer>,
}

impl Layout {
    /// Reads magic, version and header.
    fn parse(file: Bytes<'_>) -> Result<Self, IoError> {
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
        let mut scanner = Scanner::new(file, text_at, length as usize)?;
        let (mut record, mut count) = (None, None);
        scanner.expect(b'{')?;
        while !scanner.eat(b'}') {
            let key = scanner.string()?;
            scanner.expect(b':')?;
            match key {
                b"descr" => record = Some(columns(&mut scanner)?),
                b"shape" => count = Some(shape(&mut scanner)?),
                // With one dimension, both orders are the same.
                b"fortran_order" if matches!(scanner.word(), b"True" | b"False") => {}
                _ => return Err(scanner.error("the keys descr, fortran_order (True or False) and shape")),
            }
            if scanner.peek() != Some(b'}') {
                scanner.expect(b',')?;
            }
        }
        if scanner.peek().is_some() {
            return Err(scanner.error("nothing after the dictionary"));
        }
        let Some(((columns, stride), count)) = record.zip(count) else {
            return Err(scanner.error("the keys descr and shape"));
        };
        let find = |name: &'static str, known: &[&str]| {
            let mut found =
                columns.iter().filter(|c| known.iter().any(|k| c.name.eq_ignore_ascii_case(k.as_bytes())));
            match (found.next(), found.next()) {
                (Some(&Column { offset, kind: Some(kind), .. }), None) => Ok(Field { offset, kind }),
                (Some(_), None) => Err(file.malformed(name, text_at, "integers", "another type")),
                (None, _) => {
                    Err(file.malformed(name, text_at, format!("a field {}", known.join(" or ")), "none"))
                }
                (Some(_), Some(_)) => Err(file.malformed(name, text_at, "one field", "two")),
            }
        };
        Ok(Self {
            t: find("field t (time)", TIME)?,
            x: find("field x", X)?,
            y: find("field y", Y)?,
            p: find("field p (polarity)", POLARITY)?,
            stride,
            count,
            start: text_at + length as usize,
        })
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
        // A field with a title has a pair of title and name in place of the name.
        let has_title = scanner.eat(b'(');
        let mut name = scanner.string()?;
        if has_title {
            scanner.expect(b',')?;
            name = scanner.string()?;
            scanner.expect(b')')?;
        }
        scanner.expect(b',')?;
        let kind_at = scanner.string()?;
        let Some((kind, bytes)) = kind(kind_at) else {
            let expected = format!("a type of fixed size before this, not {}", shown(kind_at));
            return Err(scanner.error(&expected));
        };
        scanner.expect(b')')?;
        columns.push(Column { name, offset: stride, kind });
        // At most 2^16 bytes of header, each field below 2^32 bytes: no overflow in 64 bits, saturated in 32.
        stride = stride.saturating_add(bytes);
        if scanner.peek() != Some(b']') {
            scanner.expect(b',')?;
        }
    }
    Ok((columns, stride))
}

/// The type that a type string names if an event can have it, and the type's size in bytes. `None`: the size is not fixed.
fn kind(text: &[u8]) -> Option<(Option<Integer>, usize)> {
    let (big_endian, text) = match text {
        [b'>', rest @ ..] => (true, rest),
        [b'<' | b'=' | b'|', rest @ ..] => (false, rest),
        _ => (false, text),
    };
    let (&class, size) = text.split_first()?;
    // The unit of `M8[us]` and `m8[us]` is in brackets.
    let digits = size.split(|&b| b == b'[').next().unwrap_or_default();
    let size: u32 = std::str::from_utf8(digits).ok()?.parse().ok()?;
    let bytes = size as usize;
    let integer = |signed| {
        matches!(size, 1 | 2 | 4 | 8).then_some((Some(Integer { bytes, signed, big_endian }), bytes))
    };
    match class {
        b'b' if size == 1 => integer(false),
        b'i' => integer(true),
        b'u' => integer(false),
        b'f' | b'c' | b'V' | b'S' | b'M' | b'm' => Some((None, bytes)),
        b'U' => Some((None, bytes.saturating_mul(4))),
        _ => None,
    }
}

/// The length of an array of one dimension.
fn shape(scanner: &mut Scanner<'_>) -> Result<u64, IoError> {
    scanner.expect(b'(')?;
    let count = scanner.number()?;
    scanner.expect(b',')?;
    if !scanner.eat(b')') {
        return Err(scanner.error("an array of one dimension"));
    }
    Ok(count)
}

/// A tokenizer of the few Python literals of a header.
///
/// It does not recurse: the grammar of a header is fixed, so nested text cannot use up the stack.
struct Scanner<'a> {
    file: Bytes<'a>,
    text: &'a [u8],
    /// Byte of the file at which `text` starts.
    start: usize,
    at: usize,
}

impl<'a> Scanner<'a> {
    /// The text of `length` bytes at byte `start` of the file.
    fn new(file: Bytes<'a>, start: usize, length: usize) -> Result<Self, IoError> {
        Ok(Self { file, text: file.get("header", start, length)?, start, at: 0 })
    }

    /// The next byte that is not a space, without taking it.
    fn peek(&mut self) -> Option<u8> {
        while self.text.get(self.at).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
        self.text.get(self.at).copied()
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
        let tail = &self.text[self.at + 1..];
        let length = tail.iter().position(|&b| b == quote || b == b'\\');
        match length {
            Some(length) if tail[length] == quote => {
                self.at += length + 2;
                Ok(&tail[..length])
            }
            _ => Err(self.error("a string with an end and without escapes")),
        }
    }

    /// An integer that is not negative.
    fn number(&mut self) -> Result<u64, IoError> {
        self.peek();
        let tail = &self.text[self.at..];
        let length = tail.iter().take_while(|b| b.is_ascii_digit()).count();
        let parsed = std::str::from_utf8(&tail[..length]).ok().and_then(|digits| digits.parse().ok());
        let number = parsed.ok_or_else(|| self.error("an integer from 0 to 2^64 - 1"))?;
        self.at += length;
        Ok(number)
    }

    /// A name such as `True`.
    fn word(&mut self) -> &'a [u8] {
        self.peek();
        let tail = &self.text[self.at..];
        let length = tail.iter().take_while(|b| b.is_ascii_alphanumeric()).count();
        self.at += length;
        &tail[..length]
    }

    /// The error of a text that differs from `expected` at this position.
    fn error(&self, expected: &str) -> IoError {
        let tail = &self.text[self.at.min(self.text.len())..];
        let actual = match &tail[..tail.len().min(24)] {
            [] => "the end of the header".to_owned(),
            some => shown(some),
        };
        self.file.malformed("header", self.start + self.at, expected, actual)
    }
}

/// The records start at a multiple of this many bytes, as `numpy.save` does.
const ALIGNMENT: usize = 64;
/// Magic, version, and length of the header.
const FIXED: usize = 10;
/// Bytes of a record.
const STRIDE: usize = 13;

/// Writes the header and a record for each of `events`.
pub(crate) fn encode(events: &[Event], out: &mut impl Write) -> io::Result<()> {
    let mut header = format!(
        "{{'descr': [('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', '|u1')], 'fortran_order': False, 'shape': ({},), }}",
        events.len()
    );
    let length = (FIXED + header.len() + 1).next_multiple_of(ALIGNMENT) - FIXED;
    header.extend(std::iter::repeat_n(' ', length - 1 - header.len()));
    header.push('\n');
    out.write_all(MAGIC)?;
    out.write_all(&[1, 0])?;
    out.write_all(&(length as u16).to_le_bytes())?;
    out.write_all(header.as_bytes())?;
    for event in events {
        let mut record = [0; STRIDE];
        record[..8].copy_from_slice(&event.t_us.to_le_bytes());
        record[8..10].copy_from_slice(&event.x.to_le_bytes());
        record[10..12].copy_from_slice(&event.y.to_le_bytes());
        record[12] = event.on.into();
        out.write_all(&record)?;
    }
    Ok(())
}
