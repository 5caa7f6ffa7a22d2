//! The card of weights: the metadata on which a run depends.
//!
//! Input: `__metadata__` of safetensors; a `PyTorch` state dict has none. Output: a [`Card`].
//!
//! | key | meaning |
//! |---|---|
//! | `trained` | by default, `generator` says no; `trained_on`, `held_out` or `recipe` say yes |
//! | `about` | one line for reports |
//! | `preparation` | of the training's input: [`crate::Description::preparation`] |
//! | `stride` | the network was trained on every `stride`-th event; default: 1 |
//! | `sensor` | `[columns, rows]` of the recordings of the training |
//! | `ranges` | `[low, high]` of each output's training labels: `[[-0.15, 0.15], [0, 2]]` |
//! | `training_windows` | `[mean, factor]`, the [parts](TrainingWindows::parts) of these windows |
//! | | over frames `["image", mean, factor]` or `["values", mean, factor, places]` |

use std::hash::Hasher;

use fnv::FnvHasher;
use meissner_engine::frames::{FrameFeatures, FrameShape, TrainingFrames};
use meissner_engine::{Sensor, TrainingWindows};
use serde::Deserialize;

use super::Weights;
use crate::ModelError;

/// The key of the statistics of the training's windows or frames, and the kinds of features of
/// frames.
const TRAINING: &str = "training_windows";
const IMAGE: &str = "image";
const VALUES: &str = "values";
/// The value of `generator` in weights that [`draw`](crate::draw()) made.
pub(crate) const DRAWN_BY: &str = "meissner_models::draw";
/// Last layer of the published checkpoint of the contact-angle network.
const PUBLISHED_TENSOR: &str = "fc.weight";
const PUBLISHED_VALUES: usize = 1024;
/// FNV-1a with 64 bits of the bytes of these values.
const PUBLISHED_DIGEST: u64 = 0xd37f_dd17_d69b_3d94;
/// Largest roll and pitch of its training in radians: 9 degrees.
const PUBLISHED_TILT: f64 = 0.15708;
/// The remark of the published checkpoint in reports.
const PUBLISHED_ABOUT: &str = "the published GraphRes checkpoint";

/// The metadata of weights on which a run depends.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Card {
    /// Whether they were trained; `Some(false)` if drawn from a seed, `None` if unknown.
    pub trained: Option<bool>,
    /// Their remark in one line.
    pub about: Option<String>,
    /// The preparation of the input of their training, as JSON; `None` if the metadata contain
    /// none.
    pub preparation: Option<String>,
    /// The network was trained on every `stride`-th event; at least 1.
    pub stride: usize,
    /// Sensor of the recordings of their training.
    pub sensor: Option<Sensor>,
    /// Lowest and highest label of the training, for each output in its unit.
    pub ranges: Option<Vec<[f64; 2]>>,
    /// Statistics of the windows of their training, for a network over events.
    pub training_windows: Option<TrainingWindows>,
    /// Statistics of the frames of their training, for a frame network.
    pub training_frames: Option<TrainingFrames>,
    /// Whether they are those of the published contact-angle checkpoint, which has no metadata.
    pub published: bool,
}

impl Weights {
    /// The card; the published contact-angle checkpoint is recognised by its values.
    ///
    /// # Errors
    /// [`ModelError::Metadata`] for an invalid `stride`, `sensor`, `ranges`, `training_windows` or
    /// `trained`.
    pub fn card(&self) -> Result<Card, ModelError> {
        let published = self.is_published();
        let about = self.metadata().get("about").cloned();
        let expected =
            "[mean, factor] of features of the training's windows, or with their kind of its frames";
        let (training_windows, training_frames) = match self.remark(TRAINING, expected, Stated::read)? {
            Some(Stated::Windows(windows)) => (Some(windows), None),
            Some(Stated::Frames(frames)) => (None, Some(frames)),
            None => (None, None),
        };
        Ok(Card {
            trained: if published { Some(true) } else { self.trained()? },
            about: about.or_else(|| published.then(|| PUBLISHED_ABOUT.to_owned())),
            preparation: self.metadata().get("preparation").cloned(),
            stride: self.remark("stride", "a whole number from 1", stride)?.unwrap_or(1),
            sensor: self.remark("sensor", "[columns, rows] of 1 to 65535 pixels", sensor)?,
            ranges: self
                .remark("ranges", "a list with [low, high] of each output, low below high", ranges)?
                .or_else(|| published.then(|| vec![[-PUBLISHED_TILT, PUBLISHED_TILT]; 2])),
            training_windows,
            training_frames,
            published,
        })
    }

    /// Statistics of the windows of their training, from the metadata, for a network over events.
    pub(crate) fn training_windows(&self) -> Result<Option<TrainingWindows>, ModelError> {
        let expected = "[mean, factor] of nine features of the training's windows";
        self.remark(TRAINING, expected, |text| Stated::read(text)?.windows())
    }

