//! Digits in front of a moving event camera (N-MNIST): the data set, its trainings, and the folds of a cross-validation.
//!
//! [`evaluate`] judges networks event by event.

mod judge;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use meissner_engine::{Admission, Event, LatePolicy};
use meissner_io::datasets::{NmnistDataset, NmnistRecording, Split};
use meissner_models::Description;
use meissner_models::systems::digits::{SENSOR, check, folds, trained_as};
use meissner_pipeline::losses::{InputLosses, LossWarning};
use meissner_pipeline::model::describe;
use meissner_pipeline::text::grouped;

use crate::error::{EvaluateError, TrainingError};
use crate::trainings::{Metadata, Task, seed_name};
pub use judge::{DataReport, Judged, JudgedSeed, NetworkReport, Options, Protocol, Report, evaluate};

/// The task of digits.
#[derive(Clone, Copy, Debug)]
pub struct Digits;

/// A network that predicts digits, with its trainings.
pub type Candidate = crate::trainings::Candidate<Digits>;
/// A training of a network for digits; a fold held out the recordings of these names.
pub type Training = crate::trainings::Training<Vec<String>>;

impl Task for Digits {
    type Description = Description;
    type HeldOut = Vec<String>;
    const PREFIX: &'static str = "digits-";

    fn describe(network: &str) -> Result<(Description, bool), EvaluateError> {
        let (description, shipped) = describe(network)?;
        check(&description)?;
        Ok((description, shipped))
    }

    fn name(description: &Description) -> &str {
        description.name()
    }

    fn trained_as(network: &str) -> &str {
        trained_as(network)
    }

    /// The recordings that a fold held out; a whole training must have left out the split test.
    fn held_out(metadata: Metadata<'_>) -> Result<Option<Vec<String>>, TrainingError> {
        if metadata.0.contains_key("held_out") {
            let expected = "with a JSON list of recordings, such as [\"train/3/00123\"]";
            return metadata.list("held_out", expected).map(Some);
        }
        if metadata.0.get("trained_on").is_some_and(|split| split == "train") {
            return Ok(None);
        }
        let expected = "\"train\", or \"held_out\" with a JSON list of recordings,";
        Err(metadata.refused("trained_on", expected))
    }
}

/// The recordings of a data set.
#[derive(Clone, Debug)]
pub struct DigitsData {
    /// The recordings by split, by class, and by file name in natural order.
    pub recordings: Vec<NmnistRecording>,
    /// Remarks about the data, for people.
    pub notes: Vec<String>,
}

impl DigitsData {
    /// Reads the data set in `folder`.
    ///
    /// # Errors
    /// The folder has another layout, or a recording cannot be read.
    pub fn read(folder: &Path) -> Result<Self, EvaluateError> {
        let NmnistDataset { recordings, passed_over } = NmnistDataset::read(folder)?;
        let mut notes = Vec::new();
        let late: u64 = recordings.iter().map(|recording| late(&recording.events)).sum();
        if late > 0 {
            notes.push(format!("{} events are earlier than one before them", grouped(late)));
        }
        if let [first, ..] = &passed_over[..] {
            let (count, first) = (grouped(passed_over.len() as u64), first.display());
            notes.push(format!("{count} files are no recordings and are passed over, the first {first}"));
        }
        Ok(Self { recordings, notes })
    }

    /// Indices of the recordings of `split`, ascending.
    pub fn of(&self, split: Split) -> Vec<usize> {
        (0..self.recordings.len()).filter(|&i| self.recordings[i].split == split).collect()
    }

    /// Classes of all recordings.
    pub fn classes(&self) -> Vec<usize> {
        self.recordings.iter().map(|recording| recording.class).collect()
    }

    /// Number of events of all recordings.
    pub fn events(&self) -> u64 {
        self.recordings.iter().map(|recording| recording.events.len() as u64).sum()
    }

    /// The multiples of `every_us`, from the first event of a recording on, up to the first at or after the end of every
    /// recording. In microseconds.
    pub fn times(&self, every_us: i64) -> Vec<i64> {
        let length = |events: &[Event]| {
            let (first, last) = (events.first(), events.iter().map(|event| event.t_us).max());
            last.zip(first).map_or(0, |(last, first)| last - first.t_us)
        };
        let longest = self.recordings.iter().map(|recording| length(&recording.events)).max().unwrap_or(0);
        // Times of a recording span 23 bits.
        let count = (longest + every_us - 1) / every_us;
        (1..=count.max(1)).map(|i| i * every_us).collect()
    }

