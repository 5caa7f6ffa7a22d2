//! Weights: named tensors, from safetensors or from `PyTorch` state dicts.
//!
//! Enters: bytes, of which nothing is trusted. Leaves: [`Weights`], floating-point tensors as f32 and of all others the
//! name, type and shape. Invariant: memory stays within a small multiple of the file's size, and no byte is executed.

pub(crate) mod card;
mod file;
mod format;
mod pickle;
mod safetensors;
mod scalar;
mod state_dict;
mod zip;

use std::collections::BTreeMap;
use std::path::Path;

use crate::ModelError;

pub use card::Card;
pub use file::TensorFile;
pub use format::FormatError;

/// Largest file that is read.
const LARGEST_FILE: u64 = 1 << 31;

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
}

/// A tensor of a weights file.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    shape: Vec<usize>,
    values: Values,
}

#[derive(Clone, Debug, PartialEq)]
enum Values {
    Float(Vec<f32>),
    /// Values that no network reads, and their type.
    Other(String),
}

impl Tensor {
    /// A tensor of `shape` in row-major order; `None` where `values` are not as many as `shape` says.
    pub fn new(shape: Vec<usize>, values: Vec<f32>) -> Option<Self> {
        let count = shape.iter().try_fold(1usize, |n, &d| n.checked_mul(d))?;
        (count == values.len()).then_some(Self { shape, values: Values::Float(values) })
    }

    /// A tensor whose values no network reads.
    fn other(shape: Vec<usize>, dtype: impl Into<String>) -> Self {
        Self { shape, values: Values::Other(dtype.into()) }
    }

    /// Its shape.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Its values in row-major order; `None` where they are not floating-point numbers.
    pub fn values(&self) -> Option<&[f32]> {
        match &self.values {
            Values::Float(values) => Some(values),
            Values::Other(_) => None,
        }
    }

    /// Type of its values: "F32" for all that were floating-point, else the file's word.
    pub fn dtype(&self) -> &str {
        match &self.values {
            Values::Float(_) => "F32",
            Values::Other(dtype) => dtype,
        }
    }
}

impl Weights {
    /// Weights of `tensors`.
    pub fn new(tensors: impl IntoIterator<Item = (String, Tensor)>) -> Self {
        Self { tensors: tensors.into_iter().collect(), metadata: BTreeMap::new() }
    }

    /// The same tensors with these remarks.
    pub(crate) fn with_metadata(self, metadata: BTreeMap<String, String>) -> Self {
        Self { metadata, ..self }
    }

    /// Reads a safetensors file or a `PyTorch` state dict (`.pt`, `.pth`), whichever the content is.
    ///
    /// # Errors
    /// [`ModelError::Read`], [`ModelError::Large`] for more than 2 GiB, and as [`Self::from_bytes`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self, ModelError> {
        Ok(Self::from_bytes(&crate::bounded::read(path.as_ref(), LARGEST_FILE)?)?)
    }

    /// Reads weights from the bytes of a file.
    ///
    /// safetensors: F32, F64, F16 and BF16 become f32, rounded to nearest. State dicts: what `torch.save` writes by
    /// default (a zip archive of stored entries, pickle protocol 2), either the state dict itself or a checkpoint that
    /// holds it as `state_dict`, `model_state_dict` or `model`.
    ///
    /// # Errors
    /// [`FormatError`] where the bytes are neither, are damaged, or would need anything executed.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FormatError> {
        if bytes.starts_with(zip::MAGIC) {
            return state_dict::read(bytes);
        }
        if state_dict::is_legacy(bytes) {
            return Err(FormatError::Legacy);
        }
        safetensors::read(bytes)
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

    /// The file's own remarks: `__metadata__` of safetensors.
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// The floating-point tensors as the bytes of a safetensors file with `metadata`; equal weights give equal bytes.
    pub fn to_safetensors(&self, metadata: &BTreeMap<String, String>) -> Vec<u8> {
        safetensors::write(self, metadata)
    }
}
