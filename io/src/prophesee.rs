//! The common parts of Prophesee's formats (EVT2, EVT3, DAT): the text header, and the clock that wraps.
//!
//! Each line of the header starts with `%` and a space; a key, a space and a value follow. The header ends with a line
//! `% end` or before the first line of another form, and the binary part follows at once. These keys are used: `evt 3.0` or
//! `format EVT3` (possibly `format EVT3;height=720;width=1280`) names the encoding; `geometry 1280x720`, the two values in
//! `format`, or `Width` and `Height` name the sensor; `Version` belongs to DAT. Source: the vendor's pages on the RAW and
//! DAT file formats.

use std::ops::Range;

use meissner_engine::Sensor;

use crate::error::{IoError, Place, shown};
use crate::format::Format;

/// A clock that counts from 0 to `range` - 1 and wraps.
///
/// It wraps where its value falls by half of `range` or more; a smaller fall is a step back in time.
pub(crate) struct WrappingClock {
    range: i64,
    newest: i64,
    /// Sum of the ranges that have passed.
    passed: i64,
}

impl WrappingClock {
    pub(crate) fn new(range: i64) -> Self {
        Self { range, newest: 0, passed: 0 }
    }

    /// The time since the first period's start at the clock's next value.
    #[inline]
    pub(crate) fn advance(&mut self, value: i64) -> i64 {
        if self.newest - value >= self.range / 2 {
            self.passed += self.range;
        }
        self.newest = value;
        self.passed + value
    }
}

/// The content of a header, and where it ends.
#[derive(Debug, Default)]
pub(crate) struct Header {
    /// First byte after the header.
    pub(crate) end: usize,
    /// Whether it ends with a line `% end`.
    ended: bool,
    /// Name of the encoding, such as `3.0`.
    encoding: Option<String>,
    /// Version of DAT.
    pub(crate) version: Option<String>,
    width: Option<Number>,
    height: Option<Number>,
}

/// A number in the header: its text, and the bytes of its line.
#[derive(Debug)]
struct Number {
    text: String,
    line: Range<usize>,
}

/// The encoding of the binary part.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// An encoding that this crate reads.
    Known(Format),
    /// An encoding of the same family that it does not read.
    Unknown(String),
}

/// Whether the bytes start as such a header does.
pub(crate) fn has_header(bytes: &[u8]) -> bool {
    bytes.starts_with(b"% ")
}

impl Header {
    /// Reads the header at the start of `bytes`; a file without one has an empty header.
    pub(crate) fn parse(format: Format, bytes: &[u8]) -> Result<Self, IoError> {
        let header = Self::scan(bytes);
        let tail = &bytes[header.end..];
        if has_header(tail) && !header.ended {
            return Err(IoError::Truncated {
                format,
                what: "the header's last line, which has no line feed,",
                place: Place::Byte(header.end as u64),
                expected: tail.len() as u64 + 1,
                actual: tail.len() as u64,
            });
        }
        Ok(header)
    }

    /// The content of the complete lines of a header at the start of `bytes`.
    pub(crate) fn scan(bytes: &[u8]) -> Self {
        let mut header = Self::default();
        while has_header(&bytes[header.end..]) && !header.ended {
            let start = header.end;
            let tail = &bytes[start..];
            let Some(length) = tail.iter().position(|&b| b == b'\n') else { break };
            header.end += length + 1;
            let line = String::from_utf8_lossy(&tail[2..length]);
            let line = line.trim();
            header.ended = line == "end";
            if let Some((key, value)) = line.split_once(char::is_whitespace) {
                header.set(key, value.trim(), start..header.end);
            }
        }
        header
    }

    fn set(&mut self, key: &str, value: &str, line: Range<usize>) {
        let number = |text: &str| Some(Number { text: text.trim().to_owned(), line: line.clone() });
        match key.to_ascii_lowercase().as_str() {
            "evt" => self.encoding = Some(value.to_owned()),
            "version" => self.version = Some(value.to_owned()),
            "width" => self.width = number(value),
            "height" => self.height = number(value),
            "geometry" => {
                let (width, height) = value.split_once('x').unwrap_or((value, ""));
                self.width = number(width);
                self.height = number(height);
            }
            "format" => {
                let mut parts = value.split(';');
                let name = parts.next().unwrap_or_default().trim();
                // Only exact names become versions: the words of `EVT21` differ from those of `EVT2`.
                self.encoding = Some(match name {
                    "EVT2" => "2.0".to_owned(),
                    "EVT3" => "3.0".to_owned(),
                    other => other.to_owned(),
                });
                for part in parts {
                    match part.split_once('=') {
                        Some(("width", value)) => self.width = number(value),
                        Some(("height", value)) => self.height = number(value),
                        _ => {}
                    }
                }
            }
            _ => {}
        }
    }

    /// The encoding of the binary part: DAT if the header has a version and names no encoding of events.
    pub(crate) fn encoding(&self) -> Option<Encoding> {
        match (self.encoding.as_deref(), &self.version) {
            (Some("2.0" | "2"), _) => Some(Encoding::Known(Format::Evt2)),
            (Some("3.0" | "3"), _) => Some(Encoding::Known(Format::Evt3)),
            (Some(other), _) => Some(Encoding::Unknown(other.to_owned())),
            (None, Some(_)) => Some(Encoding::Known(Format::Dat)),
            (None, None) => None,
        }
    }

    /// The sensor that the header names; `None`: it names none. Each side has at most `most` pixels, the range of the
    /// format's coordinates.
    pub(crate) fn sensor(&self, format: Format, most: u16) -> Result<Option<Sensor>, IoError> {
        let side = |what, number: &Option<Number>| -> Result<Option<u16>, IoError> {
            let Some(number) = number else { return Ok(None) };
            match number.text.parse() {
                Ok(side) if (1..=most).contains(&side) => Ok(Some(side)),
                _ => {
                    let place = Place::Byte(number.line.start as u64);
                    let (expected, actual) = (format!("1 to {most} pixels"), shown(number.text.as_bytes()));
                    Err(IoError::malformed(format, what, place, expected, actual))
                }
            }
        };
        let (width, height) = (side("sensor width", &self.width)?, side("sensor height", &self.height)?);
        Ok(width.zip(height).map(|(width, height)| Sensor { width, height }))
    }
}
