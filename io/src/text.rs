//! Lines, fields and decimal numbers, which texts of events and of electrodes share.
//!
//! A line is delivered as soon as its line feed has arrived. Invariant: a line has at most
//! [`LINE_BYTES`], and nothing beyond its line feed is requested.

use std::io::{BufRead, Read};
use std::iter;

use crate::bytes::Bytes;
use crate::error::{IoError, Place, shown};
use crate::format::Format;
use crate::limits::LINE_BYTES;

/// Byte order mark that some programs write before UTF-8.
pub(crate) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// A line without the spaces around it.
#[derive(Clone, Copy)]
pub(crate) struct Line<'a> {
    pub(crate) text: &'a [u8],
    /// Counted from 1.
    pub(crate) number: u64,
}

impl<'a> Line<'a> {
    /// Its bytes, all at the place of the line.
    pub(crate) fn bytes(self) -> Bytes<'a> {
        Bytes { format: Format::Csv.name(), data: self.text, origin: Place::Line(self.number) }
    }

    /// The error of a malformed part of this line.
    pub(crate) fn malformed(
        self,
        what: &'static str,
        expected: impl Into<String>,
        actual: impl ToString,
    ) -> IoError {
        self.bytes().malformed(what, 0, expected, actual)
    }

    /// The error of a line that can be read in several ways.
    pub(crate) fn undecided(self, what: &'static str, readings: impl Into<String>) -> IoError {
        let (place, line) = (Place::Line(self.number), shown(self.text));
        IoError::Undecided { what, place, line, readings: readings.into() }
    }
}

/// Reads one line after another into one buffer.
#[derive(Debug)]
pub(crate) struct Lines<R> {
    input: R,
    line: Vec<u8>,
    /// Number of the line in `line`, from 1.
    number: u64,
}

impl<R: BufRead> Lines<R> {
    pub(crate) fn new(input: R) -> Self {
        Self { input, line: Vec::new(), number: 0 }
    }

    /// The bytes of the newest line.
    pub(crate) fn raw(&self) -> &[u8] {
        &self.line
    }

    /// The next line; `None` at the end of the input.
    ///
    /// `refusal` gets the bytes of the first line, even if it is too long, so that input of another
    /// kind is refused by its name.
    pub(crate) fn next(
        &mut self,
        refusal: impl FnOnce(&[u8]) -> Option<IoError>,
    ) -> Result<Option<Line<'_>>, IoError> {
        let is_first = self.number == 0;
        let read = self.read();
        if is_first
            && !matches!(read, Ok(false))
            && let Some(error) = refusal(&self.line)
        {
            return Err(error);
        }
        Ok(read?.then(|| self.current()))
    }

    /// Reads the next line; returns whether there is one.
    fn read(&mut self) -> Result<bool, IoError> {
        self.line.clear();
        self.number += 1;
        let (format, place) = (Format::Csv.name(), Place::Line(self.number));
        let read = (&mut self.input).take(LINE_BYTES + 1).read_until(b'\n', &mut self.line);
        read.map_err(|source| IoError::Stream { format, action: "read", place, source })?;
        let (limit, actual) = (LINE_BYTES, self.line.len() as u64);
        if actual > limit {
            let (unit, at_least) = ("bytes", !self.line.ends_with(b"\n"));
            return Err(IoError::TooLarge { format, what: "line", place, unit, limit, actual, at_least });
        }
        Ok(actual > 0)
    }

    /// The newest line.
    pub(crate) fn current(&self) -> Line<'_> {
        let mut line = self.line.as_slice();
        if self.number == 1 {
            line = line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(line);
        }
        Line { text: line.trim_ascii(), number: self.number }
    }
}

/// The lines of a whole text up to the first that [`Lines`] refuses.
pub(crate) fn lines_of(text: &[u8]) -> impl Iterator<Item = Line<'_>> {
    let text = text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text);
    let lines = text.split(|&b| b == b'\n').take_while(|line| line.len() as u64 <= LINE_BYTES);
    lines.zip(1..).map(|(line, number)| Line { text: line.trim_ascii(), number })
}

