//! The text header of AEDAT 2.0.
//!
//! Each line starts with `#` and ends with a line feed. The header ends after a line `# End of ASCII Header`, or before the
//! first line of another form: a line of an old header has no control characters, and a time has zeros.

use super::chip::{Chip, NAMES};
use crate::bytes::Bytes;
use crate::error::{IoError, shown};
use crate::limits::JAER_HEADER_BYTES;
use crate::options::ReadOptions;

/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"#!AER-DAT2.0";

/// Longest rest of a file that is examined as a line of its header.
const LINE_BYTES: usize = 1 << 16;

/// The content of a header, and where it ends.
#[derive(Debug)]
pub(crate) struct Header {
    /// First byte after the header.
    pub(super) end: usize,
    /// The chip; `None`: neither the header nor the caller names one.
    pub(super) chip: Option<Chip>,
    /// Whether no record follows.
    pub(super) is_empty: bool,
    pub(super) strict: bool,
}

impl Header {
    /// Reads the header at the start of `file`.
    pub(super) fn parse(file: Bytes<'_>, options: ReadOptions) -> Result<Self, IoError> {
        let asked = options.chip;
        let of_sensor = || options.sensor.and_then(Chip::of_sensor);
        let magic = file.get("magic", 0, MAGIC.len())?;
        if magic != MAGIC {
            return Err(file.malformed("magic", 0, shown(MAGIC), shown(magic)));
        }
        let mut header = Self { end: 0, chip: None, is_empty: true, strict: options.strict };
        let mut is_ended = false;
        while let Some(line) = line(&file.data[header.end..]).filter(|_| !is_ended) {
            let start = header.end;
            header.end += line.len();
            if header.end as u64 > JAER_HEADER_BYTES {
                return Err(file.too_large("header", 0, JAER_HEADER_BYTES, header.end as u64, true));
            }
            let text = String::from_utf8_lossy(&line[1..]);
            let text = text.trim();
            is_ended = text.eq_ignore_ascii_case("End of ASCII Header");
            if let Some(class) = text.strip_prefix("AEChip:") {
                let class = class.trim();
                let name = class.rsplit('.').next().unwrap_or_default();
                header.chip = asked.or_else(|| Chip::of_class(name)).or_else(of_sensor);
                if header.chip.is_none() {
                    return Err(file.malformed("AEChip", start, NAMES, shown(class.as_bytes())));
                }
            }
        }
        header.chip = header.chip.or(asked).or_else(of_sensor);
        let tail = &file.data[header.end..];
        header.is_empty = tail.len() < super::STRIDE;
        if header.end == 0 || (!is_ended && is_cut(tail)) {
            let what = "the header's last line, which has no line feed,";
            return Err(file.truncated(what, header.end, tail.len() as u64 + 1, false));
        }
        Ok(header)
    }
}

/// The first line of `bytes` with its line feed, if it is one of a header.
fn line(bytes: &[u8]) -> Option<&[u8]> {
    if !bytes.starts_with(b"#") {
        return None;
    }
    let end = bytes.iter().position(|&b| b < b' ' && b != b'\t')?;
    match &bytes[end..] {
        [b'\n', ..] => Some(&bytes[..=end]),
        [b'\r', b'\n', ..] => Some(&bytes[..end + 2]),
        _ => None,
    }
}

/// Whether `tail`, the rest of a file behind the last complete line, is the beginning of a line.
fn is_cut(tail: &[u8]) -> bool {
    tail.starts_with(b"#") && tail.len() < LINE_BYTES && !tail.iter().any(u8::is_ascii_control)
}
