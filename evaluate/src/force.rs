//! Contact force over time: networks that predict the force of a grasp from its events.
//!
//! Enters: a file of recordings with the force along time, and networks with their trainings. Leaves: a [`Report`] with errors over all
//! frames, by phase and by bolt, and the predicted forces. A recording begins with a reset. Frames last [`PERIOD_US`] from the first time
//! of the truth on, and the force at the end of each counts, for every kind of network. Figures are computed in a fixed order, so that the
//! number of threads changes no bit, except in measured times and in what depends on them.

mod errors;
pub(crate) mod recording;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use meissner_models::{AnyDescription, TensorFile};
use meissner_pipeline::losses::LossWarning;
use meissner_pipeline::model::describe_any;
use meissner_pipeline::predictor::Mode;
use meissner_pipeline::provenance::{Header, InputCard, ModelCard};
use serde::Serialize;

pub use errors::{ForceErrors, PartErrors};

use crate::error::{EvaluateError, RequestPart, TrainingError};
use crate::events::lost;
use crate::judged;
use crate::regression::engine::{HowCounts, PressEngine};
use crate::regression::press::Presses;
use crate::regression::quantity::Quantity;
use crate::trainings::{Candidate, Evaluation, HeldOut, Metadata, Request, Task, Training, candidates};
use crate::trials::{Cases, Trial};
use crate::workers::Workers;
use recording::{FORCE, Outcome, judge};

/// Length of a frame in microseconds.
pub const PERIOD_US: i64 = 10_000;

/// The task of predicting the force of a grasp.
#[derive(Clone, Copy, Debug)]
pub struct Force;

impl Task for Force {
    type Description = AnyDescription;
    const PREFIX: &'static str = "force-";

    fn describe(network: &str) -> Result<(AnyDescription, bool), EvaluateError> {
        let (description, shipped) = describe_any(network)?;
        let (names, _) = description.outputs();
        if names != [FORCE] {
            let found = format!("{network}, which predicts {}", names.join(", "));
            return Err(EvaluateError::request(RequestPart::Networks, "networks that predict force", found));
        }
        Ok((description, shipped))
    }

    fn name(description: &AnyDescription) -> &str {
        description.name()
    }

    /// The recordings that a fold held out, by their numbers in the file; to a whole training, a file is unseen as a whole.
    fn held_out(metadata: Metadata<'_>) -> Result<Option<HeldOut>, TrainingError> {
        let expected = "with a JSON list of recordings, such as [\"17\"]";
        metadata.0.contains_key("held_out").then(|| metadata.recordings(expected)).transpose()
    }
}

/// The networks to be judged, and when predictions are read.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Networks and trainings.
    pub request: Request<'a>,
    /// Microseconds from one prediction of a network over events to the next, which divide [`PERIOD_US`].
    pub every_us: i64,
    /// How predictions of networks over events are computed.
    pub mode: Mode,
}

/// Figures of all networks, with the keys of the JSON report.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Report {
    pub header: Header,
    pub data: DataReport,
    /// Microseconds from one prediction of a network over events to the next.
    pub every_us: i64,
    /// Microseconds from one frame to the next.
    pub period_us: i64,
    pub networks: Vec<NetworkReport>,
}

/// The recordings that networks are judged on.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct DataReport {
    pub file: String,
    pub recordings: usize,
    pub events: u64,
    /// Variance of the true force over all frames, in square newtons: the mean squared error of a network that always says the mean.
    pub variance: f64,
    /// Remarks about the trainings, for people.
    pub notes: Vec<String>,
    /// Warnings about events that networks drop.
    pub warnings: Vec<LossWarning>,
}

/// Figures of a network.
#[derive(Serialize)]
pub struct NetworkReport {
    /// Network and weights.
    #[serde(flatten)]
    pub card: ModelCard,
    /// Source of its weights.
    #[serde(skip)]
    pub weights: String,
    /// Figures of the trainings; `None` for a file without recordings.
    pub figures: Option<Judged>,
    /// Of the first trial and of each recording: true and predicted force at the end of each frame.
    #[serde(skip)]
    pub traces: Vec<Vec<(f64, f64)>>,
}

/// Figures of several trainings on the same recordings.
pub type Judged = judged::Judged<ForceErrors>;

