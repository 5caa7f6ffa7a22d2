//! Tasks on labelled recordings of events: the data set, and the trials of its networks.
//!
//! [`evaluate`] judges networks event by event. A new task implements [`EventTask`].

pub mod folds;
mod judge;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use meissner_engine::{Admission, Event, LatePolicy, Sensor};
use meissner_io::IoError;
use meissner_io::datasets::{Dataset, EventDataset, EventRecording, Split};
use meissner_models::Description;
use meissner_models::systems::check_outputs;
use meissner_run::losses::{InputLosses, LossWarning};
use meissner_run::model::describe;
use meissner_run::text::grouped;

use crate::error::EvaluateError;
use crate::trainings::{Task, Training};
use crate::trials::{Cases, Trial};
use folds::{folds, is_a_fold};
pub use judge::{DataReport, Judged, Options, OverTime, Protocols, Report, evaluate};

/// A task on labelled recordings of events.
pub trait EventTask: Task<Description = Description> + Sync {
    /// The data set.
    const SET: EventSet;

    /// The recordings of the data set in `folder`.
    ///
    /// # Errors
    /// The folder has another layout, or a recording cannot be read.
    fn recordings(folder: &Path) -> Result<EventDataset, IoError>;

    /// Reads the data set in `folder`.
    ///
    /// # Errors
    /// As [`Self::recordings`].
    fn read(folder: &Path) -> Result<EventData, EvaluateError> {
        let Dataset { recordings, passed_over } = Self::recordings(folder)?;
        Ok(EventData::new(Self::SET, folder, recordings, &passed_over))
    }
}

/// The data set of a task.
#[derive(Clone, Copy, Debug)]
pub struct EventSet {
    /// Name of the task.
    pub task: &'static str,
    /// The command that judges the networks of the task.
    pub command: &'static str,
    /// Name of the data set.
    pub name: &'static str,
    /// The sensor of all recordings.
    pub sensor: Sensor,
    /// Names of the classes, in the order of their indices.
    pub classes: &'static [&'static str],
}

impl EventSet {
    /// The description of a shipped network or in a file, which predicts the classes, and whether
    /// it is shipped.
    pub(crate) fn describe(&self, network: &str) -> Result<(Description, bool), EvaluateError> {
        let (description, shipped) = describe(network)?;
        check_outputs(description.name(), description.outputs().0, self.classes)?;
        Ok((description, shipped))
    }
}

/// The recordings of a data set.
#[derive(Clone, Debug)]
pub struct EventData {
    pub(crate) set: EventSet,
    pub(crate) folder: PathBuf,
    /// The recordings by split, by class, and by file name in natural order.
    pub(crate) recordings: Vec<EventRecording>,
    /// Remarks about the data, for people.
    pub notes: Vec<String>,
}

impl EventData {
    /// The data of `recordings`; the files `passed_over` are mentioned in the notes.
    pub(crate) fn new(
        set: EventSet,
        folder: &Path,
        recordings: Vec<EventRecording>,
        passed_over: &[PathBuf],
    ) -> Self {
        let late: u64 = recordings.iter().map(|recording| late(&recording.events)).sum();
        let late = (late > 0).then(|| format!("{} events are earlier than one before them", grouped(late)));
        let notes = late.into_iter().chain(passed_over_note(passed_over)).collect();
        Self { set, folder: folder.to_owned(), recordings, notes }
    }

    /// Indices of the recordings of `split`, ascending.
    pub(crate) fn of(&self, split: Split) -> Vec<usize> {
        (0..self.recordings.len()).filter(|&i| self.recordings[i].split == split).collect()
    }

    /// The fold of each recording in a cross-validation with `count` folds.
    pub(crate) fn folds(&self, count: usize) -> Result<Vec<usize>, EvaluateError> {
        let classes: Vec<usize> = self.recordings.iter().map(|recording| recording.class).collect();
        folds(&classes, count)
    }

    /// Number of events of all recordings.
    pub(crate) fn events(&self) -> u64 {
        self.recordings.iter().map(|recording| recording.events.len() as u64).sum()
    }

    /// The multiples of `every_us`, from the first event of a recording on, up to the first at or
    /// after the end of every recording. In microseconds.
    pub(crate) fn times(&self, every_us: i64) -> Vec<i64> {
        let length = |events: &[Event]| {
            let (first, last) = (events.first(), events.iter().map(|event| event.t_us).max());
            last.zip(first).map_or(0, |(last, first)| last - first.t_us)
        };
        let longest = self.recordings.iter().map(|recording| length(&recording.events)).max().unwrap_or(0);
        // Times of a recording span 23 bits.
        let count = (longest + every_us - 1) / every_us;
        (1..=count.max(1)).map(|i| i * every_us).collect()
    }

    /// The trials of `trainings`: whole ones on the split test, and folds, which hold out every
    /// recording once. With `count`, these must be the folds that [`prepare`](crate::prepare)
    /// writes for that number.
    pub(crate) fn trials(
        &self,
        trainings: &[Arc<Training>],
        count: Option<usize>,
    ) -> Result<Vec<Trial>, EvaluateError> {
        let assigned = count.map(|count| Ok::<_, EvaluateError>((count, self.folds(count)?))).transpose()?;
        let mut cases = Cases::default();
        self.recordings.iter().for_each(|recording| cases.push(&recording.name, 1));
        let check = |chosen: &[usize]| match &assigned {
            Some((count, folds)) => is_a_fold(chosen, *count, folds),
            None => Ok(()),
        };
        let trials = cases.trials(trainings, &self.of(Split::Test), check)?;
        let mut folds = trials.iter().filter(|trial| trial.scheme.is_some());
        folds.try_for_each(|trial| cases.are_complete(trial))?;
        Ok(trials)
    }

    /// `Ok` where no whole training among `trials` lacks recordings to be judged on.
    pub(crate) fn has_test(&self, trials: &[Trial]) -> Result<(), EvaluateError> {
        match trials.iter().find(|trial| trial.cases() == 0) {
            Some(_) => Err(EvaluateError::NoTestSplit { folder: self.folder.clone() }),
            None => Ok(()),
        }
    }
}

/// Logs and returns the warnings about events of `streams` that networks drop. The data are called
/// `name`.
pub(crate) fn lost<'a, S: IntoIterator<Item = &'a Event>>(
    name: &str,
    sensor: Sensor,
    streams: impl IntoIterator<Item = S>,
) -> Vec<LossWarning> {
    let mut gate = Admission::new(sensor, LatePolicy::Drop);
    for events in streams {
        gate.reset();
        for &event in events {
            // Accepted events are counted, too.
            let _ = gate.admit(event);
        }
    }
    InputLosses::of_events(*gate.counters(), sensor).warn(name)
}

/// A remark about files that are no recordings.
pub(crate) fn passed_over_note(files: &[PathBuf]) -> Option<String> {
    let (count, first) = (grouped(files.len() as u64), files.first()?.display());
    Some(format!("{count} files are no recordings and are passed over, the first {first}"))
}

/// Number of events that are earlier than one before them.
fn late(events: &[Event]) -> u64 {
    let mut newest = i64::MIN;
    let mut late = 0;
    for event in events {
        late += u64::from(event.t_us < newest);
        newest = newest.max(event.t_us);
    }
    late
}

#[cfg(test)]
mod tests {
    use super::late;
    use meissner_engine::Event;

    #[test]
    fn an_event_is_late_after_any_newer_one() {
        let events = [5, 3, 4, 5, 9].map(|t_us| Event::new(t_us, 0, 0, true));
        assert_eq!(late(&events), 2);
    }
}
