//! The folder of golden files and recordings beside the project, which may be absent.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use meissner_models::FrameDescription;
use safetensors::{Dtype, SafeTensors};

pub use files::{find_shared, shared};

#[path = "../shared_files.rs"]
mod files;

/// The description of the network of the golden file `pointnet`.
pub const POINTNET: &str = include_str!("../pointnet.toml");

/// The tensors of a golden file.
#[derive(Clone, Debug)]
pub struct Golden {
    floats: BTreeMap<String, (Vec<usize>, Vec<f32>)>,
    integers: BTreeMap<String, (Vec<usize>, Vec<i64>)>,
}

impl Golden {
    /// Reads a golden file.
    ///
    /// # Panics
    /// If it does not exist, or not as described.
    pub fn load(name: &str) -> Self {
        let bytes = std::fs::read(Self::path(name)).expect("a readable file");
        let file = SafeTensors::deserialize(&bytes).expect("a safetensors file");
        let (mut floats, mut integers) = (BTreeMap::new(), BTreeMap::new());
        for (name, tensor) in file.tensors() {
            let (shape, data) = (tensor.shape().to_vec(), tensor.data());
            if tensor.dtype() == Dtype::I64 {
                let values = data.chunks_exact(8).map(|b| i64::from_le_bytes(b.try_into().expect("8 bytes")));
                integers.insert(name, (shape, values.collect()));
            } else if tensor.dtype() == Dtype::U8 {
                floats.insert(name, (shape, data.iter().map(|&count| f32::from(count)).collect()));
            } else {
                assert_eq!(tensor.dtype(), Dtype::F32, "{name}");
                let values = data.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("4 bytes")));
                floats.insert(name, (shape, values.collect()));
            }
        }
        Self { floats, integers }
    }

    /// The file of a golden file: files with small graphs and images, whose names end with
    /// `_small`, are in `tests/golden`, the others in `../shared/golden`.
    pub fn path(name: &str) -> PathBuf {
        if Self::is_small(name) {
            return Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("golden/{name}.safetensors"));
        }
        shared(&format!("golden/{name}.safetensors"))
    }

    /// Whether a golden file comes with the project. If it contains no weights, its answers are for
    /// the shipped weights.
    pub fn is_small(name: &str) -> bool {
        name.ends_with("_small")
    }

    /// The available files among `names`: all if there is `../shared`, else the small ones.
    pub fn at_hand<'a>(names: &[&'a str]) -> Vec<(&'a str, Self)> {
        let at_hand = names.iter().filter(|name| Self::is_small(name) || !cfg!(no_shared));
        at_hand.map(|&name| (name, Self::load(name))).collect()
    }

    /// Shape and values of a float tensor, if the file has it.
    pub fn find(&self, name: &str) -> Option<(&[usize], &[f32])> {
        self.floats.get(name).map(|(shape, values)| (&shape[..], &values[..]))
    }

    /// Values of a float tensor.
    ///
    /// # Panics
    /// If the file has none of that name.
    pub fn floats(&self, name: &str) -> &[f32] {
        self.find(name).unwrap_or_else(|| panic!("no tensor {name}")).1
    }

    /// Shape of a float tensor.
    ///
    /// # Panics
    /// If the file has none of that name.
    pub fn shape(&self, name: &str) -> &[usize] {
        self.find(name).unwrap_or_else(|| panic!("no tensor {name}")).0
    }

    /// Values of an integer tensor.
    ///
    /// # Panics
    /// If the file has none of that name.
    pub fn integers(&self, name: &str) -> &[i64] {
        &self.integers.get(name).unwrap_or_else(|| panic!("no tensor {name}")).1
    }

    /// Sources and readers of an edge list.
    pub fn edges(&self, name: &str) -> Vec<(usize, usize)> {
        let flat = self.integers(name);
        let (sources, readers) = flat.split_at(flat.len() / 2);
        sources.iter().zip(readers).map(|(&j, &i)| (j as usize, i as usize)).collect()
    }

    /// Names of float tensors.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.floats.keys().map(String::as_str)
    }
}

/// A shipped description of a frame network, with images of another size if `size` is given.
///
/// # Panics
/// If there is none of that name, or `size` is given for a network whose frames are not images.
pub fn frame_description(name: &str, size: Option<[usize; 2]>) -> FrameDescription {
    let path = format!("{}/../models/networks/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let mut text = std::fs::read_to_string(path).expect("a shipped description");
    if let Some([height, width]) = size {
        for (key, value) in [("height", height), ("width", width)] {
            let line = text.lines().find(|line| line.starts_with(&format!("{key} = "))).expect("an image");
            text = text.replacen(&line.to_owned(), &format!("{key} = {value}"), 1);
        }
    }
    FrameDescription::parse(&text).expect("consistent")
}

/// Asserts that `got` is within `tolerance` of `expected`, relative to its largest magnitude.
///
/// # Panics
/// If it is not.
pub fn assert_close(what: &str, got: &[f32], expected: &[f32], tolerance: f32) {
    assert_eq!(got.len(), expected.len(), "{what}: number of values");
    let largest = expected.iter().fold(0.0f32, |m, v| m.max(v.abs()));
    let error = got.iter().zip(expected).fold(0.0f32, |m, (a, b)| m.max((a - b).abs()));
    assert!(error <= tolerance * largest, "{what}: error {error:e}, largest value {largest:e}");
}
