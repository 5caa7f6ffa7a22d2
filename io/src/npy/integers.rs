//! Arrays of integers of any width.

use std::ops::Range;

use super::field::Field;
use super::{Header, Scanner, check_size};
use crate::bytes::Bytes;
use crate::error::{IoError, shown};
use crate::format::Format;

/// An array of `N` dimensions of integers or booleans of any width, in C order.
pub(crate) struct Integers<'a, const N: usize> {
    file: Bytes<'a>,
    /// Byte of the file at which the values start.
    start: usize,
    field: Field,
    width: usize,
    pub(crate) shape: [u64; N],
}

impl<'a, const N: usize> Integers<'a, N> {
    /// The array in the file `bytes`.
    pub(crate) fn of(bytes: &'a [u8]) -> Result<Self, IoError> {
        let file = Bytes::file(Format::Npy.name(), bytes);
        let descr = |scanner: &mut Scanner<'a>| {
            let text = scanner.string()?;
            match Field::of_type(text, 0) {
                Some((Some(field), width)) if !field.is_float() => Ok((field, width)),
                _ => Err(scanner.error(&format!("integers before this, not {}", shown(text)))),
            }
        };
        let Header { start, descr: (field, width), shape, .. } = Header::<_, N>::parse(file, descr)?;
        check_size(file, start, width, &shape)?;
        Ok(Self { file, start, field, width, shape })
    }

    /// Number of its values.
    pub(crate) fn len(&self) -> usize {
        (self.file.len() - self.start) / self.width
    }

    /// The value at `i`, which must be in `range`.
    ///
    /// # Panics
    /// If there are fewer values.
    pub(crate) fn within(&self, i: usize, range: Range<i64>) -> Result<i64, IoError> {
        let found = self.field.whole(&self.file.data[self.start + i * self.width..]).unwrap_or(i128::MAX);
        match i64::try_from(found) {
            Ok(value) if range.contains(&value) => Ok(value),
            _ => {
                let expected = match range.end.checked_sub(1).filter(|last| *last >= range.start) {
                    Some(last) => format!("{} to {last}", range.start),
                    None => "no value".to_owned(),
                };
                Err(self.unlike(i, expected, found))
            }
        }
    }

    /// The error of the value at `i`.
    pub(crate) fn unlike(&self, i: usize, expected: impl Into<String>, found: impl ToString) -> IoError {
        self.file.malformed("value", self.start + i * self.width, expected, found)
    }
}