/// Whether `line` is a comment.
pub(crate) fn is_comment(line: &[u8]) -> bool {
    line.starts_with(b"#") || line.starts_with(b"%")
}

/// Whether a text whose first line is `line` may be a list or an object in JSON, and not a table.
pub(crate) fn is_json(line: &[u8]) -> bool {
    line.starts_with(b"[") || line.starts_with(b"{")
}

/// The first 4 KiB of `bytes` without the byte order mark, if they have no control characters.
pub(crate) fn text_start(bytes: &[u8]) -> Option<&[u8]> {
    let start = &bytes[..bytes.len().min(4096)];
    let start = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start);
    let is_text = !start.iter().any(|&b| b == 0x7f || (b < b' ' && !b"\t\r\n".contains(&b)));
    is_text.then_some(start)
}

/// The lines of a text that are neither blank nor comments.
pub(crate) fn content_lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|&b| b == b'\n').map(<[u8]>::trim_ascii).filter(|line| !line.is_empty() && !is_comment(line))
}

/// A field without the spaces and the quotes around it.
pub(crate) fn bare(field: &[u8]) -> &[u8] {
    let field = field.trim_ascii();
    match field {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        _ => field,
    }
}

/// The separator of a line's fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Separator {
    Comma,
    Semicolon,
    /// Any number of blanks and tabs.
    Blanks,
}

impl Separator {
    /// The separator of `line`: the first of comma, semicolon and blanks that gives the four fields
    /// of an event, else the first that occurs.
    pub(crate) fn of(line: &[u8]) -> Self {
        const ALL: [Separator; 3] = [Separator::Comma, Separator::Semicolon, Separator::Blanks];
        let least = |fields: usize| ALL.into_iter().find(|s| s.fields(line).take(fields).count() == fields);
        least(4).or_else(|| least(2)).unwrap_or(Self::Comma)
    }

    /// The fields of `line`, without the blanks and the quotes around them.
    pub(crate) fn fields(self, line: &[u8]) -> impl Iterator<Item = &[u8]> {
        let fields = line.split(move |&byte| self.separates(byte));
        // A run of blanks separates once.
        fields.filter(move |field| self != Self::Blanks || !field.is_empty()).map(bare)
    }

    fn separates(self, byte: u8) -> bool {
        match self {
            Self::Comma => byte == b',',
            Self::Semicolon => byte == b';',
            Self::Blanks => byte.is_ascii_whitespace(),
        }
    }
}

/// A decimal number as text: sign, digits, point and more digits, exponent; all but digits
/// optional.
#[derive(Clone, Copy)]
pub(crate) struct Number<'a> {
    negative: bool,
    integer: &'a [u8],
    /// The digits after the point, if there is one.
    fraction: Option<&'a [u8]>,
    /// The power of ten after `e`, if there is one.
    exponent: Option<i32>,
}

/// Largest absolute exponent; a larger one counts as this one, because such numbers are not used
/// here.
const EXPONENT: i32 = 1 << 16;
/// Number of decimal digits that a float of 64 bits always keeps: the digits after them are noise.
const DIGITS: usize = 15;

/// The digits at the start of `text`, and the rest.
fn digits(text: &[u8]) -> (&[u8], &[u8]) {
    text.split_at(text.iter().take_while(|byte| byte.is_ascii_digit()).count())
}

/// Whether `text` starts with a minus, and the text after the sign.
fn sign(text: &[u8]) -> (bool, &[u8]) {
    match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    }
}

