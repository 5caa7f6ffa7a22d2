//! One packet of AEDAT4: decompression within the bounds of [`crate::limits`], and the part of
//! `FlatBuffers` that AEDAT4 uses, with every offset checked.
//!
//! A buffer starts with its size (u32), the offset of its root table (u32, counted from itself),
//! and a name of four letters. A table starts with the distance back to its vtable (i32). The
//! vtable holds its own length, the table's length, and for each field its offset in the table
//! (u16; 0: the field has its default value). A vector or string is an offset (u32, counted from
//! itself) to a count (u32) and the elements. Source: the `FlatBuffers` internals page.

use std::io::Read;

use lz4_flex::frame::FrameDecoder as Lz4;
use ruzstd::decoding::{FrameDecoder as Zstd, StreamingDecoder};

use crate::bytes::Bytes;
use crate::error::{IoError, shown};
use crate::limits::{PACKET_BYTES, most};

/// Bytes of the size before a buffer.
pub(super) const PREFIX: usize = 4;

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
    /// The root table of the buffer `bytes` of this name, whose length is its size prefix.
    pub(super) fn root(bytes: Bytes<'a>, what: &'static str, name: [u8; 4]) -> Result<Self, IoError> {
        Self::parse(bytes, what, Some(name))
    }

    /// The same for a buffer that may have no name.
    pub(super) fn of_any_name(bytes: Bytes<'a>, what: &'static str) -> Result<Self, IoError> {
        Self::parse(bytes, what, None)
    }

    /// The same for a buffer whose name must be `name`, if given.
    pub(super) fn parse(
        bytes: Bytes<'a>,
        what: &'static str,
        name: Option<[u8; 4]>,
    ) -> Result<Self, IoError> {
        let size = bytes.u32(what, 0)? as usize;
        if size != bytes.len() - PREFIX {
            let expected = format!("a content of {size} bytes");
            return Err(bytes.malformed(what, 0, expected, bytes.len() - PREFIX));
        }
        name.map_or(Ok(()), |name| check_name(bytes, what, name))?;
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
    fn position(&self, index: usize) -> Result<Option<usize>, IoError> {
        let entry = 4 + 2 * index;
        if entry + 2 > self.length {
            return Ok(None);
        }
        let offset = usize::from(self.bytes.u16(self.what, self.vtable + entry)?);
        Ok((offset != 0).then_some(self.at + offset))
    }

    /// The `N` bytes of field `index`; `None`: it has its default value.
    pub(super) fn field<const N: usize>(&self, index: usize) -> Result<Option<[u8; N]>, IoError> {
        self.position(index)?.map(|at| self.bytes.array(self.what, at)).transpose()
    }

    /// A vector of elements of `stride` bytes: position and bytes, empty if the field is missing.
    pub(super) fn vector(&self, index: usize, stride: usize) -> Result<(usize, &'a [u8]), IoError> {
        let Some(at) = self.position(index)? else { return Ok((0, &[])) };
        let start = at.saturating_add(self.bytes.u32(self.what, at)? as usize);
        let count = self.bytes.u32(self.what, start)? as usize;
        let elements = self.bytes.get(self.what, start + 4, count.saturating_mul(stride))?;
        Ok((start + 4, elements))
    }
}

/// The name of four letters of a buffer.
pub(super) fn name_of(bytes: Bytes<'_>, what: &'static str) -> Result<[u8; 4], IoError> {
    bytes.array(what, PREFIX + 4)
}

/// Refuses a buffer with another name of four letters.
pub(super) fn check_name(bytes: Bytes<'_>, what: &'static str, name: [u8; 4]) -> Result<(), IoError> {
    let actual = name_of(bytes, what)?;
    if actual == name { Ok(()) } else { Err(bytes.malformed(what, PREFIX + 4, shown(&name), shown(&actual))) }
}

/// Compression of the packets of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compression {
    None,
    Lz4,
    Zstd,
}

/// Decompresses one packet after another into one buffer.
///
/// Invariant: a packet has at most [`PACKET_BYTES`]; all packets together have at most this plus
/// [`EXPANSION`](crate::limits::EXPANSION) times the length of the file.
pub(crate) struct Inflater<'a> {
    pub(crate) compression: Compression,
    file: Bytes<'a>,
    buffer: Vec<u8>,
    zstd: Zstd,
    /// Bytes that the file may still expand to.
    pub(super) budget: u64,
}

impl<'f> Inflater<'f> {
    /// An inflater for the packets of `file`.
    pub(crate) fn new(compression: Compression, file: Bytes<'f>) -> Self {
        let mut zstd = Zstd::new();
        zstd.set_max_window_size(PACKET_BYTES);
        let budget = most(file.len() as u64);
        Self { compression, file, buffer: Vec::new(), zstd, budget }
    }

    /// The content of `packet`, whose header is at byte `at` of the file.
    pub(crate) fn inflate<'a>(&'a mut self, packet: &'a [u8], at: usize) -> Result<&'a [u8], IoError> {
        let limit = PACKET_BYTES.min(self.budget);
        let actual = self.prefix(packet, at, limit + 1)?.len() as u64;
        if actual > limit {
            return Err(self.file.too_large("decompressed packet", at, limit, actual, true));
        }
        if self.compression == Compression::None {
            return Ok(packet);
        }
        self.budget -= actual;
        Ok(&self.buffer)
    }

    /// The first `most` bytes of the content of `packet`, or all of it if it is shorter. The
    /// packet's end and its checksum are checked only in that case.
    pub(super) fn prefix<'a>(
        &'a mut self,
        packet: &'a [u8],
        at: usize,
        most: u64,
    ) -> Result<&'a [u8], IoError> {
        let file = self.file;
        let malformed = |expected, actual: String| file.malformed("compressed packet", at, expected, actual);
        self.buffer.clear();
        let mut rest = packet;
        let (expected, unpacked) = match self.compression {
            Compression::None => return Ok(packet.get(..most as usize).unwrap_or(packet)),
            Compression::Lz4 => {
                ("one LZ4 frame", Lz4::new(&mut rest).take(most).read_to_end(&mut self.buffer))
            }
            Compression::Zstd => {
                let expected = "one Zstandard frame";
                let stream = StreamingDecoder::new_with_decoder(&mut rest, &mut self.zstd)
                    .map_err(|error| malformed(expected, error.to_string()))?;
                (expected, stream.take(most).read_to_end(&mut self.buffer))
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
