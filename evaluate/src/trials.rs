//! Trainings with the labelled cases that they have not seen.
//!
//! Input: the trainings of a network, and the cases of a data set. Output: trials, each a whole
//! training or the folds of a cross-validation, in which no case is held out twice.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use meissner_models::TensorFile;

use crate::error::{Result, TrainingError};
use crate::trainings::{HeldOut, Scheme, Training, seed_name};

/// The cases of a data set, recording after recording.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cases {
    names: Vec<String>,
    /// Index after the last case of each recording.
    ends: Vec<usize>,
}

/// Trainings that are judged together: a whole training, or the folds of a scheme and a seed.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    /// The scheme of a cross-validation; `None` for a whole training.
    pub(crate) scheme: Option<Scheme>,
    pub(crate) seed: Option<i64>,
    pub(crate) folds: Vec<Fold>,
}

/// A training with the indices of the cases that it has not seen, ascending.
#[derive(Clone, Debug)]
pub(crate) struct Fold {
    pub(crate) training: Arc<Training>,
    pub(crate) cases: Vec<usize>,
}

impl Cases {
    /// Appends a recording of `count` cases.
    pub(crate) fn push(&mut self, name: &str, count: usize) {
        self.ends.push(self.len() + count);
        self.names.push(name.to_owned());
    }

    pub(crate) fn len(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    /// Indices of the cases of a recording.
    pub(crate) fn of(&self, recording: usize) -> Range<usize> {
        let start = recording.checked_sub(1).map_or(0, |before| self.ends[before]);
        start..self.ends[recording]
    }

    pub(crate) fn recording(&self, case: usize) -> usize {
        self.ends.partition_point(|&end| end <= case)
    }

    /// The cases of `held_out`, ascending; `index` has the index of each recording.
    fn held_out(
        &self,
        held_out: &HeldOut,
        index: &BTreeMap<&str, usize>,
    ) -> Result<Vec<usize>, TrainingError> {
        let mut cases = Vec::new();
        for (name, window) in &held_out.parts {
            let refused = |expected: String, found| Err(TrainingError::HeldOut { expected, found });
            let Some(&recording) = index.get(name.as_str()) else {
                return refused("recordings of the data set".to_owned(), format!("{name:?}"));
            };
            let all = self.of(recording);
            match *window {
                None => cases.extend(all),
                Some(window) if window < all.len() => cases.push(all.start + window),
                Some(window) => {
                    let expected = format!("windows of {name:?} from 0 to below {}", all.len());
                    return refused(expected, window.to_string());
                }
            }
        }
        cases.sort_unstable();
        Ok(cases)
    }

    /// The trials of `trainings`: whole ones, which have not seen the cases `unseen`, then the
    /// folds by scheme and seed. `check` can refuse the cases of a fold.
    pub(crate) fn trials(
        &self,
        trainings: &[Arc<Training>],
        unseen: &[usize],
        check: impl Fn(&[usize]) -> Result<(), TrainingError>,
    ) -> Result<Vec<Trial>> {
        let index = self.names.iter().map(String::as_str).zip(0..).collect();
        let mut trials = Vec::new();
        let mut folds: BTreeMap<_, Vec<Fold>> = BTreeMap::new();
        for training in trainings {
            let fold = |cases| Fold { training: Arc::clone(training), cases };
            if let Some(held_out) = &training.held_out {
                let cases = self.held_out(held_out, &index).and_then(|cases| check(&cases).map(|()| cases));
                let cases = cases.map_err(|source| training.refused(source))?;
                folds.entry((held_out.scheme, training.seed)).or_default().push(fold(cases));
            } else {
                let folds = vec![fold(unseen.to_vec())];
                trials.push(Trial { scheme: None, seed: training.seed, folds });
            }
        }
        for ((scheme, seed), folds) in folds {
            let trial = Trial { scheme: Some(scheme), seed, folds };
            self.are_apart(scheme, &trial.folds)?;
            trials.push(trial);
        }
        Ok(trials)
    }

    /// `Ok` where no case is held out twice.
    fn are_apart(&self, scheme: Scheme, folds: &[Fold]) -> Result<()> {
        let mut owners: Vec<Option<&Training>> = vec![None; self.len()];
        for Fold { training, cases } in folds {
            for &case in cases {
                let Some(first) = owners[case].replace(training) else { continue };
                let recording = self.recording(case);
                let name = &self.names[recording];
                let (parts, again) = match scheme {
                    Scheme::Recordings => ("recordings", format!("{name:?}")),
                    Scheme::Windows => {
                        ("windows", format!("window {} of {name:?}", case - self.of(recording).start))
                    }
                };
                let first = first.path.clone();
                return Err(training.refused(TrainingError::Overlap { parts, again, first }));
            }
        }
        Ok(())
    }

    /// `Ok` if the folds of `trial` together hold out all cases.
    pub(crate) fn are_complete(&self, trial: &Trial) -> Result<()> {
        let Some(Fold { training, .. }) = trial.folds.first() else { return Ok(()) };
        let mut held_out = vec![false; self.len()];
        trial.folds.iter().flat_map(|fold| &fold.cases).for_each(|&case| held_out[case] = true);
        let Some(missing) = held_out.iter().position(|held_out| !held_out) else { return Ok(()) };
        Err(training.refused(TrainingError::Incomplete {
            network: training.network.clone(),
            seed: seed_name(trial.seed),
            recordings: self.len(),
            found: trial.cases(),
            missing: self.names[self.recording(missing)].clone(),
        }))
    }
}

impl Trial {
    /// Number of unseen cases.
    pub(crate) fn cases(&self) -> usize {
        self.folds.iter().map(|fold| fold.cases.len()).sum()
    }

    pub(crate) fn files(&self) -> Vec<String> {
        self.folds.iter().flat_map(|fold| fold.training.files()).collect()
    }

    /// The unseen cases with their outcomes, in order; `done` is called after each training.
    pub(crate) fn outcomes<O>(
        &self,
        mut done: impl FnMut(&Training),
        mut outcomes: impl FnMut(&Training, &[usize]) -> Result<Vec<O>>,
    ) -> Result<Vec<(usize, O)>> {
        let mut all = Vec::new();
        for Fold { training, cases } in &self.folds {
            all.extend(cases.iter().copied().zip(outcomes(training, cases)?));
            done(training);
        }
        all.sort_by_key(|(case, _)| *case);
        Ok(all)
    }

    /// Adds the outputs of `network` for the unseen cases, row-major (cases, `outputs`), as the
    /// tensor `NETWORK.SEED` or `NETWORK.SEED.folds`.
    pub(crate) fn write(&self, network: &str, outputs: usize, values: &[f32], file: &mut TensorFile) {
        let folds = if self.scheme.is_some() { ".folds" } else { "" };
        let name = format!("{network}.{}{folds}", seed_name(self.seed));
        file.f32(&name, &[values.len() / outputs, outputs], values);
    }
}
