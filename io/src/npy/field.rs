//! A field of a record, or a value of an array: its type and its value.
//!
//! Integers have 1, 2, 4 or 8 bytes; a boolean is a byte without a sign. A float of 32 or 64 bits
//! counts with its shortest decimal digits, so that 0.1 s are exactly 100,000 us.

use crate::bytes::array;
use crate::text::Number;

/// A number in a record.
#[derive(Clone, Copy)]
pub(super) struct Field {
    pub(super) offset: usize,
    /// 1, 2, 4 or 8 bytes.
    width: usize,
    class: Class,
    big_endian: bool,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Class {
    Unsigned,
    Signed,
    Float,
}

impl Field {
    /// The field at `offset` of the type that `text` names, if an event can have it, and its bytes.
    /// `None`: the size is not fixed.
    pub(super) fn of_type(text: &[u8], offset: usize) -> Option<(Option<Self>, usize)> {
        let (big_endian, text) = match text {
            [b'>', rest @ ..] => (true, rest),
            [b'<' | b'=' | b'|', rest @ ..] => (false, rest),
            _ => (false, text),
        };
        let (&class, size) = text.split_first()?;
        // The unit of `M8[us]` and `m8[us]` is in brackets.
        let digits = size.split(|&b| b == b'[').next().unwrap_or_default();
        let size: u32 = str::from_utf8(digits).ok()?.parse().ok()?;
        let width = size as usize;
        let class = match (class, size) {
            (b'b', 1) | (b'u', 1 | 2 | 4 | 8) => Class::Unsigned,
            (b'i', 1 | 2 | 4 | 8) => Class::Signed,
            (b'f', 4 | 8) => Class::Float,
            (b'f' | b'c' | b'V' | b'S' | b'M' | b'm', _) => return Some((None, width)),
            (b'U', _) => return Some((None, width.saturating_mul(4))),
            _ => return None,
        };
        Some((Some(Self { offset, width, class, big_endian }), width))
    }

    pub(super) fn is_float(self) -> bool {
        self.class == Class::Float
    }

    /// Its bits in `record`.
    #[inline]
    fn bits(self, record: &[u8]) -> u64 {
        let bytes = &record[self.offset..];
        match (self.width, self.big_endian) {
            (1, _) => bytes[0].into(),
            (2, false) => u16::from_le_bytes(array(bytes)).into(),
            (2, true) => u16::from_be_bytes(array(bytes)).into(),
            (4, false) => u32::from_le_bytes(array(bytes)).into(),
            (4, true) => u32::from_be_bytes(array(bytes)).into(),
            (_, false) => u64::from_le_bytes(array(bytes)),
            (_, true) => u64::from_be_bytes(array(bytes)),
        }
    }

    /// Its value in `record`, if it is whole; wide enough for every integer type.
    #[inline]
    pub(super) fn whole(self, record: &[u8]) -> Option<i128> {
        match self.class {
            Class::Unsigned => Some(self.bits(record).into()),
            Class::Signed => {
                // Shifting up and down extends the sign of the narrow type.
                let shift = 64 - 8 * self.width as u32;
                Some(i128::from((self.bits(record) << shift) as i64 >> shift))
            }
            Class::Float => Number::parse(self.text(record).as_bytes())?.whole(),
        }
    }

    /// Its value in `record` times 10^`power`, rounded to the nearest integer, halves away from
    /// zero; `None`: too large or not a number.
    #[inline]
    pub(super) fn scaled(self, record: &[u8], power: i32) -> Option<i128> {
        match (self.class, power) {
            (Class::Unsigned | Class::Signed, 0) => self.whole(record),
            _ => Number::parse(self.text(record).as_bytes())?.scaled(power),
        }
    }

    /// Its value in `record` as a decimal number; `NaN` and `inf` are not decimal numbers.
    pub(super) fn text(self, record: &[u8]) -> String {
        match (self.class, self.width) {
            (Class::Float, 4) => format!("{:e}", f32::from_bits(self.bits(record) as u32)),
            (Class::Float, _) => format!("{:e}", f64::from_bits(self.bits(record))),
            _ => self.whole(record).map_or_else(String::new, |value| value.to_string()),
        }
    }
}
