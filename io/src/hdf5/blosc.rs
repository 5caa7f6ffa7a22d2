//! Blosc 1, the compression of DSEC's arrays.
//!
//! ```text
//! version, version of the codec     one byte each
//! flags                             bit 0: bytes shuffled, 1: stored, 2: bits shuffled,
//!                                   4: blocks are not split; bits 5-7: codec
//! size of an element                one byte
//! bytes, bytes of a block, bytes of the chunk     u32 each
//! for each block: its place in the chunk          u32; not if stored
//! blocks: streams of a u32, its length, and as many bytes (as it unpacks to: not compressed)
//! ```
//!
//! A split block has a stream for each byte of its elements. Codecs: LZ4, zlib and Zstandard.
//! Source: <https://github.com/Blosc/c-blosc>. Invariant: the unpacked size of a chunk is bounded
//! before memory is allocated.

use std::io::Read;
use std::sync::{Mutex, PoisonError};

use flate2::read::ZlibDecoder;
use ruzstd::decoding::FrameDecoder as Zstd;

use crate::bytes::Bytes;
use crate::error::IoError;
use crate::limits::PACKET_BYTES;

/// HDF5's number of the filter.
pub(super) const FILTER: u16 = 32001;

/// Bytes of the header.
const HEADER: usize = 16;
const SHUFFLED: u8 = 1;
const STORED: u8 = 1 << 1;
const BITS_SHUFFLED: u8 = 1 << 2;
const WHOLE_BLOCKS: u8 = 1 << 4;
/// Elements with more bytes are not split.
const MAX_STREAMS: usize = 16;
/// Blocks with fewer elements are not split.
const FEWEST_ELEMENTS: usize = 128;

/// Unpacks chunks, one at a time.
#[derive(Default)]
pub(super) struct Decoder(Mutex<Zstd>);

impl Decoder {
    /// The content of `chunk`.
    pub(super) fn decode(&self, chunk: &[u8]) -> Result<Vec<u8>, IoError> {
        let chunk = Bytes::file("Blosc", chunk);
        let [_, _, flags, element] = chunk.array("header", 0)?;
        let [length, block] = [chunk.u32("header", 4)? as usize, chunk.u32("header", 8)? as usize];
        if length as u64 > PACKET_BYTES {
            return Err(chunk.too_large("chunk", 4, PACKET_BYTES, length as u64, false));
        }
        if flags & STORED != 0 {
            return Ok(chunk.get("stored chunk", HEADER, length)?.to_vec());
        }
        if flags & BITS_SHUFFLED != 0 {
            return Err(chunk.malformed("flags", 2, "bytes or nothing shuffled", "bits shuffled"));
        }
        let codec = Codec::of(flags >> 5)
            .map_err(|name| chunk.malformed("codec", 2, "LZ4, zlib or Zstandard", name))?;
        let element = usize::from(element.max(1));
        let mut content = vec![0; length];
        let mut packed = Vec::new();
        for (index, out) in content.chunks_mut(block.max(1)).enumerate() {
            let at = chunk.u32("place of a block", HEADER + 4 * index)? as usize;
            let is_split = flags & WHOLE_BLOCKS == 0
                && element <= MAX_STREAMS
                && block / element >= FEWEST_ELEMENTS
                && out.len() == block;
            let streams = if is_split { element } else { 1 };
            if flags & SHUFFLED == 0 || element == 1 {
                self.streams(chunk, at, codec, streams, out)?;
            } else {
                packed.clear();
                packed.resize(out.len(), 0);
                self.streams(chunk, at, codec, streams, &mut packed)?;
                unshuffle(&packed, element, out);
            }
        }
        Ok(content)
    }

    /// Unpacks the streams of a block at byte `at`.
    fn streams(
        &self,
        chunk: Bytes<'_>,
        mut at: usize,
        codec: Codec,
        streams: usize,
        out: &mut [u8],
    ) -> Result<(), IoError> {
        let length = out.len() / streams;
        for out in out.chunks_mut(length.max(1)) {
            let packed_length = chunk.u32("stream", at)? as usize;
            let packed = chunk.get("stream", at.saturating_add(4), packed_length)?;
            if packed_length == out.len() {
                out.copy_from_slice(packed);
            } else {
                let unpacked = match codec {
                    Codec::Lz4 => {
                        lz4_flex::block::decompress_into(packed, out).map_err(|error| error.to_string())
                    }
                    Codec::Zlib => ZlibDecoder::new(packed)
                        .read_exact(out)
                        .map(|()| out.len())
                        .map_err(|error| error.to_string()),
                    Codec::Zstd => {
                        let mut zstd = self.0.lock().unwrap_or_else(PoisonError::into_inner);
                        zstd.decode_all(packed, out).map_err(|error| error.to_string())
                    }
                };
                let expected = format!("{} bytes of {codec:?}", out.len());
                match unpacked {
                    Ok(length) if length == out.len() => {}
                    Ok(length) => return Err(chunk.malformed("stream", at, expected, length)),
                    Err(error) => return Err(chunk.malformed("stream", at, expected, error)),
                }
            }
            at += 4 + packed_length;
        }
        Ok(())
    }
}

/// Compression of streams.
#[derive(Clone, Copy, Debug)]
enum Codec {
    Lz4,
    Zlib,
    Zstd,
}

impl Codec {
    /// The codec of this number; the name of a codec that is not read.
    fn of(number: u8) -> Result<Self, &'static str> {
        match number {
            1 => Ok(Self::Lz4),
            3 => Ok(Self::Zlib),
            4 => Ok(Self::Zstd),
            0 => Err("BloscLZ"),
            2 => Err("Snappy"),
            _ => Err("another"),
        }
    }
}

/// Assembles elements: `shuffled` has all first bytes, all second bytes and so on, then remaining
/// bytes in their order.
fn unshuffle(shuffled: &[u8], element: usize, out: &mut [u8]) {
    let count = out.len() / element;
    let (columns, rest) = shuffled.split_at(count * element);
    let (elements, end) = out.split_at_mut(count * element);
    end.copy_from_slice(rest);
    for (byte, column) in columns.chunks_exact(count.max(1)).enumerate() {
        for (out, &value) in elements[byte..].iter_mut().step_by(element).zip(column) {
            *out = value;
        }
    }
}