impl<'a> Number<'a> {
    /// The number in `field`; `None`: the field is not a number.
    pub(crate) fn parse(field: &'a [u8]) -> Option<Self> {
        let (negative, rest) = sign(field);
        let (integer, mut rest) = digits(rest);
        let mut number = Self { negative, integer, fraction: None, exponent: None };
        if let [b'.', after @ ..] = rest {
            let (fraction, after) = digits(after);
            (number.fraction, rest) = (Some(fraction), after);
        }
        if let [b'e' | b'E', after @ ..] = rest {
            let (negative, after) = sign(after);
            let (power, after) = digits(after);
            let digit = |power: i32, &digit| (power * 10 + i32::from(digit - b'0')).min(EXPONENT);
            let power = power.first().map(|_| power.iter().fold(0, digit))?;
            (number.exponent, rest) = (Some(if negative { -power } else { power }), after);
        }
        (!integer.is_empty() && rest.is_empty()).then_some(number)
    }

    /// Its digits, from the first one.
    fn digits(self) -> impl Iterator<Item = u8> {
        self.integer.iter().chain(self.fraction.unwrap_or_default()).map(|digit| digit - b'0')
    }

    /// Number of digits before the point, after the exponent has moved it; negative: zeros after
    /// it.
    fn point(self) -> i64 {
        self.integer.len() as i64 + i64::from(self.exponent.unwrap_or(0))
    }

    /// Whether it is written as a float, with a point or an exponent.
    pub(crate) fn has_point(self) -> bool {
        self.fraction.is_some() || self.exponent.is_some()
    }

    /// Number of digits after the point. For a number with an exponent, whose writers print every
    /// float with all its digits, only digits that a float keeps count, without zeros at their end.
    pub(crate) fn decimals(self) -> usize {
        if self.exponent.is_none() {
            return self.fraction.unwrap_or_default().len();
        }
        let Some(first) = self.digits().position(|digit| digit > 0) else { return 0 };
        let mut kept: Vec<u8> = self.digits().skip(first).take(DIGITS).collect();
        if self.digits().nth(first + DIGITS).is_some_and(|digit| digit >= 5) {
            while kept.last() == Some(&9) {
                kept.pop();
            }
            // If all digits are nines, the number is the next power of ten, which has no decimals.
            if let Some(last) = kept.last_mut() {
                *last += 1;
            }
        }
        while kept.last() == Some(&0) {
            kept.pop();
        }
        usize::try_from((first + kept.len()) as i64 - self.point()).unwrap_or(0)
    }

    /// Whether the digits after the point are zeros.
    pub(crate) fn is_whole(self) -> bool {
        match self.exponent {
            None => self.fraction.unwrap_or_default().iter().all(|&b| b == b'0'),
            Some(_) => self.digits().skip(self.point().max(0) as usize).all(|digit| digit == 0),
        }
    }

    pub(crate) fn is_zero(self) -> bool {
        self.is_whole() && self.digits().all(|digit| digit == 0)
    }

    /// The number times 10^`power`, rounded, halves away from zero; `None` beyond 128 bits.
    pub(crate) fn scaled(self, power: i32) -> Option<i128> {
        // Zeros with any exponent are not multiplied out.
        if self.exponent.is_some() && self.is_zero() {
            return Some(0);
        }
        // The digits before this position are kept, the digit at this position rounds.
        let end = self.point() + i64::from(power);
        let mut digits = self.digits().chain(iter::repeat(0));
        let mut kept = digits.by_ref().take(end.max(0) as usize);
        // 18 digits fit in 64 bits, which is faster.
        let mut value = if end <= 18 {
            kept.fold(0_u64, |value, digit| value * 10 + u64::from(digit)).into()
        } else {
            kept.try_fold(0_i128, |value, digit| value.checked_mul(10)?.checked_add(digit.into()))?
        };
        let rounds_up = end >= 0 && digits.next().is_some_and(|digit| digit >= 5);
        value = value.checked_add(i128::from(rounds_up))?;
        Some(if self.negative { -value } else { value })
    }

    /// The number if it is a whole number.
    pub(crate) fn whole(self) -> Option<i128> {
        self.scaled(0).filter(|_| self.is_whole())
    }
}
