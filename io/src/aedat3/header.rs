//! The text header of AEDAT 3.1: the coding of the packets, and the chip of each source.

use meissner_engine::Sensor;

use crate::aedat2;
use crate::bytes::Bytes;
use crate::error::{IoError, shown};
use crate::format::beginning;
use crate::limits::HEADER_BYTES;

/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"#!AER-DAT3.1\r\n";
/// The header's last line.
const END: &[u8] = b"#!END-HEADER";

/// The content of a header, and where it ends.
#[derive(Debug)]
pub(super) struct Header {
    /// First byte of the first packet.
    pub(super) end: usize,
    /// The sources whose chip is known, with its pixels.
    sources: Vec<(i16, Sensor)>,
}

impl Header {
    /// Reads the header at the start of `file`.
    pub(super) fn parse(file: Bytes<'_>) -> Result<Self, IoError> {
        let magic = file.get("magic", 0, MAGIC.len())?;
        if magic != MAGIC {
            return Err(file.malformed("magic", 0, shown(MAGIC), shown(magic)));
        }
        let mut header = Self { end: MAGIC.len(), sources: Vec::new() };
        loop {
            let start = header.end;
            if start as u64 > HEADER_BYTES {
                return Err(file.too_large("header", 0, HEADER_BYTES, start as u64, true));
            }
            let tail = &file.data[start..];
            let Some(length) = tail.iter().position(|&b| b == b'\n') else {
                let what = "the header before its line #!END-HEADER";
                return Err(file.truncated(what, 0, file.len() as u64 + 1, true));
            };
            header.end += length + 1;
            let line = tail[..length].trim_ascii_end();
            if line == END {
                return Ok(header);
            }
            if !line.starts_with(b"#") {
                return Err(file.malformed("line of the header", start, "`#` at its start", shown(line)));
            }
            let text = String::from_utf8_lossy(&line[1..]);
            match text.split_once(':').map(|(key, value)| (key.trim(), value.trim())) {
                Some(("Format", "RAW")) | None => {}
                Some(("Format", other)) => {
                    let actual = format!("format `{}`", beginning(other, 40));
                    return Err(IoError::Unsupported { expected: "AEDAT 3.1 of format RAW", actual });
                }
                Some((key, chip)) => {
                    let source = key.strip_prefix("Source ").and_then(|number| number.trim().parse().ok());
                    header.sources.extend(source.zip(aedat2::sensor_of(chip)));
                }
            }
        }
    }

    /// The pixels of this source's chip, where it is known.
    pub(super) fn sensor(&self, source: i16) -> Option<Sensor> {
        self.sources.iter().find(|(known, _)| *known == source).map(|&(_, sensor)| sensor)
    }
}
