//! One packet of AEDAT4: decompression within the bounds of [`crate::limits`], and the part of `FlatBuffers` that AEDAT4
//! uses, with every offset checked.
//!
//! A buffer starts with its size (u32), the offset of its root table (u32, counted from itself), and a name of four letters.
//! A table starts with the distance back to its vtable (i32). The vtable holds its own length, the table's length, and for
//! each field its offset in the table (u16; 0: the field has its default value). A vector or string is an offset (u32, counted
//! from itself) to a count (u32) and the elements. Source: the `FlatBuffers` internals page.

use std::io::Read;

use lz4_flex::frame::FrameDecoder as Lz4;
use ruzstd::decoding::{FrameDecoder as Zstd, StreamingDecoder};

use crate::bytes::{Bytes, array};
use crate::error::{IoError, Place, shown};
use crate::format::Format;
use crate::limits::{EXPANSION, PACKET_BYTES};

/// Bytes of the size before a buffer.
const PREFIX: usize = 4;

/// A table of a buffer.
#[derive(Clone, Copy)]
pub(super) struct Table<'a> {
    bytes: Bytes<'a>,
    what: &'static str,
    at: usize,
    vtable: usize,
    /// Length of the vtable in bytes.
    length: usize,
}

impl<'a> Table<'a> {
    /// The root table of the buffer `bytes`, whose name must be `name` and whose length must be its size prefix.
    pub(super) fn root(bytes: Bytes<'a>, what: &'static str, name: [u8; 4]) -> Result<Self, IoError> {
        let size = bytes.u32(what, 0)? as usize;
        if size != bytes.len() - PREFIX {
            let actual = (bytes.len() - PREFIX).to_string();
            return Err(bytes.malformed(what, 0, format!("a content of {size} bytes"), actual));
        }
        check_name(bytes, what, name)?;
        let at = PREFIX.saturating_add(bytes.u32(what, PREFIX)? as usize);
        let back = i64::from(bytes.i32(what, at)?);
        let vtable = usize::try_from(at as i64 - back).map_err(|_| {
            bytes.malformed(what, at, "a table description inside of the content", "one before it")
        })?;
        let length = usize::from(bytes.u16(what, vtable)?);
        bytes.get(what, vtable, length)?;
        Ok(Self { bytes, what, at, vtable, length })
    }

    /// The position of field `index`; `None`: it has its default value.
    fn field(&self, index: usize) -> Result<Option<usize>, IoError> {
        let entry = 4 + 2 * index;
        if entry + 2 > self.length {
            return Ok(None);
        }
        let offset = usize::from(self.bytes.u16(self.what, self.vtable + entry)?);
        Ok((offset != 0).then_some(self.at + offset))
    }

    /// A field of 32 bits.
    pub(super) fn i32(&self, index: usize, default: i32) -> Result<i32, IoError> {
        self.field(index)?.map_or(Ok(default), |at| self.bytes.i32(self.what, at))
    }

    /// A field of 64 bits.
    pub(super) fn i64(&self, index: usize, default: i64) -> Result<i64, IoError> {
        self.field(index)?.map_or(Ok(default), |at| self.bytes.i64(self.what, at))
    }

    /// A vector of elements of `stride` bytes: its position and its bytes. Empty where the field is missing.
    pub(super) fn vector(&self, index: usize, stride: usize) -> Result<(usize, &'a [u8]), IoError> {
        let Some(at) = self.field(index)? else { return Ok((0, &[])) };
        let start = at.saturating_add(self.bytes.u32(self.what, at)? as usize);
        let count = self.bytes.u32(self.what, start)? as usize;
        let elements = self.bytes.get(self.what, start + 4, count.saturating_mul(stride))?;
        Ok((start + 4, elements))
    }
}

/// Refuses a buffer with another name of four letters.
pub(super) fn check_name(bytes: Bytes<'_>, what: &'static str, name: [u8; 4]) -> Result<(), IoError> {
    let at = PREFIX + 4;
    let actual: [u8; 4] = array(bytes.get(what, at, 4)?);
    if actual == name {
        return Ok(());
    }
    Err(bytes.malformed(what, at, shown(&name), shown(&actual)))
}

/// How the packets of a file are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compression {
    None,
    Lz4,
    Zstd,
}

/// Decompresses one packet after another into one buffer.
///
/// Invariant: a packet has at most [`PACKET_BYTES`], and all packets together at most [`EXPANSION`] times the length of the
/// file more, whatever the compressed bytes are.
pub(super) struct Inflater {
    compression: Compression,
    buffer: Vec<u8>,
    zstd: Zstd,
    /// Bytes that the file may still decompress to.
    budget: u64,
}

impl Inflater {
    /// For the packets of a file of `file_bytes` bytes.
    pub(super) fn new(compression: Compression, file_bytes: u64) -> Self {
        let mut zstd = Zstd::new();
        zstd.set_max_window_size(PACKET_BYTES);
        let budget = PACKET_BYTES.saturating_add(file_bytes.saturating_mul(EXPANSION));
        Self { compression, buffer: Vec::new(), zstd, budget }
    }

    /// The content of `packet`, whose header is at byte `at` of the file.
    pub(super) fn inflate<'a>(&'a mut self, packet: &'a [u8], at: usize) -> Result<&'a [u8], IoError> {
        let limit = PACKET_BYTES.min(self.budget);
        let content = self.prefix(packet, at, limit + 1)?;
        let actual = content.len() as u64;
        if actual > limit {
            let (format, what, place) = (Format::Aedat4, "decompressed packet", Place::Byte(at as u64));
            return Err(IoError::TooLarge { format, what, place, limit, actual, at_least: true });
        }
        if self.compression == Compression::None {
            return Ok(packet);
        }
        self.budget -= actual;
        Ok(&self.buffer)
    }

    /// The first `most` bytes of the content of `packet`, or all of it if it is shorter. Only then are the packet's end and
    /// its checksum checked.
    pub(super) fn prefix<'a>(
        &'a mut self,
        packet: &'a [u8],
        at: usize,
        most: u64,
    ) -> Result<&'a [u8], IoError> {
        let malformed = |expected: &str, actual: String| {
            IoError::malformed(Format::Aedat4, "compressed packet", Place::Byte(at as u64), expected, actual)
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
