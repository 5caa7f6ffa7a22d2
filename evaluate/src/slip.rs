//! Direction of slip from 24 electrodes: the data set, its windows, its trainings.
//!
//! [`evaluate`] judges networks on seen and unseen objects.

mod judge;

use std::path::Path;

use meissner_engine::EngineError;
use meissner_engine::frames::FrameEngine;
use meissner_io::datasets::{BadRows, SlipDataset, SlipRecording};
use meissner_models::FrameDescription;
use meissner_models::systems::slip::{CLASSES, Object, ObjectSet, SlipWindows};
use meissner_run::model::describe_frames;
use meissner_run::text::grouped;

use crate::error::{EvaluateError, Result, TrainingError};
use crate::events::passed_over_note;
use crate::trainings::{HeldOut, Metadata, Scheme, Task};
use crate::trials::Cases;
pub use judge::{Classified, DataReport, Judged, Report, SetReport, SlipFigures, ValidationReport, evaluate};

/// The task of the direction of slip.
#[derive(Clone, Copy, Debug)]
pub struct Slip;

/// Whether weights with these metadata were trained on the set Basic.
pub(crate) fn trained_on_basic(metadata: Metadata<'_>) -> bool {
    metadata.0.get("trained_on").is_some_and(|set| set == ObjectSet::Basic.name())
}

impl Task for Slip {
    type Description = FrameDescription;
    const PREFIX: &'static str = "slip-";

    fn describe(network: &str) -> Result<(FrameDescription, bool)> {
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
        Ok(Some(match scheme {
            Scheme::Recordings => {
                metadata.recordings("with a JSON list of recordings, such as [\"n/pen178\"]")?
            }
            Scheme::Windows => {
                let expected = "with a JSON list of windows, such as [[\"n/pen178\", 0]]";
                let windows: Vec<(String, usize)> = metadata.list("held_out_windows", expected)?;
                let parts = windows.into_iter().map(|(recording, window)| (recording, Some(window)));
                HeldOut { scheme, parts: parts.collect() }
            }
        }))
    }
}

/// The recordings of a data set with their objects.
#[derive(Debug)]
pub struct SlipData {
    /// The recordings by class, and by file name in natural order.
    pub(crate) recordings: Vec<SlipRecording>,
    pub(crate) objects: Vec<Object>,
    /// Remarks about the data, for people.
    pub notes: Vec<String>,
}

impl SlipData {
    /// Reads the data set in `folder`.
    ///
    /// # Errors
    /// The folder has another layout, a recording cannot be read, or its object is unknown.
    pub fn read(folder: &Path) -> Result<Self> {
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
        notes.extend(passed_over_note(&passed_over));
        Ok(Self { recordings, objects, notes })
    }
}

/// The windows of all recordings as one network reads them.
#[derive(Clone, Debug)]
pub(crate) struct Windows {
    /// The windows of each recording.
    pub(crate) cases: Cases,
    /// (windows, steps, frame).
    pub(crate) values: Vec<f32>,
    pub(crate) frame_shape: &'static [usize],
    pub(crate) steps: usize,
}

impl Windows {
    /// The windows of `data` as `description` reads them.
    pub(crate) fn cut(data: &SlipData, description: &FrameDescription) -> Result<Self> {
        let mut windows = SlipWindows::new(description)?;
        let (mut cases, mut values) = (Cases::default(), Vec::new());
        for recording in &data.recordings {
            let mut count = 0;
            for stretch in recording.stretches() {
                let cut = windows.cut(stretch.iter().map(|reading| &reading.values), &mut values);
                count += cut.map_err(|source| {
                    let recording = recording.name.clone();
                    EvaluateError::SlipRecording { recording, source }
                })?;
            }
            cases.push(&recording.name, count);
        }
        Ok(Self { cases, values, frame_shape: windows.frame_shape(), steps: windows.steps() })
    }

    /// The last `steps` frames of a window.
    pub(crate) fn frames(&self, window: usize, steps: usize) -> impl Iterator<Item = &[f32]> {
        let (end, frame) = ((window + 1) * self.steps, self.frame_shape.iter().product::<usize>());
        self.values[(end - steps) * frame..end * frame].chunks_exact(frame)
    }

    /// The outputs for a window, from its last `steps` frames after a reset, and how unlike its
    /// input is.
    pub(crate) fn logits(
        &self,
        engine: &mut FrameEngine,
        window: usize,
        steps: usize,
    ) -> Result<(Vec<f32>, Option<f32>), EngineError> {
        engine.reset();
        self.frames(window, steps).try_for_each(|frame| engine.push(frame).map(drop))?;
        let prediction = engine.predict()?;
        Ok((prediction.values.to_vec(), prediction.unlike))
    }
}
