//! Regression over events: quantities such as the angles of a contact, at any time of a press.
//!
//! Input: a file of streams with the truth along time, and networks. Output: a [`Report`] and the
//! outputs at the end of each press. A press begins with a reset: threads change no bit, except in
//! measured times and figures that depend on them.
//!
//! | time | meaning |
//! |---|---|
//! | contact | where the label `depth` leaves 0; without it, the first time of the truth |
//! | end | the last time of the truth |
//! | predictions | every [`Options::every_us`] before and after contact, and at the end |

pub(crate) mod engine;
mod errors;
pub(crate) mod press;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use bhtsne::tSNE;
use meissner_kernels::random::Random;
use meissner_models::{AnyDescription, TensorFile};
use meissner_run::losses::LossWarning;
use meissner_run::model::describe_any;
use meissner_run::predictor::Mode;
use meissner_run::provenance::{Header, InputCard, ModelCard};
use rayon::ThreadPoolBuilder;
use serde::Serialize;

use crate::error::{EvaluateError, RequestPart, Result};
use crate::events::lost;
use crate::judge::{Judge, JudgedTrial, NetworkReport, judge};
use crate::trainings::{EvaluatedNetwork, Evaluation, Request, Task, Training, candidates};
use crate::trials::Trial;
use crate::workers::Workers;
use engine::PressEngine;
pub use errors::{Errors, OutputErrors, PressDoubts, Work};
use press::{Outcome, Presses, Quantity};

/// The task of predicting quantities from events.
#[derive(Clone, Copy, Debug)]
pub struct Regression;

impl Task for Regression {
    type Description = AnyDescription;
    const PREFIX: &'static str = "";

    fn describe(network: &str) -> Result<(AnyDescription, bool)> {
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
}

/// The networks to be judged, and when predictions are read.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Networks, at least one, and trainings.
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
    /// Times since contact of `mean_absolute_at`, up to the end of every press.
    pub times_us: Vec<i64>,
    pub networks: Vec<NetworkReport<PressFigures>>,
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
pub struct PressFigures {
    /// Every `stride`-th event was pushed.
    pub stride: usize,
    /// Figures of the trainings; `None` for a file without presses.
    pub figures: Option<Judged>,
    /// True and predicted values at the end of each press, for each output of the first training.
    #[serde(rename = "pairs", serialize_with = "crate::thinned::of_each")]
    pub scatter: Vec<Vec<(f64, f64)>>,
    /// A point for each press, from the first training's readout, if requested.
    #[serde(skip)]
    pub embedding: Option<Vec<(f64, f64)>>,
}

/// Figures of several trainings on the same presses.
pub type Judged = crate::judge::Judged<Errors>;

/// Judges the networks of `options` on the presses in `events`; `done` gets each training.
///
/// The file is one of `meissner simulate markers`, with a label for each output.
///
/// # Errors
/// The file or a network cannot be read, or trainings do not fit: before a network runs.
pub fn evaluate(
    events: &Path,
    options: &Options<'_>,
    workers: &Workers,
    done: impl FnMut(&str, Duration),
) -> Result<Evaluation<Report>> {
    let (candidates, notes) = candidates::<Regression>(options.request)?;
    let presses = Presses::read(events)?;
    let times_us = presses.times(options.every_us);
    let of_presses = OfPresses { presses: &presses, options, times: times_us.len() };
    let judged = judge(&of_presses, &candidates, TensorFile::new(BTreeMap::new()), workers, done)?;

    let name = events.display().to_string();
    let sensor = presses.streams.sensor;
    let parts = presses.streams.parts();
    let count = parts.iter().map(|part| part.len() as u64).sum();
    let stride = options.stride.unwrap_or(1);
    Ok(judged.evaluation(|networks| Report {
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
        times_us,
        networks,
    }))
}

struct OfPresses<'a> {
    presses: &'a Presses,
    options: &'a Options<'a>,
    /// Number of times of errors.
    times: usize,
}

