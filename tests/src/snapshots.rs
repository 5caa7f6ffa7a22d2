//! Snapshots that were changed on purpose.

use std::hash::Hasher;

use fnv::FnvHasher;
use meissner_engine::EngineError;

/// Bytes before the content.
const HEADER: usize = 24;
/// Bytes after the content of a snapshot without a note: the length of the note, and the checksum.
pub const FOOTER: usize = 16;

/// A snapshot with changed content and the right length and checksum (FNV-1a).
pub fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.truncate(bytes.len() - 8);
    let length = (bytes.len() + 8) as u64;
    bytes[16..24].copy_from_slice(&length.to_le_bytes());
    let mut checksum = FnvHasher::default();
    checksum.write(&bytes);
    bytes.extend(checksum.finish().to_le_bytes());
    bytes
}

/// The positions of the fields of a snapshot, with the names that its reader uses.
#[derive(Debug)]
pub struct Fields(Vec<(String, usize)>);

impl Fields {
    /// The fields of `bytes`, which `restore` reads: a field is missing if the content is cut
    /// before its end. Items whose number is checked against the remaining bytes belong to the
    /// field of this number.
    pub fn of(bytes: &[u8], mut restore: impl FnMut(&[u8]) -> Result<(), EngineError>) -> Self {
        let mut fields: Vec<(String, usize)> = Vec::new();
        for end in HEADER..bytes.len() - FOOTER {
            let cut = sealed([&bytes[..end], &[0; FOOTER]].concat());
            if let Err(EngineError::SnapshotBytes { what, at, .. }) = restore(&cut)
                && fields.last().is_none_or(|(last, _)| *last != what)
            {
                fields.push((what, at));
            }
        }
        Self(fields)
    }

    /// The first byte of a field.
    ///
    /// # Panics
    /// If there is none of this name.
    pub fn at(&self, name: &str) -> usize {
        self.0[self.index(name)].1
    }

    /// The first byte after a field, or after several of one name that follow each other.
    ///
    /// # Panics
    /// If there is none of this name, or it is the last.
    pub fn end(&self, name: &str) -> usize {
        self.0[self.index(name) + 1].1
    }

    fn index(&self, name: &str) -> usize {
        let place = self.0.iter().position(|(field, _)| field == name);
        place.unwrap_or_else(|| panic!("no field {name:?} in {:?}", self.0))
    }
}
