//! A safetensors file of named arrays: written here, so that equal contents give equal bytes (the crate orders metadata by
//! a random hash).
//!
//! Enters: arrays and remarks. Leaves: header length, header, values. Values of wider types come first, then by name, so
//! that every array starts at a multiple of its values' size.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use serde::Serialize;

/// Arrays with names, and remarks, to be written as one safetensors file.
#[derive(Clone, Debug, Default)]
pub struct TensorFile {
    arrays: Vec<Array>,
    metadata: BTreeMap<String, String>,
}

#[derive(Clone, Debug)]
struct Array {
    name: String,
    kind: Kind,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

/// Type of values.
#[derive(Clone, Copy, Debug)]
enum Kind {
    F32,
    I32,
    I64,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::F32 => "F32",
            Self::I32 => "I32",
            Self::I64 => "I64",
        }
    }

    fn size(self) -> usize {
        match self {
            Self::F32 | Self::I32 => 4,
            Self::I64 => 8,
        }
    }
}

/// An array in the header.
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
    Array(Info<'a>),
}

impl TensorFile {
    /// A file without arrays and with these remarks.
    pub fn new(metadata: BTreeMap<String, String>) -> Self {
        Self { arrays: Vec::new(), metadata }
    }

    /// Adds an array of F32, row-major.
    ///
    /// # Panics
    /// Where `shape` says another number of values, or `name` is there already.
    pub fn f32(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.add(name, Kind::F32, shape, bytes);
    }

    /// Adds an array of I32, row-major.
    ///
    /// # Panics
    /// As [`Self::f32`].
    pub fn i32(&mut self, name: &str, shape: &[usize], values: &[i32]) {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.add(name, Kind::I32, shape, bytes);
    }

    /// Adds an array of I64, row-major.
    ///
    /// # Panics
    /// As [`Self::f32`].
    pub fn i64(&mut self, name: &str, shape: &[usize], values: &[i64]) {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.add(name, Kind::I64, shape, bytes);
    }

    fn add(&mut self, name: &str, kind: Kind, shape: &[usize], bytes: Vec<u8>) {
        // A product that saturates is the length of nothing.
        let expected = shape.iter().fold(kind.size(), |bytes, &side| bytes.saturating_mul(side));
        assert_eq!(bytes.len(), expected, "{name}: bytes of shape {shape:?}");
        assert!(self.arrays.iter().all(|array| array.name != name), "{name}: one array of a name");
        self.arrays.push(Array { name: name.to_owned(), kind, shape: shape.to_owned(), bytes });
    }

    /// The bytes of the file; equal contents give equal bytes.
    ///
    /// # Panics
    /// Never: names, numbers and strings always serialise.
    pub fn into_bytes(mut self) -> Vec<u8> {
        self.arrays.sort_by(|a, b| (Reverse(a.kind.size()), &a.name).cmp(&(Reverse(b.kind.size()), &b.name)));
        let mut header = BTreeMap::new();
        let mut end = 0;
        for array in &self.arrays {
            let data_offsets = [end, end + array.bytes.len()];
            end = data_offsets[1];
            let info = Info { dtype: array.kind.name(), shape: &array.shape, data_offsets };
            header.insert(array.name.as_str(), Entry::Array(info));
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

#[cfg(test)]
mod tests {
    use safetensors::{Dtype, SafeTensors};

    use super::TensorFile;

    fn file(order: [usize; 3]) -> Vec<u8> {
        let remark = [("of".to_owned(), "a \"test\"".to_owned())];
        let mut file = TensorFile::new(remark.into());
        for which in order {
            match which {
                0 => file.f32("a", &[1, 3], &[1.0, -2.0, 0.5]),
                1 => file.i64("b", &[2], &[-1, 1 << 40]),
                _ => file.f32("c", &[0, 4], &[]),
            }
        }
        file.into_bytes()
    }

    #[test]
    fn a_file_holds_what_was_added_whatever_the_order() {
        let bytes = file([0, 1, 2]);
        assert_eq!(bytes, file([2, 1, 0]));
        let read = SafeTensors::deserialize(&bytes).expect("a valid file");
        let integers = read.tensor("b").expect("there");
        assert_eq!((integers.dtype(), integers.shape()), (Dtype::I64, &[2][..]));
        assert_eq!(integers.data(), [(-1_i64).to_le_bytes(), (1_i64 << 40).to_le_bytes()].concat());
        assert_eq!(
            read.tensor("a").expect("there").data(),
            [1.0_f32, -2.0, 0.5].map(f32::to_le_bytes).concat()
        );
        assert_eq!(read.tensor("c").expect("there").shape(), [0, 4]);
        let (_, header) = SafeTensors::read_metadata(&bytes).expect("a valid header");
        assert_eq!(
            header.metadata().as_ref().and_then(|m| m.get("of")).map(String::as_str),
            Some("a \"test\"")
        );
    }

    #[test]
    fn arrays_start_at_multiples_of_their_values_size() {
        let bytes = file([0, 1, 2]);
        let start = 8 + u64::from_le_bytes(bytes[..8].try_into().expect("8 bytes")) as usize;
        assert!(start.is_multiple_of(8));
        assert_eq!(bytes[start..][..8], (-1_i64).to_le_bytes(), "the integers come first");
    }

    #[test]
    #[should_panic(expected = "bytes of shape")]
    fn an_array_has_as_many_values_as_its_shape() {
        TensorFile::default().f32("a", &[2, 2], &[0.0; 3]);
    }
}
