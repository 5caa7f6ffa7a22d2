//! Checked reads of the bytes of a file or a packet; every error contains its place.

use meissner_engine::Sensor;

use crate::error::{IoError, Place, shown};
use crate::left_out::{LeftOutKind, PassedOver};
use crate::recording::Salvage;

/// A slice of bytes and its place in the file.
///
/// Invariant: no method indexes beyond the slice; a position or length of any size gives an error.
#[derive(Clone, Copy)]
pub(crate) struct Bytes<'a> {
    /// Name of the format, for messages.
    pub(crate) format: &'static str,
    pub(crate) data: &'a [u8],
    /// The place of byte 0.
    pub(crate) origin: Place,
}

impl<'a> Bytes<'a> {
    /// A whole file.
    pub(crate) fn file(format: &'static str, data: &'a [u8]) -> Self {
        Self { format, data, origin: Place::Byte(0) }
    }

    pub(crate) fn len(&self) -> usize {
        self.data.len()
    }

    /// The place of the byte at `at`.
    pub(crate) fn place(&self, at: usize) -> Place {
        match self.origin {
            Place::Byte(byte) => Place::Byte(byte + at as u64),
            Place::Packet { packet, byte } => Place::Packet { packet, byte: byte + at as u64 },
            place @ (Place::Line(_) | Place::Event(_)) => place,
        }
    }

    /// The decompressed content of the packet at `at`.
    pub(crate) fn packet<'b>(&self, at: usize, content: &'b [u8]) -> Bytes<'b> {
        let packet = match self.place(at) {
            Place::Byte(place)
            | Place::Packet { packet: place, .. }
            | Place::Line(place)
            | Place::Event(place) => place,
        };
        Bytes { format: self.format, data: content, origin: Place::Packet { packet, byte: 0 } }
    }

    /// The bytes from `at` on, which must exist.
    pub(crate) fn after(&self, at: usize) -> Self {
        Self { data: &self.data[at..], origin: self.place(at), ..*self }
    }

    /// The `len` bytes at `at`.
    pub(crate) fn get(&self, what: &'static str, at: usize, len: usize) -> Result<&'a [u8], IoError> {
        let tail = self.data.get(at..).unwrap_or_default();
        tail.get(..len).ok_or_else(|| self.truncated(what, at, len as u64, false))
    }

    /// Checks that the file starts with `magic`.
    pub(crate) fn magic(&self, magic: &[u8]) -> Result<(), IoError> {
        let found = self.get("magic", 0, magic.len())?;
        if found == magic { Ok(()) } else { Err(self.malformed("magic", 0, shown(magic), shown(found))) }
    }

    pub(crate) fn array<const N: usize>(&self, what: &'static str, at: usize) -> Result<[u8; N], IoError> {
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

    /// The records of `N` bytes from byte `start` on. An incomplete last record is an error without
    /// `salvage`.
    pub(crate) fn records<const N: usize>(
        &self,
        what: &'static str,
        start: usize,
        salvage: bool,
    ) -> Result<(&'a [[u8; N]], Option<Salvage>), IoError> {
        let (records, rest) = self.data[start..].as_chunks();
        let end = self.len() - rest.len();
        match rest {
            [] => Ok((records, None)),
            _ if salvage => Ok((records, Some(self.salvage(what, end)))),
            _ => Err(self.truncated(what, end, N as u64, false)),
        }
    }

    /// The incomplete end from byte `at` on, which is left out.
    pub(crate) fn salvage(&self, what: &'static str, at: usize) -> Salvage {
        Salvage { what, place: self.place(at), bytes_not_read: (self.len() - at) as u64 }
    }

    /// The error of a part at `at` that needs `expected` bytes; `at_least`: or more.
    #[cold]
    pub(crate) fn truncated(&self, what: &'static str, at: usize, expected: u64, at_least: bool) -> IoError {
        let actual = self.len().saturating_sub(at) as u64;
        IoError::Truncated { format: self.format, what, place: self.place(at), expected, actual, at_least }
    }

    /// The error of a malformed part at `at`.
    #[cold]
    pub(crate) fn malformed(
        &self,
        what: &'static str,
        at: usize,
        expected: impl Into<String>,
        actual: impl ToString,
    ) -> IoError {
        let (expected, actual) = (expected.into(), actual.to_string());
        IoError::Malformed { format: self.format, what, place: self.place(at), expected, actual }
    }

    /// The error of a part at `at` of more than `limit` bytes; `at_least`: it may have more than
    /// `actual`.
    pub(crate) fn too_large(
        &self,
        what: &'static str,
        at: usize,
        limit: u64,
        actual: u64,
        at_least: bool,
    ) -> IoError {
        let (format, place, unit) = (self.format, self.place(at), "bytes");
        IoError::TooLarge { format, what, place, unit, limit, actual, at_least }
    }

    /// Whether an event at `at` lies inside `sensor`, if it is known; an event outside is left out.
    ///
    /// # Errors
    /// The event is outside, and the reader is strict.
    #[inline]
    pub(crate) fn is_inside(
        &self,
        sensor: Option<Sensor>,
        x: u16,
        y: u16,
        at: usize,
        passed: &mut PassedOver,
    ) -> Result<bool, IoError> {
        match sensor {
            Some(sensor) if !sensor.contains(x, y) => {
                passed.pass(LeftOutKind::OutsideSensor, 1, self.outside(sensor, x.into(), y, at))?;
                Ok(false)
            }
            _ => Ok(true),
        }
    }

    /// The error of an event at `at` that lies outside `sensor`.
    #[cold]
    pub(crate) fn outside(&self, sensor: Sensor, x: u32, y: u16, at: usize) -> IoError {
        IoError::OutsideSensor { format: self.format, place: self.place(at), sensor, x, y: y.into() }
    }
}

/// The first `N` bytes of a slice.
///
/// # Panics
/// If the slice is shorter: callers check its length before.
#[inline]
pub(crate) fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    *bytes.first_chunk().expect("a slice cut to size")
}
