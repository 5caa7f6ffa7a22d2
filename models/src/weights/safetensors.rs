//! safetensors: read through the `safetensors` crate, which checks every offset; written here, so that the same weights
//! give the same bytes (the crate orders metadata by a random hash).

use std::collections::BTreeMap;

use safetensors::tensor::{Dtype, SafeTensors};
use serde::Serialize;

use super::scalar::Float;
use super::{FormatError, Tensor, Weights};

/// Reads the bytes of a safetensors file.
pub(super) fn read(bytes: &[u8]) -> Result<Weights, FormatError> {
    let invalid = |e: safetensors::SafeTensorError| FormatError::Safetensors(e.to_string());
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(invalid)?;
    let file = SafeTensors::deserialize(bytes).map_err(invalid)?;
    let mut tensors = BTreeMap::new();
    for (name, view) in file.iter() {
        let float = match view.dtype() {
            Dtype::F16 => Some(Float::F16),
            Dtype::BF16 => Some(Float::Bf16),
            Dtype::F32 => Some(Float::F32),
            Dtype::F64 => Some(Float::F64),
            _ => None,
        };
        let shape = view.shape().to_vec();
        let tensor = match float {
            None => Tensor::other(shape, format!("{:?}", view.dtype())),
            Some(float) => {
                let count = view.data().len() / float.size();
                let values = (0..count).filter_map(|i| float.get(view.data(), i)).collect();
                let sizes = || FormatError::Tensor {
                    tensor: name.to_owned(),
                    what: "values",
                    expected: format!("as many as shape {:?} has", view.shape()),
                    found: count.to_string(),
                };
                Tensor::new(shape, values).ok_or_else(sizes)?
            }
        };
        tensors.insert(name.to_owned(), tensor);
    }
    let metadata = header.metadata().iter().flatten().map(|(k, v)| (k.clone(), v.clone())).collect();
    Ok(Weights { tensors, metadata })
}

/// A tensor in the header.
#[derive(Serialize)]
struct Info<'a> {
    dtype: &'static str,
    shape: &'a [usize],
    data_offsets: [usize; 2],
}

/// An entry of the header.
#[derive(Serialize)]
#[serde(untagged)]
enum Entry<'a> {
    Metadata(&'a BTreeMap<String, String>),
    Tensor(Info<'a>),
}

/// The bytes of a safetensors file: header length, header, values in the order of the names.
pub(super) fn write(weights: &Weights, metadata: &BTreeMap<String, String>) -> Vec<u8> {
    let mut header = BTreeMap::new();
    let mut data = Vec::new();
    for (name, tensor) in weights.iter() {
        let Some(values) = tensor.values() else { continue };
        let start = data.len();
        data.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        let info = Info { dtype: "F32", shape: tensor.shape(), data_offsets: [start, data.len()] };
        header.insert(name, Entry::Tensor(info));
    }
    if !metadata.is_empty() {
        header.insert("__metadata__", Entry::Metadata(metadata));
    }
    let mut header = serde_json::to_vec(&header).expect("names, numbers and strings always serialise");
    // Values start at a multiple of 8, which readers that map the file rely on.
    header.resize(header.len().next_multiple_of(8), b' ');
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend(header);
    bytes.extend(data);
    bytes
}
