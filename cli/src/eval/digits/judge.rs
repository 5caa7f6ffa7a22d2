//! A network's trainings against the labels.
//!
//! Enters: the data set, a network with its trainings. Leaves: its figures, and the outputs at the ends of recordings. A
//! whole training is judged on the split test; folds of a cross-validation on what they held out, those of a seed together.

use std::path::Path;

use meissner_engine::Event;
use meissner_io::datasets::Split;
use meissner_models::{AnyDescription, ModelError};
use rayon::ThreadPool;

use super::figures::Judgeable;
use super::report::{Judged, NetworkReport, One};
use super::runs::{Outcome, Settings, outcomes};
use crate::args::Mode;
use crate::digits::{Candidate, DigitsData, Training, Validation, seed_name, validations};
use crate::error::CliError;
use meissner_pipeline::PipelineError;
use meissner_pipeline::model::card;

/// Judges networks on one data set.
pub(super) struct Judge<'a> {
    pub(super) folder: &'a Path,
    pub(super) data: &'a DigitsData,
    pub(super) pool: &'a ThreadPool,
    pub(super) mode: Mode,
    pub(super) every_us: i64,
    /// Number of times at which predictions are read.
    pub(super) times: usize,
}

/// A network whose folds have been checked.
pub(super) struct Plan {
    candidate: Candidate,
    validations: Vec<Validation>,
}

/// What a network is worth.
pub(super) struct Judgement {
    pub(super) report: NetworkReport,
    /// Name and outputs (recordings, 10) of each whole training and of the folds of each seed.
    pub(super) logits: Vec<(String, Vec<f32>)>,
}

impl Judge<'_> {
    /// Finds out whether `candidate` can be judged, before minutes of work. With `folds`, a cross-validation must have
    /// that many.
    pub(super) fn plan(&self, candidate: Candidate, folds: Option<usize>) -> Result<Plan, CliError> {
        let validations = validations(&candidate.trainings, self.data, folds)?;
        let whole = candidate.trainings.iter().any(|training| training.held_out.is_none());
        if whole && self.data.of(Split::Test).is_empty() {
            return Err(CliError::NoTestSplit { folder: self.folder.to_owned() });
        }
        Ok(Plan { candidate, validations })
    }

    /// Judges one network, and calls `done` after each training.
    pub(super) fn judge(&self, plan: &Plan, mut done: impl FnMut(&Training)) -> Result<Judgement, CliError> {
        let Plan { candidate, validations } = plan;
        let name = candidate.description.name();
        let mut logits = Vec::new();
        let mut of_test = Vec::new();
        let test = self.data.of(Split::Test);
        for training in candidate.trainings.iter().filter(|training| training.held_out.is_none()) {
            let outcomes = self.outcomes(candidate, training, &test)?;
            let outcomes: Vec<_> = test.iter().copied().zip(&outcomes).collect();
            logits.push((format!("{name}.{}", seed_name(training.seed)), ends(&outcomes)));
            of_test.extend(self.one(training.seed, training.files(), &outcomes));
            done(training);
        }
        let mut of_folds = Vec::new();
        for Validation { seed, folds } in validations {
            let mut held_out = Vec::new();
            for (training, chosen) in folds {
                held_out.extend(chosen.iter().copied().zip(self.outcomes(candidate, training, chosen)?));
                done(training);
            }
            held_out.sort_by_key(|(recording, _)| *recording);
            let outcomes: Vec<_> =
                held_out.iter().map(|(recording, outcome)| (*recording, outcome)).collect();
            logits.push((format!("{name}.{}.folds", seed_name(*seed)), ends(&outcomes)));
            let files = folds.iter().flat_map(|(training, _)| training.files()).collect();
            of_folds.extend(self.one(*seed, files, &outcomes));
        }
        let training =
            candidate.trainings.first().ok_or_else(|| CliError::NeedsTrainings(name.to_owned()))?;
        let described = AnyDescription::Events(candidate.description.clone());
        let report = NetworkReport {
            card: card(&described, &training.weights, weights(candidate))?.taking_every(candidate.stride),
            network: name.to_owned(),
            weights: weights(candidate),
            stride: candidate.stride,
            test: Judged::new(of_test),
            cross_validation: Judged::new(of_folds),
        };
        Ok(Judgement { report, logits })
    }

    /// The outcomes of the recordings `chosen` with the weights of `training`.
    fn outcomes(
        &self,
        candidate: &Candidate,
        training: &Training,
        chosen: &[usize],
    ) -> Result<Vec<Outcome>, CliError> {
        let failed = |source| PipelineError::Weights {
            weights: training.label.as_str().into(),
            source: Box::new(source),
        };
        let network = candidate.description.network(&training.weights).map_err(failed)?;
        let recordings: Vec<&[Event]> =
            chosen.iter().map(|&recording| &self.data.recordings[recording].events[..]).collect();
        let settings = Settings { mode: self.mode, every_us: self.every_us, stride: candidate.stride };
        let outcomes = outcomes(self.pool, network, settings, &recordings);
        Ok(outcomes.map_err(|source| failed(ModelError::Engine(source)))?)
    }

    fn one(&self, seed: Option<i64>, files: Vec<String>, outcomes: &[(usize, &Outcome)]) -> Option<One> {
        let class = |recording: usize| self.data.recordings[recording].class;
        let outcomes = outcomes.iter().map(|&(recording, outcome)| (class(recording), outcome)).collect();
        One::new(seed, files, &Judgeable { outcomes, every_us: self.every_us, times: self.times })
    }
}

/// The outputs at the end of each recording, one after the other.
fn ends(outcomes: &[(usize, &Outcome)]) -> Vec<f32> {
    outcomes.iter().flat_map(|(_, outcome)| outcome.logits.iter().copied()).collect()
}

/// Where the weights of a network come from.
fn weights(candidate: &Candidate) -> String {
    let trainings = &candidate.trainings;
    let folds = trainings.iter().filter(|training| training.held_out.is_some()).count();
    match &trainings[..] {
        [training] => training.label.clone(),
        _ => format!("{} trainings, {folds} folds of cross-validations", trainings.len() - folds),
    }
}
