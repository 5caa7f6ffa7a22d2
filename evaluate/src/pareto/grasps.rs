//! The study of the force of grasps: event graphs and frame networks, with each of their settings.
//!
//! Input: a file of recordings, and networks. Output: a [`Study`] of the mean squared error of the
//! force, judged as by `eval force`. Times are those of a recording with a prediction for each
//! frame, so that networks of both kinds are on one front. Some recordings are timed, evenly
//! chosen.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use meissner_engine::Event;
use meissner_engine::frames::FrameNetworkParts;
use meissner_models::{AnyDescription, Description, FrameDescription};
use meissner_run::fingerprint::Fingerprint;
use meissner_run::predictor::Mode;

use super::measurement::{Differences, Lap, Measurement, evenly, take_turns, timed_label};
use super::report::DataReport;
use super::settings::{
    FrameSetting, Setting, Thinning, common, has_pixels_to_keep, mean_rate, notes, settings,
};
use super::task_error::{ErrorKind, TaskError};
use super::{NetworkReport, NetworkStudy, Options, Study};
use crate::error::{EvaluateError, RequestPart, Result, weights_error};
use crate::events::lost;
use crate::force::recording::{FORCE, Outcome, run};
use crate::force::{Force, PERIOD_US, PartErrors};
use crate::regression::engine::{Count, CountsOptions, PressEngine};
use crate::regression::press::{Presses, Quantity};
use crate::trainings::{EvaluatedNetwork, Request, Training, candidates};
use crate::trials::{Cases, Fold, Trial};
use crate::workers::Workers;

/// Default number of timed recordings.
const RECORDINGS: usize = 20;
/// Tolerances of counts of events divided by 8: the first is far below one event.
const TOLERANCES: [f32; 4] = [1e-3, 1e-2, 3e-2, 1e-1];

/// The study of networks that predict the force of grasps, on the recordings in the file `events`.
/// Errors are over all recordings, or of the cross-validation if all trainings are folds.
///
/// # Errors
/// The file or a network cannot be read, no recording lasts for a frame, or trainings do not fit.
pub fn force<'a>(
    events: &Path,
    request: Request<'_>,
    options: &Options,
    workers: &'a Workers,
) -> Result<Study<'a>> {
    let (candidates, mut notes_of_all) = candidates::<Force>(request)?;
    let recordings = Arc::new(Presses::read(events)?);
    let name = events.display().to_string();
    let frames = |number: usize| {
        let [start, end] = recordings.truth.span_us(number);
        (end - start) / PERIOD_US
    };
    let all: Vec<usize> = (0..recordings.len()).collect();
    if all.iter().all(|&number| frames(number) < 1) {
        let expected = format!("recordings that last for a frame of {PERIOD_US} us");
        return Err(EvaluateError::request(RequestPart::Events, expected, format!("{name}: none")));
    }
    let mut cases = Cases::default();
    all.iter().for_each(|number| cases.push(&number.to_string(), 1));
    let asked = options.timed.unwrap_or(RECORDINGS);
    let (mut networks, mut most) = (Vec::new(), 0);
    for candidate in candidates {
        recordings.check(candidate.description.name(), &Quantity::of(&candidate.description))?;
        let stride = candidate.stride()?;
        let EvaluatedNetwork { description, trainings } = candidate;
        let trials = cases.trials(&trainings, &all, |_| Ok(()))?;
        let Fold { training: first, cases: unseen } = &trials[0].folds[0];
        if unseen.is_empty() {
            let found = format!("{}, which held out none", first.label);
            return Err(EvaluateError::request(
                RequestPart::Trainings,
                "recordings that are held out",
                found,
            ));
        }
        let timed = evenly(unseen, asked.min(unseen.len()));
        most = most.max(timed.len());
        let name = description.name().to_owned();
        let mut fingerprint = Fingerprint::default();
        fingerprint.text(&format!("{description:?}, every {stride}"));
        let folds = || trials.iter().flat_map(|trial| &trial.folds);
        for Fold { training, cases } in folds() {
            fingerprint.weights(&training.weights);
            cases.iter().for_each(|number| fingerprint.text(&number.to_string()));
        }
        let label = timed_label(folds().count(), &first.label);
        let kind = match description {
            AnyDescription::Events(description) => {
                let network = description.network(&first.weights).map_err(weights_error(&first.label))?;
                let parts = recordings.streams.parts();
                let taken = |&number: &usize| parts[number].iter().copied().step_by(stride).collect();
                let streams: Vec<Vec<Event>> = timed.iter().map(taken).collect();
                let settings = settings(&network, mean_rate(&streams), PERIOD_US);
                settings.iter().try_for_each(|setting| setting.network(&network).map(drop))?;
                Kind::Events(description, settings)
            }
            AnyDescription::Frames(description) => {
                let parts = description.network_parts(&first.weights).map_err(weights_error(&first.label))?;
                notes_of_all.extend(notes(&name, &parts));
                let settings = of_frames(&parts);
                Kind::Frames(description, settings)
            }
        };
        let (recordings, repeats) = (Arc::clone(&recordings), options.repeats);
        let network = GraspsNetwork { kind, trials, recordings, stride, timed, repeats, workers };
        // If an engine refuses the sensor, the error comes before any measurement.
        network.engine(&network.trials[0].folds[0].training, 0)?;
        let (settings, report) = (network.kind.names(), NetworkReport::new(name, label, fingerprint));
        let measure = Box::new(move |setting: usize| network.measure(setting));
        networks.push(NetworkStudy { report, settings, measure });
    }
    let parts = recordings.streams.parts();
    let losses = lost(&name, recordings.streams.sensor(), parts.iter().map(|part| part.iter()));
    notes_of_all.splice(0..0, losses.into_iter().map(|lost| lost.message));
    let (count, fingerprint) = (recordings.len() as u64, fingerprint(&recordings));
    let data = DataReport { name, recordings: count, size: count, timed: most as u64, fingerprint };
    Ok(Study { system: "force", unit: "recording", asked, data, networks, notes: notes_of_all })
}