/// What a network predicts, and its stride.
struct Plan {
    quantities: Vec<Quantity>,
    stride: usize,
}

/// Figures of a trial: true and predicted values of each output, and the embedding.
type OfTrial = (Option<Errors>, Vec<Vec<(f64, f64)>>, Option<Vec<(f64, f64)>>);

impl Judge for OfPresses<'_> {
    type Task = Regression;
    type Plan = Plan;
    type Engine = PressEngine;
    type Outcome = Outcome;
    type Figures = OfTrial;
    type Network = PressFigures;

    fn plan(&self, candidate: &EvaluatedNetwork<AnyDescription>) -> Result<(Plan, Vec<Trial>)> {
        let quantities = Quantity::of(&candidate.description);
        self.presses.check(candidate.description.name(), &quantities)?;
        let own = candidate.stride();
        let stride = self.options.stride.map_or(own, Ok)?;
        Ok((Plan { quantities, stride }, self.presses.trials(&candidate.trainings)?))
    }

    fn engine(&self, description: &AnyDescription, _: &Plan, training: &Training) -> Result<PressEngine> {
        PressEngine::new(description, training, self.presses.streams.sensor, self.options.mode)
    }

    fn outcome(
        &self,
        Plan { quantities, stride }: &Plan,
        engine: &mut PressEngine,
        press: usize,
    ) -> Result<Outcome> {
        let Options { every_us, embeds, .. } = *self.options;
        self.presses.judge(engine, press, quantities, *stride, every_us, embeds)
    }

    fn figures(&self, plan: &Plan, mut judged: JudgedTrial<'_, Outcome>) -> OfTrial {
        judged.write(plan.quantities.len(), |outcome| outcome.values.clone());
        let outcomes = judged.into_outcomes();
        let readouts: Option<Vec<_>> = outcomes.iter().map(|outcome| outcome.readout.clone()).collect();
        (
            Errors::new(&plan.quantities, &outcomes, self.times),
            errors::scatter(&outcomes, &plan.quantities),
            readouts.and_then(|readouts| embedding(&readouts)),
        )
    }

    fn network(&self, plan: Plan, card: &mut ModelCard, mut judged: Vec<(Trial, OfTrial)>) -> PressFigures {
        card.network.stride = plan.stride;
        let (scatter, embedding) = judged
            .first_mut()
            .map(|(_, (_, scatter, embedding))| (std::mem::take(scatter), embedding.take()))
            .unwrap_or_default();
        let figures = judged.into_iter().map(|(trial, (errors, ..))| (trial, errors));
        PressFigures { stride: plan.stride, figures: Judged::new(figures), scatter, embedding }
    }
}

/// Neighbours that determine a point; there must be at least three times as many presses.
const PERPLEXITY: usize = 30;
const EPOCHS: usize = 1_000;
/// Size of the square in which the points begin.
const START: f32 = 1e-4;

/// A point for each of `readouts`; `None` for too few. O(presses^2 (channels + epochs)), in one
/// thread, so that the order of the sums over points is always the same.
///
/// # Panics
/// If the system cannot start a thread.
pub(super) fn embedding(readouts: &[Vec<f32>]) -> Option<Vec<(f64, f64)>> {
    let perplexity = PERPLEXITY.min(readouts.len().checked_sub(1)? / 3);
    if perplexity < 2 {
        return None;
    }
    let start = Random::new(1).values(2 * readouts.len(), START);
    let distance =
        |a: &Vec<f32>, b: &Vec<f32>| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt();
    let thread = ThreadPoolBuilder::new().num_threads(1).build().expect("the system has a thread");
    let points = thread.install(|| {
        let mut plane: tSNE<'_, f32, Vec<f32>, 2> = tSNE::new(readouts);
        plane.perplexity(perplexity as f32).epochs(EPOCHS).initial_embedding(start);
        plane.exact(distance);
        plane.embedding()
    });
    Some(points.chunks(2).map(|point| (f64::from(point[0]), f64::from(point[1]))).collect())
}

#[cfg(test)]
mod tests;
