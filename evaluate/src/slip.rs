//! Direction of slip from 24 electrodes: the data set, its windows, and the trainings of its networks.
//!
//! [`evaluate`] judges networks on seen and unseen objects.

mod judge;

use std::path::Path;

use meissner_engine::EngineError;
use meissner_engine::frames::FrameEngine;
use meissner_io::Reading;
use meissner_io::datasets::{BadRows, SlipDataset, SlipRecording};
use meissner_models::FrameDescription;
use meissner_models::systems::slip::{CLASSES, Object, ObjectSet, SlipWindows};
use meissner_pipeline::model::describe_frames;
use meissner_pipeline::text::grouped;
use rayon::ThreadPool;
use serde::Serialize;

use crate::error::{EvaluateError, TrainingError};
use crate::trainings::{Metadata, Task};
use crate::workers;
pub use judge::{
    DataReport, Judged, JudgedSeed, NetworkReport, ReferenceReport, Report, SetReport, ValidationReport,
    evaluate,
};

/// The task of the direction of slip.
#[derive(Clone, Copy, Debug)]
pub struct Slip;

/// A network that predicts the direction of slip, with its trainings.
pub type Candidate = crate::trainings::Candidate<Slip>;
/// A training of a network for the direction of slip.
pub type Training = crate::trainings::Training<HeldOut>;

/// How a cross-validation splits its windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Scheme {
    /// All windows of a recording are in one fold.
    Recordings,
    /// Windows of one recording are in different folds.
    Windows,
}

/// The part of the set Basic that a fold held out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HeldOut {
    /// Recordings.
    Recordings(Vec<String>),
    /// Windows, each with its recording.
    Windows(Vec<(String, usize)>),
}

impl HeldOut {
    /// The scheme of its cross-validation.
    pub fn scheme(&self) -> Scheme {
        match self {
            Self::Recordings(_) => Scheme::Recordings,
            Self::Windows(_) => Scheme::Windows,
        }
    }
}

/// Whether weights with these metadata were trained on the set Basic.
pub(crate) fn trained_on_basic(metadata: Metadata<'_>) -> bool {
    metadata.0.get("trained_on").is_some_and(|set| set == ObjectSet::Basic.name())
}

impl Task for Slip {
    type Description = FrameDescription;
    type HeldOut = HeldOut;
    const PREFIX: &'static str = "slip-";

    fn describe(network: &str) -> Result<(FrameDescription, bool), EvaluateError> {
        let (description, shipped) = describe_frames(network)?;
        SlipWindows::new(&description)?;
        Ok((description, shipped))
    }

    fn name(description: &FrameDescription) -> &str {
        description.name()
    }

    /// The part that a fold held out. All trainings must be on the set Basic.
    fn held_out(metadata: Metadata<'_>) -> Result<Option<HeldOut>, TrainingError> {
        if !trained_on_basic(metadata) {
            let expected = "\"Basic\", so that the other sets are unseen,";
            return Err(metadata.refused("trained_on", expected));
        }
        let has = |key: &str| metadata.0.contains_key(key);
        let scheme = match metadata.0.get("scheme").map(String::as_str) {
            Some("recordings") => Scheme::Recordings,
            Some("windows") => Scheme::Windows,
            None if has("held_out") && !has("held_out_windows") => Scheme::Recordings,
            None if has("held_out_windows") && !has("held_out") => Scheme::Windows,
            None if !has("held_out_windows") => return Ok(None),
            _ => return Err(metadata.refused("scheme", "\"recordings\" or \"windows\"")),
        };
        let held_out = match scheme {
            Scheme::Recordings => {
                let expected = "with a JSON list of recordings, such as [\"n/pen178\"]";
                HeldOut::Recordings(metadata.list("held_out", expected)?)
            }
            Scheme::Windows => {
                let expected = "with a JSON list of windows, such as [[\"n/pen178\", 0]]";
                HeldOut::Windows(metadata.list("held_out_windows", expected)?)
            }
        };
        Ok(Some(held_out))
    }
}

/// The recordings of a data set with their objects.
#[derive(Debug)]
pub struct SlipData {
    /// The recordings by class, and by file name in natural order.
    pub recordings: Vec<SlipRecording>,
    /// The object of each recording.
    pub objects: Vec<Object>,
    /// Remarks about the data, for people.
    pub notes: Vec<String>,
}

impl SlipData {
    /// Reads the data set in `folder`.
    ///
    /// # Errors
    /// The folder has another layout, a recording cannot be read, or its object is unknown.
    pub fn read(folder: &Path) -> Result<Self, EvaluateError> {
        let SlipDataset { recordings, passed_over } = SlipDataset::read(folder, &CLASSES, BadRows::Refuse)?;
        let objects = recordings.iter().map(|recording| Object::of(&recording.name, &recording.object));
        let objects = objects.collect::<Result<Vec<_>, _>>()?;
        let mut notes = Vec::new();
        for (recording, object) in recordings.iter().zip(&objects).filter(|(_, object)| object.misspelt) {
            notes.push(format!(
                "{}: {:?} is misspelt and counts as {:?}",
                recording.name, recording.object, object.name
            ));
        }
        let outside: u64 = recordings.iter().map(|recording| recording.warnings.values_out_of_range).sum();
        if outside > 0 {
            notes.push(format!("{} values beyond what the sensor gives (0 to 4095)", grouped(outside)));
        }
        if let [first, ..] = &passed_over[..] {
            let (count, first) = (grouped(passed_over.len() as u64), first.display());
            notes.push(format!("{count} files are no recordings and are passed over, the first {first}"));
        }
        Ok(Self { recordings, objects, notes })
    }

