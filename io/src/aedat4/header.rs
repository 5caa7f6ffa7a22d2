//! The file's header in, compression, streams and the packets' place out.

use super::MAGIC;
use super::flat::Table;
use super::inflate::Compression;
use super::streams::{self, Stream};
use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::limits::HEADER_BYTES;

/// What the header says.
pub(super) struct Header {
    pub(super) compression: Compression,
    pub(super) streams: Vec<Stream>,
    /// Byte of the file at which the first packet starts.
    pub(super) packets: usize,
    /// Byte of the file at which the packet table starts, if there is one.
    pub(super) table: Option<usize>,
    /// Whether the file ends before the place of its packet table.
    pub(super) is_cut: bool,
}

impl Header {
    /// Reads the magic and the header at the start of `file`; where `salvage` says so, the file may end before its packet table.
    pub(super) fn parse(file: Bytes<'_>, salvage: bool) -> Result<Self, IoError> {
        let (format, what, start) = (file.format, "header", MAGIC.len());
        let magic = file.get("magic", 0, start)?;
        if magic != MAGIC {
            let shown = |bytes: &[u8]| format!("`{}`", bytes.escape_ascii());
            return Err(file.malformed("magic", 0, shown(MAGIC), shown(magic)));
        }
        let size = file.u32("size of the header", start)?;
        if u64::from(size) > HEADER_BYTES {
            return Err(IoError::TooLarge {
                format,
                what,
                place: file.place(start),
                limit: HEADER_BYTES,
                actual: size.into(),
                at_least: false,
            });
        }
        let length = 4 + size as usize;
        let content = Bytes::new(format, file.get(what, start, length)?, file.place(start));
        let root = Table::root(content, what, *b"IOHE")?;
        let compression = match root.i32(0, 0)? {
            0 => Compression::None,
            1 | 2 => Compression::Lz4,
            3 | 4 => Compression::Zstd,
            other => {
                return Err(file.malformed("compression", start, "0 to 4", other.to_string()));
            }
        };
        let packets = start + length;
        let (table, is_cut) = match root.i64(1, -1)? {
            -1 => (None, false),
            at => match Self::table(file, packets, at) {
                Err(IoError::Truncated { .. }) if salvage => (None, true),
                table => (Some(table?), false),
            },
        };
        let (xml_at, xml) = root.vector(2, 1)?;
        let streams = streams::parse(format, xml, content.place(xml_at))?;
        Ok(Self { compression, streams, packets, table, is_cut })
    }

    /// The position of the packet table, which the recorder writes last: a file that ends before it was cut.
    fn table(file: Bytes<'_>, packets: usize, at: i64) -> Result<usize, IoError> {
        let position = u64::try_from(at).ok().filter(|&at| at >= packets as u64);
        let Some(position) = position else {
            let expected = format!("-1, or {packets} and above");
            return Err(file.malformed(
                "position of the packet table",
                MAGIC.len(),
                expected,
                at.to_string(),
            ));
        };
        if position > file.len() as u64 {
            return Err(IoError::Truncated {
                format: file.format,
                what: "the recording before its packet table",
                place: Place::Byte(0),
                expected: position,
                actual: file.len() as u64,
            });
        }
        Ok(position as usize)
    }
}