fn fingerprint(recordings: &Presses) -> String {
    let mut fingerprint = Fingerprint::default();
    fingerprint.text(&recordings.streams.sensor().to_string());
    for (number, part) in recordings.streams.parts().into_iter().enumerate() {
        fingerprint.events(part);
        let (t_us, labels) = recordings.truth.of(number);
        t_us.iter().for_each(|t_us| fingerprint.bytes(&t_us.to_le_bytes()));
        labels.filter(|(name, _)| *name == FORCE).for_each(|(_, values)| fingerprint.floats(values));
    }
    fingerprint.finish()
}

fn of_frames(parts: &FrameNetworkParts) -> Vec<FrameSetting> {
    let seldom = FrameSetting { thinning: Thinning::EverySecond, ..FrameSetting::default() };
    let mut settings = common(parts, &TOLERANCES);
    settings.push(seldom);
    if has_pixels_to_keep(parts) {
        settings.push(FrameSetting { tolerance: Some(1e-2), ..seldom });
    }
    settings
}

enum Kind {
    Events(Description, Vec<Setting>),
    Frames(FrameDescription, Vec<FrameSetting>),
}

impl Kind {
    fn names(&self) -> Vec<(usize, String)> {
        match self {
            Self::Events(_, settings) => {
                settings.iter().map(|setting| setting.name.clone()).enumerate().collect()
            }
            Self::Frames(_, settings) => FrameSetting::names(settings),
        }
    }
}

/// A network over recordings with its trainings and its data.
struct GraspsNetwork<'a> {
    kind: Kind,
    /// The first training of the first trial is timed.
    trials: Vec<Trial>,
    recordings: Arc<Presses>,
    /// Every `stride`-th event of a recording is taken.
    stride: usize,
    timed: Vec<usize>,
    repeats: u32,
    workers: &'a Workers,
}

/// An engine that is timed, with its predictions for the last recording.
struct Timed {
    engine: PressEngine,
    last: Option<Outcome>,
}

