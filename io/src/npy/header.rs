//! The header in, the layout of a record out.

use super::scan::Scanner;
use crate::bytes::Bytes;
use crate::csv::shown;
use crate::error::{IoError, Place};
use crate::limits::NPY_HEADER_BYTES;
use crate::names;

/// Where a field stands in a record, and how it is stored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Field {
    pub(super) offset: usize,
    pub(super) kind: Kind,
}

/// Integers and booleans; the other types are passed over, so only their size matters.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    Bool,
    Integer { bytes: usize, signed: bool, big_endian: bool },
}

/// The layout of the records.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) t: Field,
    pub(super) x: Field,
    pub(super) y: Field,
    pub(super) p: Field,
    /// Bytes of a record.
    pub(super) stride: usize,
    /// Records that the header promises.
    pub(super) count: u64,
    /// Byte of the file at which the first record starts.
    pub(super) start: usize,
}

/// A field of the record, of whatever type; `kind` is `None` where it is no integer.
struct Column<'a> {
    name: &'a [u8],
    offset: usize,
    kind: Option<Kind>,
}

impl Layout {
    /// Reads magic, version and header.
    pub(super) fn parse(file: Bytes<'_>) -> Result<Self, IoError> {
        let what = "magic and version";
        let magic = file.get(what, 0, 8)?;
        let (length, text_at) = match (super::has_magic(magic), magic[6]) {
            (true, 1) => (u64::from(file.u16("length of the header", 8)?), 10),
            (true, 2 | 3) => (u64::from(file.u32("length of the header", 8)?), 12),
            _ => {
                let expected = "\\x93NUMPY and version 1, 2 or 3";
                return Err(file.malformed(what, 0, expected, magic.escape_ascii().to_string()));
            }
        };
        if length > NPY_HEADER_BYTES {
            return Err(IoError::TooLarge {
                format: file.format,
                what: "header",
                place: Place::Byte(text_at as u64),
                limit: NPY_HEADER_BYTES,
                actual: length,
                at_least: false,
            });
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
                // Of one dimension, rows first and columns first are the same.
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
            t: find("field t (time)", names::TIME)?,
            x: find("field x", names::X)?,
            y: find("field y", names::Y)?,
            p: find("field p (polarity)", names::POLARITY)?,
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
        // A field with a title has a pair of title and name.
        let name = if scanner.eat(b'(') {
            scanner.string()?;
            scanner.expect(b',')?;
            let name = scanner.string()?;
            scanner.expect(b')')?;
            name
        } else {
            scanner.string()?
        };
        scanner.expect(b',')?;
        let kind_at = scanner.string()?;
        let Some((kind, bytes)) = kind(kind_at) else {
            let found = shown(kind_at);
            return Err(scanner.error(&format!("a type of fixed size before this, not {found}")));
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

/// The integer type that a type string names, if it is one, and its size in bytes. `None`: it has no fixed
/// size.
fn kind(text: &[u8]) -> Option<(Option<Kind>, usize)> {
    let (big_endian, text) = match text {
        [b'>', rest @ ..] => (true, rest),
        [b'<' | b'=' | b'|', rest @ ..] => (false, rest),
        _ => (false, text),
    };
    let (&class, size) = text.split_first()?;
    // `M8[us]` and `m8[us]` have their unit in brackets.
    let digits = size.split(|&b| b == b'[').next().unwrap_or_default();
    let size: u32 = std::str::from_utf8(digits).ok()?.parse().ok()?;
    let bytes = size as usize;
    let integer = |signed| {
        matches!(size, 1 | 2 | 4 | 8).then_some((Some(Kind::Integer { bytes, signed, big_endian }), bytes))
    };
    match class {
        b'b' if size == 1 => Some((Some(Kind::Bool), 1)),
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
