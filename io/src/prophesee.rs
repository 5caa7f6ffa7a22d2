//! The text header of Prophesee's files (EVT2, EVT3, DAT).
//!
//! Lines that start with `%` and a space, each a key, a space and a value; either a line `% end` or the first
//! line that does not start so ends it, and the binary part follows at once. The keys that matter here: `evt
//! 3.0` or `format EVT3` (possibly `format EVT3;height=720;width=1280`) name the encoding; `geometry
//! 1280x720`, the two values in `format`, or `Width` and `Height` name the sensor; `Version` belongs to DAT.
//! Source: the vendor's pages on the RAW and DAT file formats.

use std::ops::Range;

use meissner_engine::Sensor;

use crate::csv::shown;
use crate::error::{IoError, Place};
use crate::format::Format;

/// What the header says, and where it ends.
#[derive(Debug, Default)]
pub(crate) struct Header {
    /// First byte after the header.
    pub(crate) end: usize,
    /// Whether a line `% end` ended it.
    ended: bool,
    /// `2.0`, `3.0` and so on.
    encoding: Option<String>,
    /// Version of DAT.
    pub(crate) version: Option<String>,
    width: Option<Number>,
    height: Option<Number>,
}

/// A number in the header: the text, and where its line is.
#[derive(Debug)]
struct Number {
    text: String,
    line: Range<usize>,
}

/// What the header says that the binary part is.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// One that this crate reads.
    Known(Format),
    /// An encoding of the same family that it does not.
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

    /// What the whole lines of a header at the start of `bytes` say.
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
                // `EVT21` and `EVT2` differ by their word: only the names that are known become versions.
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

    /// The encoding of the binary part: DAT where the header has a version of it and names no event encoding.
    pub(crate) fn kind(&self) -> Option<Kind> {
        match (self.encoding.as_deref(), &self.version) {
            (Some("2.0" | "2"), _) => Some(Kind::Known(Format::Evt2)),
            (Some("3.0" | "3"), _) => Some(Kind::Known(Format::Evt3)),
            (Some(other), _) => Some(Kind::Unknown(other.to_owned())),
            (None, Some(_)) => Some(Kind::Known(Format::Dat)),
            (None, None) => None,
        }
    }

    /// The sensor that the header names, or `None` where it names none.
    ///
    /// Each side lies between 1 and `most`, which is what the format's coordinates can say.
    pub(crate) fn sensor(&self, format: Format, most: u16) -> Result<Option<Sensor>, IoError> {
        let side = |what, number: &Option<Number>| -> Result<Option<u16>, IoError> {
            let Some(number) = number else { return Ok(None) };
            match number.text.parse() {
                Ok(side) if (1..=most).contains(&side) => Ok(Some(side)),
                _ => Err(IoError::Malformed {
                    format,
                    what,
                    place: Place::Byte(number.line.start as u64),
                    expected: format!("1 to {most} pixels"),
                    actual: shown(number.text.as_bytes()),
                }),
            }
        };
        let (width, height) = (side("sensor width", &self.width)?, side("sensor height", &self.height)?);
        Ok(width.zip(height).map(|(width, height)| Sensor { width, height }))
    }
}
