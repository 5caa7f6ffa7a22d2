//! Snapshots: states of engines, as copies and as little-endian bytes.
//!
//! ```text
//! "MEISSNER"   8 bytes
//! version      u32
//! kind         u32    1 an engine over events, 2 a frame engine
//! length       u64    of the whole, checksum included
//! content             engine/snapshot.rs, frames/step/snapshot.rs
//! note                bytes given by the caller
//! its length   u64
//! checksum     u64    FNV-1a of all before it
//! ```
//!
//! The checksum detects every change of a byte. Forged content with a valid checksum is checked
//! too: before allocation, counts against the remaining bytes and the engine's capacity, sizes
//! against the network. No value that is read is used as an index.

mod format;
mod reader;
mod writer;

use std::fmt;

use crate::EngineError;
pub(crate) use format::Kind;
pub use reader::snapshot_note;
pub(crate) use reader::{Reader, check_network, differs};
pub(crate) use writer::Writer;

/// An engine that a snapshot can hold.
pub trait Stored: Clone {
    /// Its kind.
    const KIND: Kind;
    /// Encodes its state as bytes, with a note.
    fn to_bytes_with(&self, note: &[u8]) -> Vec<u8>;
}

/// The state of an engine of type `E` at one moment, as a copy or as bytes.
#[derive(Clone)]
#[must_use]
pub struct SnapshotOf<E>(pub(crate) Content<E>);

/// Content of a snapshot.
#[derive(Clone)]
pub(crate) enum Content<E> {
    Copy(Box<E>),
    /// Bytes whose header and checksum have been checked.
    Bytes(Vec<u8>),
}

impl<E: Stored> SnapshotOf<E> {
    /// The snapshot that `to_bytes` wrote. Whether it fits an engine is checked when restored.
    /// O(bytes).
    ///
    /// # Errors
    /// [`EngineError::Snapshot`] for another version or kind of engine;
    /// [`EngineError::SnapshotBytes`] for truncated or changed bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, EngineError> {
        Reader::open(bytes, E::KIND)?;
        Ok(Self(Content::Bytes(bytes.to_vec())))
    }

    /// The snapshot as bytes, for [`Self::from_bytes`] or for an engine's `restore_bytes`.
    pub fn to_bytes(&self) -> Vec<u8> {
        match &self.0 {
            Content::Copy(engine) => engine.to_bytes_with(&[]),
            Content::Bytes(bytes) => bytes.clone(),
        }
    }
}

impl<E: fmt::Debug> fmt::Debug for SnapshotOf<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Content::Copy(engine) => f.debug_tuple("Snapshot").field(engine).finish(),
            Content::Bytes(bytes) => write!(f, "Snapshot({} bytes)", bytes.len()),
        }
    }
}
