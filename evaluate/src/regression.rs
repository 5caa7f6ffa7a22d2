//! Regression over events: networks that predict quantities, such as the angles of a contact, at any time of a press.
//!
//! Enters: a file of streams of events with the truth along time, and networks with their trainings. Leaves: a [`Report`] and
//! the outputs at the end of each press. A press begins with a reset, and its figures are computed from its predictions in a
//! fixed order, so that the number of threads changes no bit, except in measured times and in what depends on them.
//!
//! | time | meaning |
//! |---|---|
//! | contact | where the label `depth` leaves 0; without such a label, the first time of the truth |
//! | end | the last time of the truth |
//! | predictions | every [`Options::every_us`] before and after contact, and at the end |

mod embedding;
pub(crate) mod engine;
mod errors;
pub(crate) mod press;
pub(crate) mod quantity;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use meissner_models::{AnyDescription, TensorFile};
use meissner_pipeline::losses::LossWarning;
use meissner_pipeline::model::describe_any;
use meissner_pipeline::predictor::Mode;
use meissner_pipeline::provenance::{Header, InputCard, ModelCard};
use serde::Serialize;

pub use errors::{Errors, OutputErrors, Work};

use crate::error::{EvaluateError, RequestPart, TrainingError};
use crate::events::lost;
use crate::judged;
use crate::trainings::{Candidate, Evaluation, HeldOut, Metadata, Request, Task, Training, candidates};
use crate::trials::{Cases, Trial};
use crate::workers::Workers;
use embedding::embedding;
use engine::PressEngine;
use press::{Outcome, Presses};
use quantity::Quantity;

/// The task of predicting quantities from events.
#[derive(Clone, Copy, Debug)]
pub struct Regression;

impl Task for Regression {
    type Description = AnyDescription;
    const PREFIX: &'static str = "";

    fn describe(network: &str) -> Result<(AnyDescription, bool), EvaluateError> {
        let (description, shipped) = describe_any(network)?;
        if description.classes().is_some() {
            let expected = "networks that predict quantities";
            let found = format!("{network}, which predicts classes");
            return Err(EvaluateError::request(RequestPart::Networks, expected, found));
        }
        Ok((description, shipped))
    }

    fn name(description: &AnyDescription) -> &str {
        description.name()
    }

    /// A file of presses is unseen as a whole.
    fn held_out(_: Metadata<'_>) -> Result<Option<HeldOut>, TrainingError> {
        Ok(None)
    }
}

/// The networks to be judged, and when predictions are read.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Networks, of which there is at least one, and trainings.
    pub request: Request<'a>,
    /// Every `stride`-th event of a press is pushed; `None` for the stride of the trainings.
    pub stride: Option<usize>,
    /// Microseconds from one prediction to the next.
    pub every_us: i64,
    /// How predictions of networks over events are computed.
    pub mode: Mode,
    /// Whether readouts are embedded in two dimensions.
    pub embeds: bool,
}

/// Figures of all networks, with the keys of the JSON report.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Report {
    pub header: Header,
    pub data: DataReport,
    /// "incremental" or "batch".
    pub mode: &'static str,
    /// Microseconds from one prediction to the next.
    pub every_us: i64,
    /// Times since contact of `mean_absolute_at`; the last one is at or after the end of every press.
    pub times_us: Vec<i64>,
    pub networks: Vec<NetworkReport>,
}

/// The presses that networks are judged on.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct DataReport {
    pub file: String,
    pub presses: usize,
    pub events: u64,
    /// Names of the labels along time.
    pub labels: Vec<String>,
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
    /// Every `stride`-th event was pushed.
    pub stride: usize,
    /// Figures of the trainings; `None` for a file without presses.
    pub figures: Option<Judged>,
    /// True and predicted values at the end of each press, in the units of the report, for each output of the first training.
    #[serde(skip)]
    pub scatter: Vec<Vec<(f64, f64)>>,
    /// A point for each press, from what the first training reads out of it, where this was asked for; frame networks and
    /// fewer than seven presses have none.
    #[serde(skip)]
    pub embedding: Option<Vec<(f64, f64)>>,
}

/// Figures of several trainings on the same presses.
pub type Judged = judged::Judged<Errors>;

