//! Encodes a state as the bytes of a snapshot.

use super::format::{CHECKSUM, HEADER, Kind, MAGIC, VERSION};
use crate::fingerprint;

/// The bytes of a snapshot so far.
#[derive(Debug)]
pub(crate) struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    /// A snapshot without content.
    pub(crate) fn new(kind: Kind) -> Self {
        let mut writer = Self { bytes: MAGIC.to_vec() };
        writer.u32(VERSION);
        writer.u32(kind as u32);
        writer.u64(0);
        writer
    }

    pub(crate) fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    pub(crate) fn flag(&mut self, value: bool) {
        self.u8(value.into());
    }

    pub(crate) fn u16(&mut self, value: u16) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn u32(&mut self, value: u32) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn u64(&mut self, value: u64) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn i64(&mut self, value: i64) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn counts<const N: usize>(&mut self, counts: [u64; N]) {
        counts.into_iter().for_each(|count| self.u64(count));
    }

    pub(crate) fn size(&mut self, size: usize) {
        self.u64(size as u64);
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.size(text.len());
        self.bytes.extend(text.as_bytes());
    }

    /// Writes values without their number, which the reader knows.
    pub(crate) fn values(&mut self, values: &[f32]) {
        self.bytes.extend(values.iter().flat_map(|value| value.to_bits().to_le_bytes()));
    }

    /// Completes the snapshot with a note of the caller.
    pub(crate) fn finish(mut self, note: &[u8]) -> Vec<u8> {
        self.bytes.extend(note);
        self.size(note.len());
        let length = (self.bytes.len() + CHECKSUM) as u64;
        self.bytes[HEADER - 8..HEADER].copy_from_slice(&length.to_le_bytes());
        let checksum = fingerprint::of_bytes(&self.bytes);
        self.u64(checksum);
        self.bytes
    }
}
