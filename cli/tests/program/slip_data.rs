//! A small data set of slips, trainings of networks over it, and what a network makes of it by the
//! engine alone.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use meissner_engine::representations::{Sampling, Scaling, TactileForm, TactileWindow};
use meissner_models::{FrameDescription, Weights, draw};
use tempfile::TempDir;

use crate::frames::{engine, predicted};

pub(crate) const CLASSES: [&str; 7] = ["aw", "cw", "e", "n", "s", "t", "w"];
/// An object of each set, with the number and the rows of its recording in each class; sorted by
/// name.
pub(crate) const OBJECTS: [(&str, usize, usize); 4] =
    [("bottle", 2, 12), ("brush", 3, 10), ("case", 1, 16), ("strippes", 10, 5)];
/// Windows of 5 readings of each of [`OBJECTS`], in each class.
pub(crate) const WINDOWS: [usize; 4] = [2, 2, 3, 1];

/// A folder of recordings.
pub(crate) struct SlipFolder(TempDir);

impl SlipFolder {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().expect("there is a place for temporary files");
        for (class, class_name) in CLASSES.iter().enumerate() {
            fs::create_dir(folder.path().join(class_name)).expect("a folder can be made");
            for (object, &(name, number, _)) in OBJECTS.iter().enumerate() {
                let file = folder.path().join(format!("{class_name}/{name}{number}.csv"));
                fs::write(file, csv(&readings(class, object))).expect("a temporary file can be written");
            }
        }
        Self(folder)
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }
}

pub(crate) fn readings(class: usize, object: usize) -> Vec<[f32; 24]> {
    let value = |row: usize, electrode: usize| {
        (2000 + (class * 389 + object * 131 + row * (class + 3) * 41 + electrode * electrode * 17) % 1500)
            as f32
    };
    (0..OBJECTS[object].2).map(|row| std::array::from_fn(|electrode| value(row, electrode))).collect()
}

pub(crate) fn csv(readings: &[[f32; 24]]) -> String {
    let header = (1..=24).map(|e| format!("ff_e{e}")).collect::<Vec<_>>().join(",");
    let row = |reading: &[f32; 24]| reading.map(|value| value.to_string()).join(",");
    [header].into_iter().chain(readings.iter().map(row)).collect::<Vec<_>>().join("\n") + "\n"
}

/// The weights of a network, drawn from `seed`.
pub(crate) fn drawn(network: &str, seed: u64) -> Weights {
    draw(&FrameDescription::shipped(network).expect("it is shipped"), seed)
}

/// Writes `weights` with `metadata` to `folder`.
pub(crate) fn training(folder: &Path, name: &str, weights: &Weights, metadata: &[(&str, &str)]) -> PathBuf {
    let metadata: BTreeMap<String, String> =
        metadata.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
    let path = folder.join(name);
    fs::write(&path, weights.to_safetensors(&metadata)).expect("a temporary file can be written");
    path
}

/// Bits of the outputs for each window of each recording, in order, computed one after the other.
pub(crate) fn outputs(network: &str, weights: &Weights) -> Vec<Vec<Vec<u32>>> {
    let description = FrameDescription::shipped(network).expect("it is shipped");
    let (scaling, form) = match network {
        "slip-lstm" => (Scaling::PerReading, TactileForm::Reading),
        _ => (Scaling::PerImage, TactileForm::Image),
    };
    let mut engine = engine(&description, weights);
    let mut recordings = Vec::new();
    for class in 0..CLASSES.len() {
        for object in 0..OBJECTS.len() {
            let mut window = TactileWindow::new(5, Sampling::Consecutive, scaling, form).expect("it can be");
            let mut windows = Vec::new();
            for reading in readings(class, object) {
                let Some(sequence) = window.push(&reading).expect("finite") else { continue };
                engine.reset();
                let frames = sequence.values.chunks_exact(sequence.values.len() / 5);
                frames.for_each(|frame| engine.push(frame).expect("a frame"));
                windows.push(predicted(&mut engine));
            }
            recordings.push(windows);
        }
    }
    recordings
}

/// The class that these bits predict.
pub(crate) fn class(bits: &[u32]) -> usize {
    let values: Vec<f32> = bits.iter().map(|&bits| f32::from_bits(bits)).collect();
    let most = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    values.iter().position(|&value| value == most).expect("one is the largest")
}
