//! A data set of slips with the object of each recording, and its windows.

use std::path::Path;

use meissner_io::Reading;
use meissner_io::datasets::{BadRows, SlipDataset, SlipRecording};
use meissner_models::systems::slip::{CLASSES, Object, SlipError, SlipWindows};

use crate::error::CliError;
use meissner_pipeline::text::grouped;

/// The recordings of a data set, and what slipped in each.
pub(crate) struct SlipData {
    /// The recordings, by class and then by file name in natural order.
    pub(crate) recordings: Vec<SlipRecording>,
    /// The object of each recording.
    pub(crate) objects: Vec<Object>,
    /// What a person should know about the data.
    pub(crate) notes: Vec<String>,
}

impl SlipData {
    /// Reads the data set in `folder`.
    pub(crate) fn read(folder: &Path) -> Result<Self, CliError> {
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

    /// Appends the windows of recording `index` to `frames`, those of its readings to `readings`, and returns how many
    /// they are.
    pub(crate) fn cut(
        &self,
        index: usize,
        windows: &mut SlipWindows,
        frames: &mut Vec<f32>,
        mut readings: Option<&mut Vec<f32>>,
    ) -> Result<usize, CliError> {
        let recording = &self.recordings[index];
        let mut count = 0;
        for stretch in recording.stretches() {
            let cut = windows.cut(stretch.iter().map(|reading| &reading.values), frames);
            count += cut.map_err(|source| self.refused(index, source))?;
            if let Some(readings) = readings.as_deref_mut() {
                let whole = stretch.len() / windows.steps() * windows.steps();
                stretch[..whole].iter().for_each(|Reading { values, .. }| readings.extend(values));
            }
        }
        Ok(count)
    }

    fn refused(&self, index: usize, source: SlipError) -> CliError {
        CliError::SlipRecording { recording: self.recordings[index].name.clone(), source }
    }
}
