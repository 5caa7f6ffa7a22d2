//! safetensors: read through the `safetensors` crate, which checks every offset; written by [`TensorFile`].
//!
//! The crate takes the last of two tensors of one name; here both are refused, as the format asks for.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use safetensors::tensor::{Dtype, SafeTensors};
use serde::de::{Deserializer, Error, IgnoredAny, MapAccess, Visitor};

use super::format::quoted;
use super::scalar::Float;
use super::{FormatError, Tensor, TensorFile, Weights};

/// Longest header: some 100,000 tensors. A byte of it may become ten.
const LARGEST_HEADER: u64 = 1 << 24;

/// Reads the bytes of a safetensors file.
pub(super) fn read(bytes: &[u8]) -> Result<Weights, FormatError> {
    if let Some(&length) = bytes.first_chunk() {
        let length = u64::from_le_bytes(length);
        if length > LARGEST_HEADER {
            let found = format!("a header of at most {LARGEST_HEADER} bytes expected, {length} found");
            return Err(FormatError::Safetensors(found));
        }
    }
    let invalid = |e: safetensors::SafeTensorError| FormatError::Safetensors(quoted(&e.to_string()));
    let (length, header) = SafeTensors::read_metadata(bytes).map_err(invalid)?;
    // The crate has read as much.
    let names = serde_json::Deserializer::from_slice(&bytes[8..8 + length]).deserialize_map(Names);
    names.map_err(|e| FormatError::Safetensors(e.to_string()))?;
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
                    tensor: quoted(name),
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

/// The names of a header, each of which there is once.
struct Names;

impl<'de> Visitor<'de> for Names {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("tensors by their names")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut names = BTreeSet::new();
        while let Some(name) = map.next_key::<String>()? {
            map.next_value::<IgnoredAny>()?;
            if let Some(name) = names.replace(name) {
                let found = quoted(&name);
                return Err(A::Error::custom(format_args!(
                    "tensor \"{found}\": expected one of this name, found two"
                )));
            }
        }
        Ok(())
    }
}

/// The bytes of a safetensors file with the floating-point tensors.
pub(super) fn write(weights: &Weights, metadata: &BTreeMap<String, String>) -> Vec<u8> {
    let mut file = TensorFile::new(metadata.clone());
    for (name, tensor) in weights.iter() {
        if let Some(values) = tensor.values() {
            file.f32(name, tensor.shape(), values);
        }
    }
    file.into_bytes()
}
