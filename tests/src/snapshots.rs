//! Snapshots that were changed on purpose, and what engines of both kinds do with them.

use std::hash::Hasher;

use fnv::FnvHasher;
use meissner_engine::frames::FrameEngine;
use meissner_engine::{Engine, EngineError};

/// The methods of this name of engines of both kinds.
pub trait Restores: Clone {
    /// The state as bytes.
    fn to_bytes(&self) -> Vec<u8>;
    /// Returns to the state that `bytes` hold.
    ///
    /// # Errors
    /// If they hold none of this engine, which stays as it is.
    fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError>;
    /// Forgets everything.
    fn reset(&mut self);
}

impl Restores for Engine {
    fn to_bytes(&self) -> Vec<u8> {
        self.to_bytes()
    }

    fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        self.restore_bytes(bytes)
    }

    fn reset(&mut self) {
        self.reset();
    }
}

impl Restores for FrameEngine {
    fn to_bytes(&self) -> Vec<u8> {
        self.to_bytes()
    }

    fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        self.restore_bytes(bytes)
    }

    fn reset(&mut self) {
        self.reset();
    }
}

/// `bytes`, a snapshot whose content was changed, with length and checksum that fit: FNV-1a over all before it.
pub fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.truncate(bytes.len() - 8);
    let length = (bytes.len() + 8) as u64;
    bytes[16..24].copy_from_slice(&length.to_le_bytes());
    let mut checksum = FnvHasher::default();
    checksum.write(&bytes);
    bytes.extend(checksum.finish().to_le_bytes());
    bytes
}