/// Judges the networks of `options` on the recordings in the safetensors file `events`, with the threads of `workers`. `done` is
/// called after each training with its label and the time since judging began.
///
/// The file has streams as `meissner simulate grasp` writes them; the labels `phase` and `bolt` may be missing.
///
/// # Errors
/// The file or a network cannot be read, `every_us` does not divide a frame, or trainings do not fit. All of this is checked before a
/// network runs.
pub fn evaluate(
    events: &Path,
    options: &Options<'_>,
    workers: &Workers,
    mut done: impl FnMut(&str, Duration),
) -> Result<Evaluation<Report>, EvaluateError> {
    if options.every_us < 1 || PERIOD_US % options.every_us != 0 {
        let expected = format!("a time between predictions that divides {PERIOD_US} us");
        return Err(EvaluateError::request(RequestPart::Every, expected, format!("{} us", options.every_us)));
    }
    let (candidates, notes) = candidates::<Force>(options.request)?;
    let recordings = Presses::read(events)?;
    let mut cases = Cases::default();
    (0..recordings.len()).for_each(|number| cases.push(&number.to_string(), 1));
    let all: Vec<usize> = (0..recordings.len()).collect();
    let mut plans = Vec::new();
    for candidate in &candidates {
        recordings.check(candidate.description.name(), &Quantity::of(&candidate.description))?;
        plans.push((candidate, candidate.stride()?, cases.trials(&candidate.trainings, &all, |_| Ok(()))?));
    }

    let start = Instant::now();
    let mut logits = TensorFile::new(BTreeMap::new());
    workers.expect(plans.iter().flat_map(|(.., trials)| trials).map(Trial::cases).sum());
    let mut done = |training: &Training| done(&training.label, start.elapsed());
    let mut networks = Vec::new();
    for (candidate, stride, trials) in &plans {
        let judged = Judge { recordings: &recordings, workers, options, stride: *stride };
        networks.push(judged.network(candidate, trials, &mut logits, &mut done)?);
    }
    let took = start.elapsed();

    let name = events.display().to_string();
    let sensor = recordings.streams.sensor();
    let parts = recordings.streams.parts();
    let count = parts.iter().map(|part| part.len() as u64).sum();
    let input = InputCard::events(&name, &"safetensors", sensor, Some(count));
    let report = Report {
        header: Header::of_many("eval force", input),
        data: DataReport {
            recordings: recordings.len(),
            events: count,
            variance: variance(&recordings),
            notes,
            warnings: lost(&name, sensor, parts.iter().map(|part| part.iter())),
            file: name,
        },
        every_us: options.every_us,
        period_us: PERIOD_US,
        networks,
    };
    Ok(Evaluation { report, logits, took })
}

/// The variance of the true force at the ends of all frames.
fn variance(recordings: &Presses) -> f64 {
    let forces = (0..recordings.len()).flat_map(|number| {
        let [start, end] = recordings.truth.span_us(number);
        let ends = (start + PERIOD_US..=end).step_by(PERIOD_US as usize);
        ends.map(move |t_us| recordings.truth.at(FORCE, number, t_us).unwrap_or(0.0))
    });
    let forces: Vec<f64> = forces.collect();
    let mean = forces.iter().sum::<f64>() / forces.len().max(1) as f64;
    forces.iter().map(|force| (force - mean) * (force - mean)).sum::<f64>() / forces.len().max(1) as f64
}

/// Judges networks on one file of recordings.
struct Judge<'a> {
    recordings: &'a Presses,
    workers: &'a Workers,
    options: &'a Options<'a>,
    stride: usize,
}

impl Judge<'_> {
    fn network(
        &self,
        candidate: &Candidate<AnyDescription>,
        trials: &[Trial],
        logits: &mut TensorFile,
        mut done: impl FnMut(&Training),
    ) -> Result<NetworkReport, EvaluateError> {
        let Candidate { description, trainings } = candidate;
        let sensor = self.recordings.streams.sensor();
        let every_us = match description {
            AnyDescription::Events(_) => self.options.every_us,
            AnyDescription::Frames(_) => PERIOD_US,
        };
        let (mut judged, mut traces) = (Vec::new(), None);
        for trial in trials {
            let outcomes = trial.outcomes(&mut done, |training, chosen| {
                let engine = match description {
                    AnyDescription::Events(_) => {
                        PressEngine::new(description, training, sensor, self.options.mode)
                    }
                    AnyDescription::Frames(frames) => {
                        PressEngine::counts(frames, training, sensor, HowCounts::default())
                    }
                }?;
                self.workers.for_each(&engine, chosen, |engine: &mut PressEngine, &number: &usize| {
                    judge(engine, self.recordings, number, self.stride, (every_us, PERIOD_US))
                })
            })?;
            let outcomes: Vec<Outcome> = outcomes.into_iter().map(|(_, outcome)| outcome).collect();
            let values: Vec<f32> = outcomes
                .iter()
                .flat_map(|outcome| outcome.values.iter().map(|&value| value as f32))
                .collect();
            trial.write(description.name(), 1, &values, logits);
            let trace = |outcome: &Outcome| {
                outcome.truth.iter().copied().zip(outcome.values.iter().copied()).collect()
            };
            traces.get_or_insert_with(|| outcomes.iter().map(trace).collect());
            judged.push((trial, ForceErrors::new(&outcomes)));
        }
        let weights = candidate.weights();
        let mut card = ModelCard::new(description, &trainings[0].weights, weights.clone())?;
        card.network.stride = self.stride;
        let figures = judged::Judged::new(judged);
        Ok(NetworkReport { card, weights, figures, traces: traces.unwrap_or_default() })
    }
}

#[cfg(test)]
mod tests;