/// Judges the networks of `options` on the presses in the safetensors file `events`, with the threads of `workers`. `done` is
/// called after each training with its label and the time since judging began.
///
/// The file has streams as `meissner simulate markers` writes them, with a label for each output of each network.
///
/// # Errors
/// The file or a network cannot be read, or trainings do not fit. All of this is checked before a network runs.
pub fn evaluate(
    events: &Path,
    options: &Options<'_>,
    workers: &Workers,
    mut done: impl FnMut(&str, Duration),
) -> Result<Evaluation<Report>, EvaluateError> {
    let (candidates, notes) = candidates::<Regression>(options.request)?;
    let presses = Presses::read(events)?;
    let mut cases = Cases::default();
    (0..presses.len()).for_each(|press| cases.push(&press.to_string(), 1));
    let all: Vec<usize> = (0..presses.len()).collect();
    let mut plans = Vec::new();
    for candidate in &candidates {
        let quantities = Quantity::of(&candidate.description);
        presses.check(candidate.description.name(), &quantities)?;
        let own = candidate.stride();
        let stride = options.stride.map_or(own, Ok)?;
        plans.push((candidate, quantities, stride, cases.trials(&candidate.trainings, &all, |_| Ok(()))?));
    }

    let start = Instant::now();
    let mut logits = TensorFile::new(BTreeMap::new());
    workers.expect(plans.iter().flat_map(|(.., trials)| trials).map(Trial::cases).sum());
    let judge = Judge { presses: &presses, workers, options };
    let mut done = |training: &Training| done(&training.label, start.elapsed());
    let networks = plans.iter().map(|(candidate, quantities, stride, trials)| {
        judge.network(candidate, quantities, *stride, trials, &mut logits, &mut done)
    });
    let networks = networks.collect::<Result<Vec<_>, _>>()?;
    let took = start.elapsed();

    let name = events.display().to_string();
    let sensor = presses.streams.sensor;
    let parts = presses.streams.parts();
    let count = parts.iter().map(|part| part.len() as u64).sum();
    let stride = options.stride.unwrap_or(1);
    let report = Report {
        header: Header::of_many("eval angle", InputCard::events(&name, &"safetensors", sensor, Some(count))),
        data: DataReport {
            presses: presses.len(),
            events: count,
            labels: presses.labels(),
            notes,
            warnings: lost(&name, sensor, parts.iter().map(|part| part.iter().step_by(stride))),
            file: name,
        },
        mode: options.mode.word(),
        every_us: options.every_us,
        times_us: presses.times(options.every_us),
        networks,
    };
    Ok(Evaluation { report, logits, took })
}

/// Judges networks on one file of presses.
struct Judge<'a> {
    presses: &'a Presses,
    workers: &'a Workers,
    options: &'a Options<'a>,
}

impl Judge<'_> {
    fn network(
        &self,
        candidate: &Candidate<AnyDescription>,
        quantities: &[Quantity],
        stride: usize,
        trials: &[Trial],
        logits: &mut TensorFile,
        mut done: impl FnMut(&Training),
    ) -> Result<NetworkReport, EvaluateError> {
        let Candidate { description, trainings } = candidate;
        let Options { every_us, embeds, .. } = *self.options;
        let times = self.presses.times(self.options.every_us).len();
        let (mut judged, mut first) = (Vec::new(), None);
        for trial in trials {
            let outcomes = trial.outcomes(&mut done, |training, chosen| {
                let engine =
                    PressEngine::new(description, training, self.presses.streams.sensor, self.options.mode)?;
                let work = |engine: &mut PressEngine, &press: &usize| {
                    self.presses.judge(engine, press, quantities, stride, every_us, embeds)
                };
                self.workers.for_each(&engine, chosen, work)
            })?;
            let values: Vec<f32> =
                outcomes.iter().flat_map(|(_, outcome)| outcome.values.iter().copied()).collect();
            trial.write(description.name(), quantities.len(), &values, logits);
            let outcomes: Vec<Outcome> = outcomes.into_iter().map(|(_, outcome)| outcome).collect();
            first.get_or_insert_with(|| {
                let readouts: Option<Vec<_>> =
                    outcomes.iter().map(|outcome| outcome.readout.clone()).collect();
                let embedding = readouts.and_then(|readouts| embedding(&readouts));
                (errors::scatter(&outcomes, quantities), embedding)
            });
            judged.push((trial, Errors::new(quantities, &outcomes, times)));
        }
        let weights = candidate.weights();
        let mut card = ModelCard::new(description, &trainings[0].weights, weights.clone())?;
        card.network.stride = stride;
        let (scatter, embedding) = first.unwrap_or_default();
        Ok(NetworkReport { card, weights, stride, figures: judged::Judged::new(judged), scatter, embedding })
    }
}

#[cfg(test)]
mod tests;
