//! Tasks on labelled recordings of events: the data set, and the trials of its networks.
//!
//! [`evaluate`] judges networks event by event. A new task implements [`EventTask`].

mod judge;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use meissner_engine::{Admission, Event, LatePolicy, Sensor};
use meissner_io::IoError;
use meissner_io::datasets::{Dataset, EventDataset, EventRecording, NeutouchSet, Split};
use meissner_models::Description;
use meissner_models::systems::{check_outputs, digits, letters, touch};
use meissner_run::losses::{InputLosses, LossWarning};
use meissner_run::model::describe;
use meissner_run::text::grouped;

use crate::error::{EvaluateError, Result, TrainingError};
use crate::trainings::{HeldOut, Metadata, Task, Training};
use crate::trials::{Cases, Trial};
pub use judge::{DataReport, Judged, Options, OverTime, Protocols, Report, evaluate};

/// [`EventSet::since`] of recordings without an instant of contact.
const FIRST_EVENT: &str = "the first event";

/// A task on labelled recordings of events.
pub trait EventTask: Sync {
    /// The data set.
    const SET: EventSet;

    /// The network that the weights of `network` were trained as.
    fn trained_as(network: &str) -> &str {
        network
    }

    /// The recordings of the data set in `folder`.
    ///
    /// # Errors
    /// The folder has another layout, or a recording cannot be read.
    fn recordings(folder: &Path) -> Result<EventDataset, IoError>;

    /// Reads the data set in `folder`.
    ///
    /// # Errors
    /// As [`Self::recordings`].
    fn read(folder: &Path) -> Result<EventData> {
        let Dataset { recordings, passed_over } = Self::recordings(folder)?;
        Ok(EventData::new(Self::SET, folder, recordings, &passed_over))
    }
}

/// The data set of a task.
#[derive(Clone, Copy, Debug)]
#[expect(missing_docs, reason = "the names say it")]
pub struct EventSet {
    pub task: &'static str,
    /// The command that judges the networks of the task.
    pub command: &'static str,
    pub name: &'static str,
    pub sensor: Sensor,
    /// Names of the classes, in the order of their indices.
    pub classes: &'static [&'static str],
    /// Beginning of the names of the shipped networks.
    pub prefix: &'static str,
    /// The instant from which the age of a recording counts.
    pub since: &'static str,
}

impl<T: EventTask> Task for T {
    type Description = Description;
    const PREFIX: &'static str = T::SET.prefix;

    fn describe(network: &str) -> Result<(Description, bool)> {
        let (description, shipped) = describe(network)?;
        check_outputs(description.name(), description.outputs().0, T::SET.classes)?;
        Ok((description, shipped))
    }

    fn name(description: &Description) -> &str {
        description.name()
    }

    fn trained_as(network: &str) -> &str {
        T::trained_as(network)
    }

    /// The recordings that a fold held out; a whole training must have left out the split test.
    fn held_out(metadata: Metadata<'_>) -> Result<Option<HeldOut>, TrainingError> {
        if metadata.0.contains_key("held_out") {
            let expected = "with a JSON list of recordings, such as [\"train/3/00123\"]";
            return metadata.recordings(expected).map(Some);
        }
        if metadata.0.get("trained_on").is_some_and(|split| split == "train") {
            return Ok(None);
        }
        let expected = "\"train\", or \"held_out\" with a JSON list of recordings,";
        Err(metadata.refused("trained_on", expected))
    }
}

/// Digits in front of a moving event camera (N-MNIST).
#[derive(Clone, Copy, Debug)]
pub struct Digits;

impl EventTask for Digits {
    const SET: EventSet = EventSet {
        task: "digits",
        command: "eval digits",
        name: "N-MNIST",
        sensor: digits::SENSOR,
        classes: &digits::CLASSES,
        prefix: "digits-",
        since: FIRST_EVENT,
    };

    fn trained_as(network: &str) -> &str {
        digits::trained_as(network)
    }

    fn recordings(folder: &Path) -> Result<EventDataset, IoError> {
        EventDataset::nmnist(folder)
    }
}

/// Objects in a gripper, felt by a tactile skin (`NeuTouch`).
#[derive(Clone, Copy, Debug)]
pub struct TouchObjects;

impl EventTask for TouchObjects {
    const SET: EventSet = EventSet {
        task: "touch objects",
        command: "eval touch objects",
        name: "NeuTouch",
        sensor: touch::SENSOR,
        classes: &touch::OBJECTS,
        prefix: "touch-objects",
        since: FIRST_EVENT,
    };

    fn recordings(folder: &Path) -> Result<EventDataset, IoError> {
        EventDataset::neutouch(folder, NeutouchSet::Objects)
    }
}

/// Containers with fillings in a gripper, felt by a tactile skin (`NeuTouch`).
#[derive(Clone, Copy, Debug)]
pub struct TouchContainers;

impl EventTask for TouchContainers {
    const SET: EventSet = EventSet {
        task: "touch containers",
        command: "eval touch containers",
        classes: &touch::CONTAINERS,
        prefix: "touch-containers",
        ..TouchObjects::SET
    };

