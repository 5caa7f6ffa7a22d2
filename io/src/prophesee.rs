//! The common parts of EVT2, EVT3 and DAT: the text header, and the clock that wraps.
//!
//! Each line of the header starts with `%` and a space; a key, a space and a value follow. The
//! header ends with a line `% end` or before the first line of another form, and the binary part
//! follows directly. These keys are used: `evt 3.0` or `format EVT3` (possibly `format
//! EVT3;height=720;width=1280`) names the encoding; `endianness` gives the order of the halves of
//! EVT 2.1; `geometry 1280x720`, the two values in `format`, or `Width` and `Height` name the
//! sensor; `Version` belongs to DAT. Source: the vendor's pages on the RAW and DAT file formats.

use meissner_engine::Sensor;

use crate::bytes::Bytes;
use crate::error::{IoError, shown};
use crate::format::Format;
use crate::seek::DISORDER_US;

/// A clock that counts from 0 to `range` - 1 and wraps.
///
/// It wraps if its value falls by half of `range` or more; a smaller fall is a step back in time.
/// After a wrap, a value that is less than `back` before the newest one across the wrap is a step
/// back too: two falls with such a rise between them are one wrap.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WrappingClock {
    range: i64,
    /// Longest step back over a wrap.
    back: i64,
    newest: i64,
    /// Sum of the periods that have passed.
    passed: i64,
    /// Whether the newest value is a step back over a wrap.
    stepped_back: bool,
}

impl WrappingClock {
    pub(crate) fn new(range: i64) -> Self {
        Self { range, back: DISORDER_US, newest: 0, passed: 0, stepped_back: false }
    }

    /// The same clock in another unit, in which the longest step back over a wrap is `back`.
    pub(crate) fn stepping_back(self, back: i64) -> Self {
        Self { back, ..self }
    }

    /// The clock at the value `newest`, which is the time `t_us`.
    pub(crate) fn resumed(range: i64, newest: i64, t_us: i64) -> Self {
        Self { newest, passed: t_us - newest, ..Self::new(range) }
    }

    /// Treats the newest value as a step forward of nearly a period, not as a step back over a
    /// wrap.
    pub(crate) fn take_for_forward(&mut self) {
        if std::mem::take(&mut self.stepped_back) {
            self.passed += self.range;
        }
    }

    /// The time since the first period's start at the clock's next value.
    #[inline]
    pub(crate) fn advance(&mut self, value: i64) -> i64 {
        self.stepped_back = false;
        if self.newest - value >= self.range / 2 {
            self.passed += self.range;
        } else if value - self.newest >= self.range - self.back && self.passed > 0 {
            self.passed -= self.range;
            self.stepped_back = true;
        }
        self.newest = value;
        self.passed + value
    }
}

/// The content and the end of a header.
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
    /// `little` or `legacy`, with the first byte of its line.
    endianness: Option<(String, usize)>,
    /// Width and height as text, each with the first byte of its line.
    sides: [Option<(String, usize)>; 2],
}

/// Whether the bytes start like such a header.
pub(crate) fn has_header(bytes: &[u8]) -> bool {
    bytes.starts_with(b"% ")
}

/// The sensor of the value `WIDTHxHEIGHT` of a file's attribute.
#[cfg(feature = "hdf5")]
pub(crate) fn geometry(value: &str, file: Bytes<'_>) -> Result<Option<Sensor>, IoError> {
    let mut header = Header::default();
    header.set("geometry", value, 0);
    header.sensor(file, u16::MAX)
}

impl Header {
    /// Reads the header at the start of `file`; a file without one has an empty header.
    pub(crate) fn parse(file: Bytes<'_>) -> Result<Self, IoError> {
        let header = Self::scan(file.data);
        let tail = &file.data[header.end..];
        if has_header(tail) && !header.ended {
            let what = "the header's last line, which has no line feed,";
            return Err(file.truncated(what, header.end, tail.len() as u64 + 1, false));
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
                header.set(key, value.trim(), start);
            }
        }
        header
    }

    /// Whether it ends with a line `% end`.
    pub(crate) fn has_ended(&self) -> bool {
        self.ended
    }

    /// Takes the value of the line that starts at byte `line`.
    fn set(&mut self, key: &str, value: &str, line: usize) {
        let mut side = |index: usize, text: &str| self.sides[index] = Some((text.trim().to_owned(), line));
        match key.to_ascii_lowercase().as_str() {
            "evt" => self.encoding = Some(value.to_owned()),
            "endianness" => self.endianness = Some((value.to_owned(), line)),
            "version" => self.version = Some(value.to_owned()),
            "width" => side(0, value),
            "height" => side(1, value),
            "geometry" => {
                let (width, height) = value.split_once('x').unwrap_or((value, ""));
                side(0, width);
                side(1, height);
            }
            "format" => {
                let mut parts = value.split(';');
                // Only exact names become versions.
                let encoding = match parts.next().unwrap_or_default().trim() {
                    "EVT2" => "2.0",
                    "EVT21" => "2.1",
                    "EVT3" => "3.0",
                    other => other,
                };
                self.encoding = Some(encoding.to_owned());
                for part in parts {
                    match part.split_once('=') {
                        Some(("width", value)) => side(0, value),
                        Some(("height", value)) => side(1, value),
                        Some(("endianness", value)) => {
                            self.endianness = Some((value.trim().to_owned(), line));
                        }
                        _ => {}
                    }
                }
            }
            _ => {}
        }
    }

    /// The format of the binary part, or the name of an encoding that is not read.
    pub(crate) fn encoding(&self) -> Option<Result<Format, &str>> {
        match (self.encoding.as_deref(), &self.version) {
            (Some("2.0" | "2"), _) => Some(Ok(Format::Evt2)),
            (Some("2.1"), _) => Some(Ok(Format::Evt21)),
            (Some("3.0" | "3"), _) => Some(Ok(Format::Evt3)),
            (Some(other), _) => Some(Err(other)),
            (None, Some(_)) => Some(Ok(Format::Dat)),
            (None, None) => None,
        }
    }

    /// Whether the upper half of each word of EVT 2.1 comes first; `None`: the header of `file`
    /// does not state it.
    pub(crate) fn is_legacy(&self, file: Bytes<'_>) -> Result<Option<bool>, IoError> {
        let Some((name, line)) = &self.endianness else { return Ok(None) };
        match name.as_str() {
            "legacy" => Ok(Some(true)),
            "little" => Ok(Some(false)),
            other => {
                let actual = shown(other.as_bytes());
                Err(file.malformed("order of bytes", *line, "little or legacy", actual))
            }
        }
    }

    /// The sensor that the header of `file` names; `None`: it names none. Each side has at most
    /// `most` pixels, the range of the format's coordinates.
    pub(crate) fn sensor(&self, file: Bytes<'_>, most: u16) -> Result<Option<Sensor>, IoError> {
        let side = |what, side: &Option<(String, usize)>| {
            let Some((text, line)) = side else { return Ok(None) };
            let pixels = text.parse().ok().filter(|pixels| (1..=most).contains(pixels));
            let expected = || format!("1 to {most} pixels");
            pixels.map(Some).ok_or_else(|| file.malformed(what, *line, expected(), shown(text.as_bytes())))
        };
        let [width, height] = &self.sides;
        let (width, height) = (side("sensor width", width)?, side("sensor height", height)?);
        Ok(width.zip(height).map(|(width, height)| Sensor { width, height }))
    }
}