    /// Appends the windows of recording `index` to `frames`, (windows, steps, frame), and their readings to `readings`,
    /// (windows, steps, 24). Returns the number of windows.
    pub(crate) fn cut(
        &self,
        index: usize,
        windows: &mut SlipWindows,
        frames: &mut Vec<f32>,
        mut readings: Option<&mut Vec<f32>>,
    ) -> Result<usize, EvaluateError> {
        let recording = &self.recordings[index];
        let mut count = 0;
        for stretch in recording.stretches() {
            let cut = windows.cut(stretch.iter().map(|reading| &reading.values), frames);
            count += cut.map_err(|source| {
                let recording = recording.name.clone();
                EvaluateError::SlipRecording { recording, source }
            })?;
            if let Some(readings) = readings.as_deref_mut() {
                let whole = stretch.len() / windows.steps() * windows.steps();
                stretch[..whole].iter().for_each(|Reading { values, .. }| readings.extend(values));
            }
        }
        Ok(count)
    }
}

/// The windows of all recordings as one network reads them.
#[derive(Clone, Debug)]
pub struct Windows {
    /// For each recording (windows, steps, frame).
    frames: Vec<Vec<f32>>,
    /// Number of windows of each recording.
    pub counts: Vec<usize>,
    /// Number of values of a window, and of a frame.
    lengths: (usize, usize),
}

impl Windows {
    /// The windows of `data` as `description` reads them.
    ///
    /// # Errors
    /// The network does not read electrodes, or a reading cannot be scaled.
    pub fn cut(data: &SlipData, description: &FrameDescription) -> Result<Self, EvaluateError> {
        let mut windows = SlipWindows::new(description)?;
        let lengths = (windows.steps() * windows.frame_len(), windows.frame_len());
        let mut cut = Self { frames: Vec::new(), counts: Vec::new(), lengths };
        for index in 0..data.recordings.len() {
            let mut frames = Vec::new();
            cut.counts.push(data.cut(index, &mut windows, &mut frames, None)?);
            cut.frames.push(frames);
        }
        Ok(cut)
    }

    /// Indices of all windows, by recording.
    pub fn all(&self) -> Vec<Vec<usize>> {
        self.counts.iter().map(|&count| (0..count).collect()).collect()
    }

    /// Number of frames of a window.
    pub fn steps(&self) -> usize {
        self.lengths.0 / self.lengths.1
    }

    /// The last `steps` frames of a window.
    ///
    /// # Panics
    /// Where there is no such recording or window, or it has fewer frames.
    pub fn frames(&self, recording: usize, window: usize, steps: usize) -> impl Iterator<Item = &[f32]> {
        let (window_len, frame_len) = self.lengths;
        let frames = &self.frames[recording][window * window_len..][..window_len];
        frames[window_len - steps * frame_len..].chunks_exact(frame_len)
    }

    /// The outputs of `engine` for the windows `chosen` of each recording, (windows, 7), each from its last `steps` frames.
    /// Every window starts from a reset, so the number of threads of `pool` changes no bit.
    ///
    /// # Errors
    /// The first error of the engine, in the order of the recordings.
    pub fn logits(
        &self,
        pool: &ThreadPool,
        engine: &FrameEngine,
        chosen: &[Vec<usize>],
        steps: usize,
    ) -> Result<Vec<Vec<f32>>, EngineError> {
        let recordings: Vec<_> = chosen.iter().enumerate().collect();
        workers::for_each(pool, engine, &recordings, |engine, &(recording, chosen)| {
            let mut logits = Vec::new();
            for &window in chosen {
                engine.reset();
                for frame in self.frames(recording, window, steps) {
                    engine.push(frame)?;
                }
                logits.extend_from_slice(engine.predict()?.values);
            }
            Ok(logits)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{HeldOut, Slip};
    use crate::trainings::{Metadata, Task};

    fn held_out(entries: &[(&str, &str)]) -> Result<Option<HeldOut>, String> {
        let entries = [&[("trained_on", "Basic")], entries].concat();
        let entries = entries.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
        Slip::held_out(Metadata(&entries)).map_err(|error| error.to_string())
    }

    #[test]
    fn a_fold_states_the_part_that_it_held_out() {
        assert_eq!(held_out(&[("seed", "1")]), Ok(None));
        let recordings = Ok(Some(HeldOut::Recordings(vec!["n/pen1".to_owned()])));
        assert_eq!(held_out(&[("held_out", "[\"n/pen1\"]")]), recordings);
        assert_eq!(held_out(&[("scheme", "recordings"), ("held_out", "[\"n/pen1\"]")]), recordings);
        let windows = Ok(Some(HeldOut::Windows(vec![("n/pen1".to_owned(), 3)])));
        assert_eq!(held_out(&[("scheme", "windows"), ("held_out_windows", "[[\"n/pen1\", 3]]")]), windows);
    }

    #[test]
    fn a_fold_in_another_form_is_refused_with_the_expected_form() {
        for (entries, expected) in [
            (&[("scheme", "objects")][..], "\"recordings\" or \"windows\""),
            (&[("scheme", "windows"), ("held_out", "[]")], "held_out_windows"),
            (&[("held_out", "n/pen1")], "JSON list of recordings"),
            (&[("held_out", "[]"), ("held_out_windows", "[]")], "scheme"),
        ] {
            let error = held_out(entries).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }
}