    /// Statistics of the frames of their training, for a network whose frames have this shape.
    pub(crate) fn training_frames(&self, shape: FrameShape) -> Result<Option<TrainingFrames>, ModelError> {
        let expected = "[\"image\" or \"values\", mean, factor] of features that such frames have";
        let of_shape = |text: &str| Stated::read(text)?.frames().filter(|frames| frames.fits(shape));
        self.remark(TRAINING, expected, of_shape)
    }

    pub(crate) fn is_published(&self) -> bool {
        let last = self.iter().filter(|(name, _)| name.ends_with(PUBLISHED_TENSOR));
        last.filter_map(|(_, tensor)| tensor.values()).any(|values| {
            values.len() == PUBLISHED_VALUES && {
                let mut digest = FnvHasher::default();
                values.iter().for_each(|value| digest.write(&value.to_le_bytes()));
                digest.finish() == PUBLISHED_DIGEST
            }
        })
    }

    fn trained(&self) -> Result<Option<bool>, ModelError> {
        let metadata = self.metadata();
        if let Some(trained) = self.remark("trained", "true or false", |text| text.parse().ok())? {
            return Ok(Some(trained));
        }
        if self.is_drawn() {
            return Ok(Some(false));
        }
        let says = |key: &&str| metadata.contains_key(*key);
        Ok(["trained_on", "held_out", "recipe"].iter().any(says).then_some(true))
    }

    pub(crate) fn is_drawn(&self) -> bool {
        self.metadata().get("generator").is_some_and(|generator| generator == DRAWN_BY)
    }

    /// The value of `key`, parsed by `read`, if the key exists.
    fn remark<T>(
        &self,
        key: &'static str,
        expected: &'static str,
        read: impl FnOnce(&str) -> Option<T>,
    ) -> Result<Option<T>, ModelError> {
        let Some(text) = self.metadata().get(key) else { return Ok(None) };
        let refused = || ModelError::Metadata { key, expected, found: text.chars().take(60).collect() };
        read(text).map(Some).ok_or_else(refused)
    }
}

fn stride(text: &str) -> Option<usize> {
    text.parse().ok().filter(|&stride| stride > 0)
}

fn sensor(text: &str) -> Option<Sensor> {
    let [width, height]: [u16; 2] = serde_json::from_str(text).ok()?;
    (width > 0 && height > 0).then(|| Sensor::new(width, height))
}

/// The content of the value of the key `training_windows`.
enum Stated {
    Windows(TrainingWindows),
    Frames(TrainingFrames),
}

/// The forms of that value.
#[derive(Deserialize)]
#[serde(untagged)]
enum Form {
    Windows(Vec<f64>, Vec<Vec<f64>>),
    Image(String, Vec<f64>, Vec<Vec<f64>>),
    Values(String, Vec<f64>, Vec<Vec<f64>>, Vec<usize>),
}

impl Stated {
    fn read(text: &str) -> Option<Self> {
        match serde_json::from_str(text).ok()? {
            Form::Windows(mean, factor) => TrainingWindows::from_parts(&mean, factor).map(Self::Windows),
            Form::Image(kind, mean, factor) if kind == IMAGE => {
                TrainingFrames::from_parts(FrameFeatures::Image, &mean, factor).map(Self::Frames)
            }
            Form::Values(kind, mean, factor, places) if kind == VALUES => {
                TrainingFrames::from_parts(FrameFeatures::Values(places), &mean, factor).map(Self::Frames)
            }
            Form::Image(..) | Form::Values(..) => None,
        }
    }

    fn windows(self) -> Option<TrainingWindows> {
        if let Self::Windows(windows) = self { Some(windows) } else { None }
    }

    fn frames(self) -> Option<TrainingFrames> {
        if let Self::Frames(frames) = self { Some(frames) } else { None }
    }
}

/// `windows` as the value of the key `training_windows`, in f32: about 500 bytes.
pub fn windows_text(windows: &TrainingWindows) -> String {
    format!("[{}]", parts_text(windows.parts()))
}

/// `frames` as the value of the key `training_windows`, in f32: about 11 bytes for each pair of
/// features.
pub fn frames_text(frames: &TrainingFrames) -> String {
    let (of, mean, factor) = frames.parts();
    let parts = parts_text((mean, factor));
    match of {
        FrameFeatures::Image => format!("[{IMAGE:?}, {parts}]"),
        FrameFeatures::Values(places) => format!("[{VALUES:?}, {parts}, {places:?}]"),
    }
}

fn parts_text((mean, factor): (&[f64], &[Vec<f64>])) -> String {
    let rounded = |row: &[f64]| row.iter().map(|&value| value as f32).collect::<Vec<_>>();
    let factor: Vec<Vec<f32>> = factor.iter().map(|row| rounded(row)).collect();
    format!("{:?}, {factor:?}", rounded(mean))
}

fn ranges(text: &str) -> Option<Vec<[f64; 2]>> {
    let ranges: Vec<[f64; 2]> = serde_json::from_str(text).ok()?;
    ranges.iter().all(|[low, high]| low < high).then_some(ranges)
}
