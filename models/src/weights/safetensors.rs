//! The safetensors format: read through the `safetensors` crate, and written here.
//!
//! Reading: two tensors with the same name are refused, as the format requires (the crate takes the
//! last).
//!
//! Writing: equal contents give equal bytes, by name (the crate orders metadata by a random hash).
//! Arrays with wider values come first, so that each starts at a multiple of its values' size.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use meissner_kernels::floats;
use safetensors::tensor::{Dtype, SafeTensors};
use serde::Serialize;
use serde::de::{Deserializer, Error, IgnoredAny, MapAccess, Visitor};

use crate::weights::error::{FormatError, quoted};

/// Longest header, for about 100,000 tensors. One byte of a header can take ten bytes of memory.
const MAX_HEADER: u64 = 1 << 24;

/// The tensors and the metadata of a safetensors file.
type Contents = (BTreeMap<String, Tensor>, BTreeMap<String, String>);

pub(super) fn read(bytes: &[u8]) -> Result<Contents, FormatError> {
    if let Some(&length) = bytes.first_chunk() {
        let length = u64::from_le_bytes(length);
        if length > MAX_HEADER {
            let found = format!("a header of at most {MAX_HEADER} bytes expected, {length} found");
            return Err(FormatError::Safetensors(found));
        }
    }
    let invalid = |e: safetensors::SafeTensorError| FormatError::Safetensors(quoted(&e.to_string()));
    let (length, header) = SafeTensors::read_metadata(bytes).map_err(invalid)?;
    let names = serde_json::Deserializer::from_slice(&bytes[8..8 + length]).deserialize_map(Names);
    names.map_err(|e| FormatError::Safetensors(e.to_string()))?;
    let file = SafeTensors::deserialize(bytes).map_err(invalid)?;
    let mut tensors = BTreeMap::new();
    for (name, view) in file.iter() {
        let (dtype, shape) = (view.dtype(), view.shape().to_vec());
        let tensor = if is_float(dtype) {
            let values = floats_of(dtype, view.data());
            let count = values.len();
            Tensor::new(shape, values).ok_or_else(|| {
                let expected = format!("as many as shape {:?} has", view.shape());
                FormatError::tensor(name, "values", expected, count.to_string())
            })?
        } else {
            Tensor::other(shape, format!("{dtype:?}"))
        };
        tensors.insert(name.to_owned(), tensor);
    }
    let metadata = header.metadata().iter().flatten().map(|(k, v)| (k.clone(), v.clone())).collect();
    Ok((tensors, metadata))
}

/// Visits a header and refuses a second tensor with the same name.
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

/// Named arrays and metadata that become one safetensors file.
#[derive(Clone, Debug, Default)]
pub struct TensorFile {
    arrays: Vec<Array>,
    metadata: BTreeMap<String, String>,
}