impl GraspsNetwork<'_> {
    fn engine(&self, training: &Training, setting: usize) -> Result<PressEngine> {
        let sensor = self.recordings.streams.sensor();
        match &self.kind {
            Kind::Events(description, settings) => {
                let Setting { approximations, .. } = &settings[setting];
                let adapt = |network| settings[setting].network(&network);
                PressEngine::adapted(
                    description,
                    training,
                    (sensor, Mode::Incremental),
                    approximations,
                    adapt,
                )
            }
            Kind::Frames(description, settings) => {
                let of = settings[setting];
                let how = CountsOptions {
                    convolution: of.convolution,
                    options: of.options(),
                    every: of.every() as u64,
                };
                PressEngine::counts(description, training, sensor, how)
            }
        }
    }

    /// The predictions of `engine` for a recording, one at the end of each frame.
    fn run(&self, engine: &mut PressEngine, number: usize) -> Result<Outcome> {
        run(engine, &self.recordings, number, self.stride, (PERIOD_US, PERIOD_US))
    }

    fn measure(&self, setting: usize) -> Result<Measurement> {
        let training = &self.trials[0].folds[0].training;
        let timed =
            |setting| Ok::<_, EvaluateError>(Timed { engine: self.engine(training, setting)?, last: None });
        let (mut own, mut exact) = (timed(setting)?, timed(0)?);
        let mut differences = Differences::default();
        let (mut count, mut computed, mut entered) = (Count::default(), 0, [0; 2]);
        let timing = take_turns(
            (&mut exact, &mut own),
            (std::slice::from_ref(&self.timed), self.repeats, 1),
            |_| Ok::<_, EvaluateError>(()),
            |timed: &mut Timed, chosen, lap| self.time(timed, chosen, lap),
            |_, exact, own| {
                count = own.engine.count();
                computed = own.engine.computed();
                entered = [own, exact].map(|timed| timed.engine.entered());
                let Some((exact, own)) = exact.last.as_ref().zip(own.last.as_ref()) else { return };
                let frames = exact.values.len();
                for (place, (&exact, &own)) in exact.values.iter().zip(&own.values).enumerate() {
                    // Predictions are f32, so nothing is rounded.
                    differences.add((place, frames), &[exact as f32], &[own as f32]);
                }
            },
        )?;
        let per_recording = |count: u64| count as f64 / self.timed.len() as f64;
        Ok(Measurement {
            timed: self.timed.len() as u64,
            // Silent recordings have no events to drop.
            entered: if entered[1] == 0 { 1.0 } else { entered[0] as f64 / entered[1] as f64 },
            timing,
            rows: per_recording(computed),
            multiply_adds: per_recording(count.multiply_adds),
            numerical: differences.finish(),
            task: self.errors(setting)?,
        })
    }

    fn time(&self, timed: &mut Timed, chosen: &[usize], lap: &mut Lap) -> Result<()> {
        for &number in chosen {
            let outcome = self.run(&mut timed.engine, number)?;
            let all = outcome.effort.update_ns.iter().sum();
            lap.push((Duration::from_nanos(outcome.effort.push_ns), Duration::from_nanos(all)));
            timed.last = Some(outcome);
        }
        Ok(())
    }

    fn errors(&self, setting: usize) -> Result<Vec<TaskError>> {
        let mut trials = Vec::new();
        for trial in &self.trials {
            let outcomes = trial.outcomes(
                |_| (),
                |training, chosen| {
                    let engine = self.engine(training, setting)?;
                    self.workers.for_each(&engine, chosen, |engine, &number: &usize| self.run(engine, number))
                },
            )?;
            let outcomes: Vec<Outcome> = outcomes.into_iter().map(|(_, outcome)| outcome).collect();
            trials.extend(PartErrors::of("all", &outcomes, |_, _| true).map(|errors| (errors, outcomes)));
        }
        let is_fold = self.trials.iter().all(|trial| trial.scheme.is_some());
        let of = if is_fold { "cross-validation" } else { "recordings" };
        let sums = |outcomes: &[Outcome], figure: fn(f64) -> f64| {
            outcomes.iter().map(|outcome| outcome.sum(figure)).collect::<Vec<_>>()
        };
        let squares = trials.iter().map(|(errors, all)| (errors.mse, sums(all, |error| error * error)));
        let absolutes = trials.iter().map(|(errors, all)| (errors.mae, sums(all, f64::abs)));
        let squares = TaskError::mean(of, ErrorKind::SquaredForce, squares);
        Ok(squares.into_iter().chain(TaskError::mean(of, ErrorKind::AbsoluteForce, absolutes)).collect())
    }
}

#[cfg(test)]
mod tests;
