//! Checked reads of the bytes of a file or a packet; every error names its place.

use std::slice::ChunksExact;

use crate::error::{IoError, Place};
use crate::format::Format;
use crate::recording::Salvage;

/// A slice of bytes and its place in the file.
///
/// Invariant: no method indexes beyond the slice; a position or length of any size gives an error.
#[derive(Clone, Copy)]
pub(crate) struct Bytes<'a> {
    pub(crate) format: Format,
    data: &'a [u8],
    /// The place of byte 0.
    origin: Place,
}

impl<'a> Bytes<'a> {
    /// `data` starts at `origin`.
    pub(crate) fn new(format: Format, data: &'a [u8], origin: Place) -> Self {
        Self { format, data, origin }
    }

    pub(crate) fn len(&self) -> usize {
        self.data.len()
    }

    /// The place of the byte at `at`.
    pub(crate) fn place(&self, at: usize) -> Place {
        match self.origin {
            Place::Byte(byte) => Place::Byte(byte + at as u64),
            Place::Packet { packet, byte } => Place::Packet { packet, byte: byte + at as u64 },
            Place::Line(line) => Place::Line(line),
        }
    }

    /// The `len` bytes at `at`.
    pub(crate) fn get(&self, what: &'static str, at: usize, len: usize) -> Result<&'a [u8], IoError> {
        let tail = self.data.get(at..).unwrap_or_default();
        tail.get(..len).ok_or_else(|| IoError::Truncated {
            format: self.format,
            what,
            place: self.place(at),
            expected: len as u64,
            actual: tail.len() as u64,
        })
    }

    fn array<const N: usize>(&self, what: &'static str, at: usize) -> Result<[u8; N], IoError> {
        self.get(what, at, N).map(array)
    }

    pub(crate) fn u16(&self, what: &'static str, at: usize) -> Result<u16, IoError> {
        self.array(what, at).map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&self, what: &'static str, at: usize) -> Result<u32, IoError> {
        self.array(what, at).map(u32::from_le_bytes)
    }

    pub(crate) fn i32(&self, what: &'static str, at: usize) -> Result<i32, IoError> {
        self.array(what, at).map(i32::from_le_bytes)
    }

    pub(crate) fn i64(&self, what: &'static str, at: usize) -> Result<i64, IoError> {
        self.array(what, at).map(i64::from_le_bytes)
    }

    /// An error about the bytes at `at`.
    pub(crate) fn malformed(
        &self,
        what: &'static str,
        at: usize,
        expected: impl Into<String>,
        actual: impl Into<String>,
    ) -> IoError {
        IoError::malformed(self.format, what, self.place(at), expected, actual)
    }
}

/// The first `N` bytes of a slice.
///
/// # Panics
/// Where the slice is shorter: callers check its length before.
#[inline]
pub(crate) fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    *bytes.first_chunk().expect("a slice cut to size")
}

/// The units of `size` bytes from byte `start` of a file on. An incomplete last unit is an error, or is left out with
/// `salvage`.
pub(crate) fn units<'a>(
    format: Format,
    what: &'static str,
    bytes: &'a [u8],
    start: usize,
    size: usize,
    salvage: bool,
) -> Result<(ChunksExact<'a, u8>, Option<Salvage>), IoError> {
    let units = bytes[start..].chunks_exact(size);
    let rest = units.remainder().len();
    let place = Place::Byte((bytes.len() - rest) as u64);
    let cut = (rest > 0).then_some(Salvage { what, place, bytes_not_read: rest as u64 });
    if cut.is_some() && !salvage {
        let (expected, actual) = (size as u64, rest as u64);
        return Err(IoError::Truncated { format, what, place, expected, actual });
    }
    Ok((units, cut))
}