#[derive(Clone, Debug)]
struct Array {
    name: String,
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

/// An entry of the header: the metadata or an array.
#[derive(Serialize)]
#[serde(untagged)]
enum Entry<'a> {
    Metadata(&'a BTreeMap<String, String>),
    Array { dtype: Dtype, shape: &'a [usize], data_offsets: [usize; 2] },
}

impl TensorFile {
    /// A file without arrays and with this metadata.
    pub fn new(metadata: BTreeMap<String, String>) -> Self {
        Self { arrays: Vec::new(), metadata }
    }

    /// Adds an array of F32, row-major.
    ///
    /// # Panics
    /// If `shape` has another number of values, or the file has an array `name` already.
    pub fn f32(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        self.add(name, Dtype::F32, shape, floats::to_f32(values));
    }

    /// Adds an array of F16 if it can represent all `values` exactly, otherwise of F32, with the
    /// panics of [`Self::f32`].
    pub fn floats(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        match floats::to_f16(values) {
            Some(halves) => self.add(name, Dtype::F16, shape, halves),
            None => self.f32(name, shape, values),
        }
    }

    /// Adds an array of I32, row-major, with the panics of [`Self::f32`].
    pub fn i32(&mut self, name: &str, shape: &[usize], values: &[i32]) {
        self.add(name, Dtype::I32, shape, values.iter().copied().flat_map(i32::to_le_bytes).collect());
    }

    /// Adds an array of I64, row-major, with the panics of [`Self::f32`].
    pub fn i64(&mut self, name: &str, shape: &[usize], values: &[i64]) {
        self.add(name, Dtype::I64, shape, values.iter().copied().flat_map(i64::to_le_bytes).collect());
    }

    /// Adds an array of U8, row-major, with the panics of [`Self::f32`].
    pub fn u8(&mut self, name: &str, shape: &[usize], values: &[u8]) {
        self.add(name, Dtype::U8, shape, values.to_owned());
    }

    fn add(&mut self, name: &str, dtype: Dtype, shape: &[usize], bytes: Vec<u8>) {
        let expected = shape.iter().fold(dtype.bitsize() / 8, |bytes, &side| bytes.saturating_mul(side));
        assert_eq!(bytes.len(), expected, "{name}: bytes of shape {shape:?}");
        assert!(self.arrays.iter().all(|array| array.name != name), "{name}: one array of a name");
        self.arrays.push(Array { name: name.to_owned(), dtype, shape: shape.to_owned(), bytes });
    }

    /// The bytes of the file; equal contents give equal bytes.
    ///
    /// # Panics
    /// Never: names, numbers and strings always serialise.
    pub fn into_bytes(mut self) -> Vec<u8> {
        let order = |array: &Array| (Reverse(array.dtype.bitsize()), array.name.clone());
        self.arrays.sort_by_cached_key(order);
        let mut header = BTreeMap::new();
        let mut end = 0;
        for array in &self.arrays {
            let data_offsets = [end, end + array.bytes.len()];
            end = data_offsets[1];
            let entry = Entry::Array { dtype: array.dtype, shape: &array.shape, data_offsets };
            header.insert(array.name.as_str(), entry);
        }
        if !self.metadata.is_empty() {
            header.insert("__metadata__", Entry::Metadata(&self.metadata));
        }
        let mut header = serde_json::to_vec(&header).expect("names, numbers and strings always serialise");
        // Values start at a multiple of 8, which readers that map the file rely on.
        header.resize(header.len().next_multiple_of(8), b' ');
        let mut bytes = Vec::with_capacity(8 + header.len() + end);
        bytes.extend((header.len() as u64).to_le_bytes());
        bytes.extend(header);
        self.arrays.iter().for_each(|array| bytes.extend(&array.bytes));
        bytes
    }
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
    /// Values that no network reads: only their type is kept.
    Other(String),
}

impl Tensor {
    /// A tensor of `shape` in row-major order; `None` if `shape` has another number of values.
    pub fn new(shape: Vec<usize>, values: Vec<f32>) -> Option<Self> {
        let count = shape.iter().try_fold(1usize, |n, &d| n.checked_mul(d))?;
        (count == values.len()).then_some(Self { shape, values: Values::Float(values) })
    }

    /// A tensor whose values no network reads, with the name of their type.
    pub(super) fn other(shape: Vec<usize>, dtype: impl Into<String>) -> Self {
        Self { shape, values: Values::Other(dtype.into()) }
    }

    /// Its shape.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Its values in row-major order; `None` if they are not floating-point numbers.
    pub fn values(&self) -> Option<&[f32]> {
        match &self.values {
            Values::Float(values) => Some(values),
            Values::Other(_) => None,
        }
    }

    /// Type of its values: "F32" for every floating-point type, else the file's name for it.
    pub fn dtype(&self) -> &str {
        match &self.values {
            Values::Float(_) => "F32",
            Values::Other(dtype) => dtype,
        }
    }
}

pub(super) fn is_float(dtype: Dtype) -> bool {
    matches!(dtype, Dtype::F16 | Dtype::BF16 | Dtype::F32 | Dtype::F64)
}

/// All values of a floating-point type, little-endian.
fn floats_of(dtype: Dtype, bytes: &[u8]) -> Vec<f32> {
    match dtype {
        Dtype::F16 => floats::from_f16(bytes),
        Dtype::F32 => floats::from_f32(bytes),
        _ => (0..bytes.len() / (dtype.bitsize() / 8)).filter_map(|i| float(dtype, bytes, i)).collect(),
    }
}

/// Little-endian value `index` of a floating-point type; `None` past the end and for other types.
pub(crate) fn float(dtype: Dtype, bytes: &[u8], index: usize) -> Option<f32> {
    let size = dtype.bitsize() / 8;
    let bytes = bytes.get(index.checked_mul(size)?..)?.get(..size)?;
    Some(match dtype {
        Dtype::F16 => floats::f16_to_f32(u16::from_le_bytes(bytes.try_into().ok()?)),
        Dtype::BF16 => f32::from_bits(u32::from(u16::from_le_bytes(bytes.try_into().ok()?)) << 16),
        Dtype::F32 => f32::from_le_bytes(bytes.try_into().ok()?),
        Dtype::F64 => f64::from_le_bytes(bytes.try_into().ok()?) as f32,
        _ => return None,
    })
}
