//! Compressed packets in, their content out, within the bounds of [`crate::limits`].

use std::io::Read;

use lz4_flex::frame::FrameDecoder as Lz4;
use ruzstd::decoding::{FrameDecoder as Zstd, StreamingDecoder};

use crate::error::{IoError, Place};
use crate::format::Format;
use crate::limits::{EXPANSION, PACKET_BYTES};

/// How the packets of a file are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compression {
    None,
    Lz4,
    Zstd,
}

/// Decompresses packet after packet into one buffer.
///
/// Invariant: no packet gives more than [`PACKET_BYTES`], and all of them together no more than [`EXPANSION`]
/// times the file beyond that, whatever the compressed bytes ask for.
pub(super) struct Inflater {
    compression: Compression,
    buffer: Vec<u8>,
    zstd: Zstd,
    /// Bytes that the file may still decompress to.
    budget: u64,
}

impl Inflater {
    /// For the packets of a file of `file_bytes`.
    pub(super) fn new(compression: Compression, file_bytes: u64) -> Self {
        let mut zstd = Zstd::new();
        zstd.set_max_window_size(PACKET_BYTES);
        let budget = PACKET_BYTES.saturating_add(file_bytes.saturating_mul(EXPANSION));
        Self { compression, buffer: Vec::new(), zstd, budget }
    }

    /// The content of `packet`, whose header is at byte `at` of the file; not longer than a bound that it
    /// states.
    pub(super) fn inflate<'a>(&'a mut self, packet: &'a [u8], at: usize) -> Result<&'a [u8], IoError> {
        let limit = PACKET_BYTES.min(self.budget);
        let content = self.prefix(packet, at, limit + 1)?;
        let actual = content.len() as u64;
        if actual > limit {
            let (what, place) = ("decompressed packet", Place::Byte(at as u64));
            return Err(IoError::TooLarge {
                format: Format::Aedat4,
                what,
                place,
                limit,
                actual,
                at_least: true,
            });
        }
        if self.compression == Compression::None {
            return Ok(packet);
        }
        self.budget -= actual;
        Ok(&self.buffer)
    }

    /// The first `most` bytes of the content of `packet`, or all of it where it is shorter.
    ///
    /// Only where it is shorter are the packet's end and its checksum looked at.
    pub(super) fn prefix<'a>(
        &'a mut self,
        packet: &'a [u8],
        at: usize,
        most: u64,
    ) -> Result<&'a [u8], IoError> {
        let malformed = |expected: &str, actual: String| IoError::Malformed {
            format: Format::Aedat4,
            what: "compressed packet",
            place: Place::Byte(at as u64),
            expected: expected.to_owned(),
            actual,
        };
        self.buffer.clear();
        let mut rest = packet;
        let (expected, unpacked) = match self.compression {
            Compression::None => return Ok(packet.get(..most as usize).unwrap_or(packet)),
            Compression::Lz4 => {
                ("one LZ4 frame", Lz4::new(&mut rest).take(most).read_to_end(&mut self.buffer))
            }
            Compression::Zstd => {
                let stream = StreamingDecoder::new_with_decoder(&mut rest, &mut self.zstd)
                    .map_err(|error| malformed("one Zstandard frame", error.to_string()))?;
                ("one Zstandard frame", stream.take(most).read_to_end(&mut self.buffer))
            }
        };
        unpacked.map_err(|error| malformed(expected, error.to_string()))?;
        if self.buffer.len() as u64 == most {
            return Ok(&self.buffer);
        }
        if !rest.is_empty() {
            return Err(malformed(expected, format!("one and {} bytes more", rest.len())));
        }
        if self.compression == Compression::Zstd
            && let Some(stored) = self.zstd.get_checksum_from_data()
            && self.zstd.get_calculated_checksum() != Some(stored)
        {
            return Err(malformed("a content of the stored checksum", "another".to_owned()));
        }
        Ok(&self.buffer)
    }
}