    fn recordings(folder: &Path) -> Result<EventDataset, IoError> {
        EventDataset::neutouch(folder, NeutouchSet::Containers)
    }
}

/// Letters of braille, felt by a tactile skin (`NUSkin`).
#[derive(Clone, Copy, Debug)]
pub struct TouchLetters;

impl EventTask for TouchLetters {
    const SET: EventSet = EventSet {
        task: "touch letters",
        command: "eval touch letters",
        name: "NUSkin",
        sensor: letters::SENSOR,
        classes: &letters::CLASSES,
        prefix: "touch-letters",
        since: "contact",
    };

    fn recordings(folder: &Path) -> Result<EventDataset, IoError> {
        EventDataset::letters(folder, &letters::CLASSES)
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
        let silent = recordings.iter().filter(|recording| recording.events.is_empty()).count();
        let silent = (silent > 0).then(|| format!("{} recordings have no events", grouped(silent as u64)));
        let notes = late.into_iter().chain(silent).chain(passed_over_note(passed_over)).collect();
        Self { set, folder: folder.to_owned(), recordings, notes }
    }

    pub(crate) fn of(&self, split: Split) -> Vec<usize> {
        (0..self.recordings.len()).filter(|&i| self.recordings[i].split == split).collect()
    }

    pub(crate) fn folds(&self, count: usize) -> Result<Vec<usize>> {
        let classes: Vec<usize> = self.recordings.iter().map(|recording| recording.class).collect();
        folds(&classes, count)
    }

    pub(crate) fn events(&self) -> u64 {
        self.recordings.iter().map(|recording| recording.events.len() as u64).sum()
    }

    /// The multiples of `every_us` since the begin, up to the end of the longest recording.
    pub(crate) fn times(&self, every_us: i64) -> Vec<i64> {
        let length = |recording: &EventRecording| {
            let last = recording.events.iter().map(|event| event.t_us).max();
            last.map_or(0, |last| last - recording.begin_us())
        };
        let longest = self.recordings.iter().map(length).max().unwrap_or(0).max(0);
        // Readers bound the length: minutes for a press, 23 bits for others.
        let count = (longest + every_us - 1) / every_us;
        (1..=count.max(1)).map(|i| i * every_us).collect()
    }

    /// The trials of `trainings`: whole ones on the split test, and folds, which hold out every
    /// recording once. With `count`, the folds must be those that [`prepare`](crate::prepare)
    /// writes.
    pub(crate) fn trials(&self, trainings: &[Arc<Training>], count: Option<usize>) -> Result<Vec<Trial>> {
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

    /// `Ok` if all whole trainings among `trials` have recordings to be judged on.
    pub(crate) fn has_test(&self, trials: &[Trial]) -> Result<()> {
        match trials.iter().find(|trial| trial.cases() == 0) {
            Some(_) => Err(EvaluateError::NoTestSplit { folder: self.folder.clone() }),
            None => Ok(()),
        }
    }
}

/// Logs and returns the warnings about events of `streams`, called `name`, that networks drop.
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

pub(crate) fn passed_over_note(files: &[PathBuf]) -> Option<String> {
    let (count, first) = (grouped(files.len() as u64), files.first()?.display());
    Some(format!("{count} files are no recordings and are passed over, the first {first}"))
}

fn late(events: &[Event]) -> u64 {
    let mut newest = i64::MIN;
    let mut late = 0;
    for event in events {
        late += u64::from(event.t_us < newest);
        newest = newest.max(event.t_us);
    }
    late
}

/// The fold, from 0 to below `count`, of each recording with a class. O(n log n).
///
/// Recordings are dealt like cards: in order of class, then as given, the k-th goes to fold k mod
/// `count`. The numbers of recordings of two folds differ by at most one, for each class and in
/// total.
///
/// # Errors
/// [`EvaluateError::Folds`] for fewer than two folds, and for more folds than recordings.
pub fn folds(classes: &[usize], count: usize) -> Result<Vec<usize>> {
    if count < 2 || count > classes.len() {
        return Err(EvaluateError::Folds { recordings: classes.len(), found: count });
    }
    let mut order: Vec<usize> = (0..classes.len()).collect();
    order.sort_by_key(|&recording| classes[recording]);
    let mut folds = vec![0; classes.len()];
    for (k, recording) in order.into_iter().enumerate() {
        folds[recording] = k % count;
    }
    Ok(folds)
}

/// `Ok` if the recordings `chosen` are one of the `count` `folds`.
pub(super) fn is_a_fold(chosen: &[usize], count: usize, folds: &[usize]) -> Result<(), TrainingError> {
    let mut met: Vec<usize> = chosen.iter().map(|&recording| folds[recording]).collect();
    met.sort_unstable();
    met.dedup();
    let expected = met.first().map_or(0, |first| folds.iter().filter(|fold| *fold == first).count());
    if met.len() == 1 && chosen.len() == expected {
        return Ok(());
    }
    Err(TrainingError::OtherFold { count, expected, found: chosen.len(), folds: met.len() })
}

#[cfg(test)]
mod tests;