    /// Logs and returns the warnings about events that networks drop, of every `stride`-th event of each recording; `name`
    /// is that of the data set.
    fn lost(&self, stride: usize, name: &str) -> Vec<LossWarning> {
        let mut gate = Admission::new(SENSOR, LatePolicy::Drop);
        for recording in &self.recordings {
            gate.reset();
            for &event in recording.events.iter().step_by(stride) {
                // Accepted events are counted, too.
                let _ = gate.admit(event);
            }
        }
        InputLosses::of_events(*gate.counters(), SENSOR).warn(name)
    }
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

/// A fold with the indices of the recordings that it held out, ascending.
pub(crate) type Fold = (Arc<Training>, Vec<usize>);

/// The folds of a seed, which hold out every recording exactly once.
pub(crate) struct CrossValidation {
    pub(crate) seed: Option<i64>,
    pub(crate) folds: Vec<Fold>,
}

/// The cross-validations among `trainings` of one network, by seed. With `count`, they must be the folds that
/// [`prepare`](crate::prepare) writes for that number.
pub(crate) fn cross_validations(
    trainings: &[Arc<Training>],
    data: &DigitsData,
    count: Option<usize>,
) -> Result<Vec<CrossValidation>, EvaluateError> {
    let assigned =
        count.map(|count| folds(&data.classes(), count).map(|folds| (count, folds))).transpose()?;
    let names = data.recordings.iter().map(|recording| recording.name.as_str());
    let indices: BTreeMap<&str, usize> = names.zip(0..).collect();
    let mut seeds: BTreeMap<Option<i64>, Vec<Fold>> = BTreeMap::new();
    for training in trainings {
        let Some(names) = &training.held_out else { continue };
        let index = |name: &String| {
            let index = indices.get(name.as_str()).copied();
            index.ok_or_else(|| TrainingError::Recording { found: name.clone() })
        };
        let chosen = names.iter().map(index).collect::<Result<Vec<_>, _>>();
        let mut chosen = chosen.map_err(|source| training.refused(source))?;
        chosen.sort_unstable();
        if let Some((count, folds)) = &assigned {
            is_a_fold(&chosen, *count, folds).map_err(|source| training.refused(source))?;
        }
        seeds.entry(training.seed).or_default().push((Arc::clone(training), chosen));
    }
    let all: Vec<_> = seeds.into_iter().map(|(seed, folds)| CrossValidation { seed, folds }).collect();
    all.iter().try_for_each(|seed| seed.holds_out_all_once(data))?;
    Ok(all)
}

/// `Ok` where the recordings `chosen` are one of the `folds`, of which there are `count`.
fn is_a_fold(chosen: &[usize], count: usize, folds: &[usize]) -> Result<(), TrainingError> {
    let mut met: Vec<usize> = chosen.iter().map(|&recording| folds[recording]).collect();
    met.sort_unstable();
    met.dedup();
    let expected = met.first().map_or(0, |first| folds.iter().filter(|fold| *fold == first).count());
    if met.len() == 1 && chosen.len() == expected {
        return Ok(());
    }
    Err(TrainingError::OtherFold { count, expected, found: chosen.len(), folds: met.len() })
}

impl CrossValidation {
    fn holds_out_all_once(&self, data: &DigitsData) -> Result<(), EvaluateError> {
        let mut owners: Vec<Option<&Training>> = vec![None; data.recordings.len()];
        for (training, chosen) in &self.folds {
            for &recording in chosen {
                if let Some(first) = owners[recording].replace(training) {
                    let (first, recording) = (first.path.clone(), data.recordings[recording].name.clone());
                    return Err(training.refused(TrainingError::Again { recording, first }));
                }
            }
        }
        let missing = owners.iter().position(Option::is_none);
        let (Some(missing), Some((training, _))) = (missing, self.folds.first()) else { return Ok(()) };
        Err(training.refused(TrainingError::Incomplete {
            network: training.network.clone(),
            seed: seed_name(self.seed),
            recordings: owners.len(),
            found: owners.iter().flatten().count(),
            missing: data.recordings[missing].name.clone(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::{is_a_fold, late};
    use meissner_engine::Event;

    #[test]
    fn an_event_is_late_after_any_newer_one() {
        let events = [5, 3, 4, 5, 9].map(|t_us| Event::new(t_us, 0, 0, true));
        assert_eq!(late(&events), 2);
    }

    #[test]
    fn a_fold_is_all_of_its_recordings_and_no_other() {
        let folds = [0, 1, 0, 1, 2];
        for chosen in [&[0, 2][..], &[1, 3], &[4]] {
            assert!(is_a_fold(chosen, 3, &folds).is_ok(), "{chosen:?}");
        }
        for (chosen, found) in [
            (
                &[0][..],
                "the 2 recordings of one fold of 3, as `prepare digits --folds 3` writes them, found 1",
            ),
            (&[0, 1], "found 2 recordings of 2 folds"),
            (&[], "found 0 recordings of 0 folds"),
        ] {
            let error = is_a_fold(chosen, 3, &folds).unwrap_err().to_string();
            assert!(error.contains(found), "{error}");
        }
    }
}
