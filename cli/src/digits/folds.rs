//! Which recordings each fold of a cross-validation is judged on.
//!
//! Invariant: the folds of a seed hold out every recording exactly once.

use std::collections::BTreeMap;
use std::rc::Rc;

use meissner_models::systems::digits::folds;

use super::training::{Training, seed_name};
use crate::digits::DigitsData;
use crate::error::CliError;
use crate::trainings::TrainingError;

/// A fold with the places of the recordings that it held out, ascending.
type Fold = (Rc<Training>, Vec<usize>);

/// The folds of a seed.
pub(crate) struct Validation {
    pub(crate) seed: Option<i64>,
    pub(crate) folds: Vec<Fold>,
}

/// The folds among the `trainings` of a network by seed. With `count`, they must be those of that many folds which
/// `prepare digits` writes.
pub(crate) fn validations(
    trainings: &[Rc<Training>],
    data: &DigitsData,
    count: Option<usize>,
) -> Result<Vec<Validation>, CliError> {
    let assigned =
        count.map(|count| folds(&data.classes(), count).map(|folds| (count, folds))).transpose()?;
    let places: BTreeMap<&str, usize> =
        data.recordings.iter().enumerate().map(|(i, recording)| (recording.name.as_str(), i)).collect();
    let mut seeds: BTreeMap<Option<i64>, Vec<Fold>> = BTreeMap::new();
    for training in trainings {
        let Some(names) = &training.held_out else { continue };
        let failed = |source| CliError::Training { path: training.path.clone(), source };
        let place = |name: &String| {
            let place = places.get(name.as_str()).copied();
            place.ok_or_else(|| TrainingError::Recording { found: name.clone() })
        };
        let mut chosen = names.iter().map(place).collect::<Result<Vec<_>, _>>().map_err(failed)?;
        chosen.sort_unstable();
        if let Some((count, folds)) = &assigned {
            is_a_fold(&chosen, *count, folds).map_err(failed)?;
        }
        seeds.entry(training.seed).or_default().push((Rc::clone(training), chosen));
    }
    let validation = |(seed, folds)| {
        let validation = Validation { seed, folds };
        validation.holds_out_all_once(data)?;
        Ok(validation)
    };
    seeds.into_iter().map(validation).collect()
}

/// `Ok` where the recordings `chosen` are one of the `folds`, which are `count`.
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

impl Validation {
    fn holds_out_all_once(&self, data: &DigitsData) -> Result<(), CliError> {
        let mut owners: Vec<Option<&Training>> = vec![None; data.recordings.len()];
        for (training, chosen) in &self.folds {
            for &recording in chosen {
                if let Some(first) = owners[recording].replace(training) {
                    let (first, recording) = (first.path.clone(), data.recordings[recording].name.clone());
                    let source = TrainingError::Again { recording, first };
                    return Err(CliError::Training { path: training.path.clone(), source });
                }
            }
        }
        let (Some(missing), Some((training, _))) =
            (owners.iter().position(Option::is_none), self.folds.first())
        else {
            return Ok(());
        };
        let source = TrainingError::Incomplete {
            network: training.network.clone(),
            seed: seed_name(self.seed),
            recordings: owners.len(),
            found: owners.iter().flatten().count(),
            missing: data.recordings[missing].name.clone(),
        };
        Err(CliError::Training { path: training.path.clone(), source })
    }
}

#[cfg(test)]
mod tests {
    use super::is_a_fold;

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
