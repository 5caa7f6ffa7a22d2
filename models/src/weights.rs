//! Weights: named tensors, from safetensors or from `PyTorch` state dicts.
//!
//! Input: untrusted bytes. Output: [`Weights`]: floats as f32; name, type and shape of others.
//! Invariant: memory stays within a small multiple of the file; nothing is executed.

pub(crate) mod card;
mod error;
mod map;
pub(crate) mod names;
mod pickle;
pub(crate) mod safetensors;
pub(crate) mod state_dict;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::ModelError;

pub use card::{Card, frames_text, windows_text};
pub use error::FormatError;
pub use map::NameMap;
pub use safetensors::{Tensor, TensorFile};

const MAX_FILE: u64 = 1 << 31;

/// Named tensors, in the order of their names.
///
/// ```
/// use std::collections::BTreeMap;
///
/// use meissner_models::{Description, Weights, draw};
///
/// let description = Description::shipped("tactigraph-past").expect("a shipped network");
/// let remarks = BTreeMap::from([("about".to_owned(), "drawn for an example".to_owned())]);
/// let bytes = draw(&description, 1).to_safetensors(&remarks);
///
/// let weights = Weights::from_bytes(&bytes)?;
/// assert_eq!(weights.metadata(), &remarks);
/// assert!(description.tensors().iter().all(|(name, _)| weights.get(name).is_some()));
/// # Ok::<(), meissner_models::FormatError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    tensors: BTreeMap<String, Tensor>,
    metadata: BTreeMap<String, String>,
    /// Names from a map: they are names of the network.
    mapped: BTreeSet<String>,
}

impl Weights {
    /// Weights of `tensors`.
    pub fn new(tensors: impl IntoIterator<Item = (String, Tensor)>) -> Self {
        Self { tensors: tensors.into_iter().collect(), metadata: BTreeMap::new(), mapped: BTreeSet::new() }
    }

    #[cfg(test)]
    pub(crate) fn with_metadata(self, metadata: BTreeMap<String, String>) -> Self {
        Self { metadata, ..self }
    }

    /// Reads a safetensors file or `PyTorch` state dict (`.pt`, `.pth`), by content, not name.
    ///
    /// # Errors
    /// [`ModelError::Read`], [`ModelError::Large`] beyond 2 GiB, and as [`Self::from_bytes`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self, ModelError> {
        Ok(Self::from_bytes(&crate::error::read(path.as_ref(), MAX_FILE)?)?)
    }

    /// Reads weights from the bytes of a file.
    ///
    /// F32, F64, F16 and BF16 become f32, rounded to nearest. A state dict is a file that
    /// `torch.save` writes by default (a zip of stored entries, pickle protocol 2): the state dict
    /// itself, or a checkpoint that contains one under `state_dict`, `model_state_dict`, `model`,
    /// `net` or `module`.
    ///
    /// # Errors
    /// [`FormatError`] for bytes that are in neither format, damaged, or would execute code, such
    /// as a whole module.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FormatError> {
        if bytes.starts_with(state_dict::MAGIC) {
            return Ok(Self::new(state_dict::read(bytes)?));
        }
        if state_dict::is_legacy(bytes) {
            return Err(FormatError::Legacy);
        }
        let (tensors, metadata) = safetensors::read(bytes)?;
        Ok(Self { metadata, ..Self::new(tensors) })
    }

    /// Tensor `name`.
    pub fn get(&self, name: &str) -> Option<&Tensor> {
        self.tensors.get(name)
    }

    /// Names, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.tensors.keys().map(String::as_str)
    }

    /// Names and tensors, in order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Tensor)> {
        self.tensors.iter().map(|(name, tensor)| (name.as_str(), tensor))
    }

    /// The metadata of the file: `__metadata__` of safetensors.
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// The floating-point tensors as safetensors with `metadata`; equal weights give equal bytes.
    pub fn to_safetensors(&self, metadata: &BTreeMap<String, String>) -> Vec<u8> {
        let mut file = TensorFile::new(metadata.clone());
        for (name, tensor) in &self.tensors {
            if let Some(values) = tensor.values() {
                file.f32(name, tensor.shape(), values);
            }
        }
        file.into_bytes()
    }

    /// The floating-point tensors in the smallest type that can represent their values, with
    /// `metadata`.
    pub fn to_file(&self, metadata: BTreeMap<String, String>) -> TensorFile {
        let mut file = TensorFile::new(metadata);
        for (name, tensor) in &self.tensors {
            if let Some(values) = tensor.values() {
                file.floats(name, tensor.shape(), values);
            }
        }
        file
    }
}
