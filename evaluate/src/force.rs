//! Contact force over time: networks that predict the force of a grasp from its events.
//!
//! Input: a file of recordings with the force along time, and networks. Output: a [`Report`] with
//! errors over all frames, by phase and by bolt, and the predicted forces. A recording begins with
//! a reset. The force at the end of each [`PERIOD_US`] counts. The number of threads changes no
//! bit, except in measured times and figures that depend on them.

pub(crate) mod recording;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use meissner_models::{AnyDescription, TensorFile};
use meissner_run::losses::LossWarning;
use meissner_run::model::describe_any;
use meissner_run::predictor::Mode;
use meissner_run::provenance::{Header, InputCard, ModelCard};
use serde::Serialize;

use crate::error::{EvaluateError, RequestPart, Result, TrainingError};
use crate::events::lost;
use crate::judge::{Judge, JudgedTrial, NetworkReport, judge};
use crate::regression::engine::{CountsOptions, PressEngine};
use crate::regression::press::{Presses, Quantity};
use crate::trainings::{
    EvaluatedNetwork, Evaluation, HeldOut, Metadata, Request, Task, Training, candidates,
};
use crate::trials::Trial;
use crate::workers::Workers;
use recording::{FORCE, Outcome, run};
pub use recording::{ForceErrors, PartErrors};

/// Length of a frame in microseconds.
pub const PERIOD_US: i64 = 10_000;

/// The task of predicting the force of a grasp.
#[derive(Clone, Copy, Debug)]
pub struct Force;

impl Task for Force {
    type Description = AnyDescription;
    const PREFIX: &'static str = "force-";

    fn describe(network: &str) -> Result<(AnyDescription, bool)> {
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

    /// The recordings that a fold held out, by number; a whole training has seen no recording.
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
    /// Microseconds from one prediction of a network over events to the next; a divisor of
    /// [`PERIOD_US`].
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
    pub networks: Vec<NetworkReport<ForceFigures>>,
}

/// The recordings that networks are judged on.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct DataReport {
    pub file: String,
    pub recordings: usize,
    pub events: u64,
    /// Variance of the true force in N^2: the mean squared error of a network that predicts the
    /// mean.
    pub variance: f64,
    /// Remarks about the trainings, for people.
    pub notes: Vec<String>,
    /// Warnings about events that networks drop.
    pub warnings: Vec<LossWarning>,
}

/// Figures of a network.
#[derive(Serialize)]
pub struct ForceFigures {
    /// Figures of the trainings; `None` for a file without recordings.
    pub figures: Option<Judged>,
    /// True and predicted force at the end of each frame, for each recording in the first trial.
    #[serde(rename = "pairs", serialize_with = "crate::thinned::of_all")]
    pub traces: Vec<Vec<(f64, f64)>>,
}

/// Figures of several trainings on the same recordings.
pub type Judged = crate::judge::Judged<ForceErrors>;

/// Judges the networks of `options` on the recordings in `events`; `done` gets each training.
///
/// The file is one of `meissner simulate grasp`; the labels `phase` and `bolt` may be missing.
///
/// # Errors
/// The file or a network cannot be read, `every_us` divides no frame, or trainings do not fit.
pub fn evaluate(
    events: &Path,
    options: &Options<'_>,
    workers: &Workers,
    done: impl FnMut(&str, Duration),
) -> Result<Evaluation<Report>> {
    if options.every_us < 1 || PERIOD_US % options.every_us != 0 {
        let expected = format!("a time between predictions that divides {PERIOD_US} us");
        return Err(EvaluateError::request(RequestPart::Every, expected, format!("{} us", options.every_us)));
    }
    let (candidates, notes) = candidates::<Force>(options.request)?;
    let recordings = Presses::read(events)?;
    let of_force = OfForce { recordings: &recordings, options };
    let judged = judge(&of_force, &candidates, TensorFile::new(BTreeMap::new()), workers, done)?;

    let name = events.display().to_string();
    let sensor = recordings.streams.sensor();
    let parts = recordings.streams.parts();
    let count = parts.iter().map(|part| part.len() as u64).sum();
    let input = InputCard::events(&name, &"safetensors", sensor, Some(count));
    Ok(judged.evaluation(|networks| Report {
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
    }))
}

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

struct OfForce<'a> {
    recordings: &'a Presses,
    options: &'a Options<'a>,
}

/// A network's stride, and the time between its predictions.
#[derive(Clone, Copy)]
struct Plan {
    stride: usize,
    every_us: i64,
}

/// True and predicted force at the end of each frame.
type Trace = Vec<(f64, f64)>;

impl Judge for OfForce<'_> {
    type Task = Force;
    type Plan = Plan;
    type Engine = PressEngine;
    type Outcome = Outcome;
    type Figures = (Option<ForceErrors>, Vec<Trace>);
    type Network = ForceFigures;

    fn plan(&self, candidate: &EvaluatedNetwork<AnyDescription>) -> Result<(Plan, Vec<Trial>)> {
        let description = &candidate.description;
        self.recordings.check(description.name(), &Quantity::of(description))?;
        let every_us = match description {
            AnyDescription::Events(_) => self.options.every_us,
            AnyDescription::Frames(_) => PERIOD_US,
        };
        let plan = Plan { stride: candidate.stride()?, every_us };
        Ok((plan, self.recordings.trials(&candidate.trainings)?))
    }

    fn engine(&self, description: &AnyDescription, _: &Plan, training: &Training) -> Result<PressEngine> {
        let sensor = self.recordings.streams.sensor();
        match description {
            AnyDescription::Events(_) => PressEngine::new(description, training, sensor, self.options.mode),
            AnyDescription::Frames(frames) => {
                PressEngine::counts(frames, training, sensor, CountsOptions::default())
            }
        }
    }

    fn outcome(&self, plan: &Plan, engine: &mut PressEngine, number: usize) -> Result<Outcome> {
        run(engine, self.recordings, number, plan.stride, (plan.every_us, PERIOD_US))
    }

    fn figures(&self, _: &Plan, mut judged: JudgedTrial<'_, Outcome>) -> Self::Figures {
        judged.write(1, |outcome| outcome.values.iter().map(|&value| value as f32).collect());
        let outcomes = judged.into_outcomes();
        let trace =
            |outcome: &Outcome| outcome.truth.iter().copied().zip(outcome.values.iter().copied()).collect();
        (ForceErrors::new(&outcomes), outcomes.iter().map(trace).collect())
    }

    fn network(
        &self,
        plan: Plan,
        card: &mut ModelCard,
        mut judged: Vec<(Trial, Self::Figures)>,
    ) -> ForceFigures {
        card.network.stride = plan.stride;
        let traces = judged.first_mut().map(|(_, (_, traces))| std::mem::take(traces)).unwrap_or_default();
        let figures = judged.into_iter().map(|(trial, (errors, _))| (trial, errors));
        ForceFigures { figures: Judged::new(figures), traces }
    }
}

#[cfg(test)]
mod tests;
