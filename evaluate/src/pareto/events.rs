//! The studies of networks over events: one recording without labels, and the tasks on events.
//!
//! Streams are timed from an empty window on. Errors are of recordings that a training has not
//! seen; with several trainings, the first one is timed.
//!
//! Input: streams, and recordings with labels where there are any. Output: a [`Measurement`] of
//! each setting, in turns with the exact network. A prediction is read after each accepted event,
//! stands until the next one, and is compared at every event.
//!
//! Answers: every recording begins with a reset, so the number of threads changes no count. Where a
//! prediction depends on earlier reads (tolerance, stale readout), a prediction is read after each
//! event, as in timing; otherwise at the end.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::{self as engine, Counters, EngineError, Event, Network, Outcome, Sensor};
use meissner_models::{DEFAULT_NETWORK, Description};
use meissner_run::approximations::Approximations;
use meissner_run::fingerprint::Fingerprint;
use meissner_run::model::{Model, WeightsFile, describe, labelled, weights};
use meissner_run::predictor::{EventPredictor, Mode};
use meissner_run::source::Source;

use super::measurement::{Differences, Lap, Measurement, spread, take_turns, timed_label};
use super::report::DataReport;
use super::settings::{Setting, mean_rate, settings};
use super::task_error::TaskError;
use super::{NetworkReport, NetworkStudy, Options, Study};
use crate::error::{EvaluateError, RequestPart, Result, weights_error};
use crate::events::{EventData, EventTask, lost};
use crate::metrics::predicted;
use crate::regression::engine::row_costs;
use crate::trainings::{EvaluatedNetwork, Request, Training, candidates};
use crate::trials::{Fold, Trial};
use crate::workers::Workers;

/// Default number of timed events.
const EVENTS: usize = 20_000;

/// The part of a recording and the networks of a study without labels.
#[derive(Clone, Copy, Debug)]
pub struct AngleOptions<'a> {
    /// Names of shipped networks or description files; none for [`DEFAULT_NETWORK`].
    pub networks: &'a [String],
    /// Weights of the only network.
    pub weights: Option<WeightsFile<'a>>,
    /// Accepts weights that were trained on another preparation of the input.
    pub ignore_preparation: bool,
    /// Size of the sensor, instead of the recording's.
    pub sensor: Option<Sensor>,
    /// Events of the first so many microseconds are left out.
    pub from_us: i64,
}

/// The study of networks over events on `source`, a recording without labels.
///
/// # Errors
/// The recording has no events, its sensor is unknown, or a network does not fit.
pub fn angle(source: Source, asked: AngleOptions<'_>, options: &Options) -> Result<Study<'static>> {
    let (name, sensor) = (source.name.clone(), source.sensor(asked.sensor)?);
    let all = source.collect::<Result<Vec<Event>, _>>()?;
    let count = options.timed.unwrap_or(EVENTS);
    // In i128, because times may be any i64.
    let begin = i128::from(all.first().map_or(0, |event| event.t_us)) + i128::from(asked.from_us);
    let taken = all.iter().filter(|event| i128::from(event.t_us) >= begin);
    let events: Vec<Event> = taken.copied().take(count).collect();
    if events.is_empty() {
        return Err(EvaluateError::request(RequestPart::Recording, "events to measure", "none"));
    }
    let mut notes: Vec<String> =
        lost(&name, sensor, [&events]).into_iter().map(|lost| lost.message).collect();

    let default = [DEFAULT_NETWORK.to_owned()];
    let names = if asked.networks.is_empty() { &default[..] } else { asked.networks };
    if asked.weights.is_some() && names.len() > 1 {
        return Err(EvaluateError::OneNetwork { found: names.len() });
    }
    let mut networks: Vec<NetworkStudy<'static>> = Vec::new();
    for name in names {
        let (description, shipped) = describe(name)?;
        let (weights, label) = weights(name, shipped, asked.weights)?;
        let Model { network, card, .. } =
            Model::of(&description, (&weights, label.clone()), asked.ignore_preparation)?;
        let stride = card.network.stride;
        if stride > 1 {
            let found = format!("{name}, whose weights say \"stride\" {stride}");
            let expected = "weights of networks that take every event";
            return Err(EvaluateError::request(RequestPart::Networks, expected, found));
        }
        notes.extend(card.warnings(Some([sensor.width, sensor.height])));
        if networks.iter().any(|other| other.report.network == network.name()) {
            return Err(EvaluateError::twice(name));
        }
        let mut fingerprint = Fingerprint::default();
        fingerprint.text(&format!("{description:?}"));
        fingerprint.weights(&weights);
        let (name, streams) = (network.name().to_owned(), vec![events.clone()]);
        let network = EventNetwork { network, sensor, streams, repeats: options.repeats, judge: None };
        networks.push(network.study(NetworkReport::new(name, labelled(label, &weights), fingerprint))?);
    }
    let mut fingerprint = Fingerprint::default();
    fingerprint.text(&sensor.to_string());
    fingerprint.events(&events);
    let (size, timed) = (all.len() as u64, events.len() as u64);
    let data = DataReport { name, recordings: 1, size, timed, fingerprint: fingerprint.finish() };
    Ok(Study { system: "angle", unit: "event", asked: count, data, networks, notes })
}

/// The study of networks for a task, on the data set in `folder`: on the split test, or of the
/// cross-validation if a network has folds, which must be `folds` in number.
///
/// # Errors
/// The data set or a network cannot be read, or trainings do not fit.
pub fn events<'a, T: EventTask>(
    folder: &Path,
    request: Request<'_>,
    folds: Option<usize>,
    options: &Options,
    workers: &'a Workers,
) -> Result<Study<'a>> {
    let (candidates, more_notes) = candidates::<T>(request)?;
    let strides = candidates.iter().map(EvaluatedNetwork::stride).collect::<Result<Vec<_>, _>>()?;
    let data = Arc::new(T::read(folder)?);
    let asked = options.timed.unwrap_or(EVENTS);
    let (mut networks, mut timed) = (Vec::new(), 0);
    for (EvaluatedNetwork { description, trainings }, stride) in candidates.into_iter().zip(strides) {
        // Folds if there are any, else whole trainings.
        let mut trials = data.trials(&trainings, folds)?;
        let has_folds = trials.iter().any(|trial| trial.scheme.is_some());
        trials.retain(|trial| trial.scheme.is_some() == has_folds);
        data.has_test(&trials)?;
        let of = if has_folds { "cross-validation" } else { "split test" };
        let taken = |place: usize| data.recordings[place].events.iter().copied().step_by(stride);
        let Fold { training: first, cases } = &trials[0].folds[0];
        let streams = spread(cases, |place| taken(place).len(), asked);
        let streams: Vec<Vec<Event>> = streams.into_iter().map(|place| taken(place).collect()).collect();
        timed = timed.max(streams.iter().map(|events| events.len() as u64).sum());
        let network = description.network(&first.weights).map_err(weights_error(&first.label))?;
        let mut fingerprint = Fingerprint::default();
        fingerprint.text(&format!("{description:?}, every {stride}"));
        let all = || trials.iter().flat_map(|trial| &trial.folds);
        for Fold { training, cases } in all() {
            fingerprint.weights(&training.weights);
            cases.iter().for_each(|&place| fingerprint.text(&data.recordings[place].name));
        }
        let label = timed_label(all().count(), &first.label);
        let (sensor, name) = (data.set.sensor, description.name().to_owned());
        let judge = Some(Judge { of, data: Arc::clone(&data), stride, description, trials, workers });
        let network = EventNetwork { network, sensor, streams, repeats: options.repeats, judge };
        networks.push(network.study(NetworkReport::new(name, label, fingerprint))?);
    }
    let mut fingerprint = Fingerprint::default();
    for recording in &data.recordings {
        fingerprint.text(&recording.name);
        fingerprint.text(&recording.class.to_string());
        fingerprint.events(&recording.events);
    }
    let report = DataReport {
        name: folder.display().to_string(),
        recordings: data.recordings.len() as u64,
        size: data.events(),
        timed,
        fingerprint: fingerprint.finish(),
    };
    let notes = data.notes.iter().cloned().chain(more_notes).collect();
    Ok(Study { system: data.set.task, unit: "event", asked, data: report, networks, notes })
}

const TURN: usize = 1000;

/// A network over events with its data.
struct EventNetwork<'a> {
    network: Network,
    sensor: Sensor,
    /// The timed streams; each begins with a reset.
    streams: Vec<Vec<Event>>,
    repeats: u32,
    /// Answers against labels, where there are any.
    judge: Option<Judge<'a>>,
}

/// Trainings of a network with labelled recordings.
struct Judge<'a> {
    /// The part of the data set, for reports.
    of: &'static str,
    data: Arc<EventData>,
    /// Every `stride`-th event of a recording is taken.
    stride: usize,
    description: Description,
    trials: Vec<Trial>,
    workers: &'a Workers,
}

struct Run {
    engine: EventPredictor,
    last: Vec<f32>,
    /// Predictions after each event in the last turn.
    outputs: Vec<f32>,
}

impl<'a> EventNetwork<'a> {
    fn study(self, report: NetworkReport) -> Result<NetworkStudy<'a>> {
        let settings = settings(&self.network, mean_rate(&self.streams), 0);
        // If a setting does not fit the network, the error comes before any measurement.
        settings.iter().try_for_each(|setting| setting.network(&self.network).map(drop))?;
        let names = settings.iter().map(|setting| setting.name.clone()).enumerate().collect();
        let measure = Box::new(move |setting: usize| self.measure(&settings[setting]));
        Ok(NetworkStudy { report, settings: names, measure })
    }

    fn measure(&self, setting: &Setting) -> Result<Measurement> {
        let adapted = Arc::new(setting.network(&self.network)?);
        let exact = Arc::new(self.network.clone());
        let mut own = Run::new(Arc::clone(&adapted), self.sensor, &setting.approximations)?;
        let mut exact = Run::new(exact, self.sensor, &Approximations::default())?;
        let mut differences = Differences::default();
        let (mut counters, outputs) = (own.engine.counters(), self.network.outputs());
        let timing = take_turns(
            (&mut exact, &mut own),
            (&self.streams, self.repeats, TURN),
            Run::reset,
            Run::push,
            |(first, count), exact, own| {
                counters = own.engine.counters();
                let pairs = exact.outputs.chunks_exact(outputs).zip(own.outputs.chunks_exact(outputs));
                for (place, (exact, own)) in pairs.enumerate() {
                    differences.add((first + place, count), exact, own);
                }
            },
        )?;
        let timed = self.streams.iter().map(|events| events.len() as u64).sum();
        let per_event = |count: u64| count as f64 / timed as f64;
        let Counters { layers, .. } = counters;
        let costs = row_costs(&adapted);
        let products = layers.iter().zip(&costs).map(|(layer, cost)| layer.recomputed * cost).sum();
        let passed = own.engine.events().pushed / u64::from(self.repeats);
        let task = match &self.judge {
            Some(judge) => judge.error(setting)?.into_iter().collect(),
            None => Vec::new(),
        };
        Ok(Measurement {
            timed,
            entered: per_event(passed),
            timing,
            rows: per_event(layers.iter().map(|layer| layer.recomputed).sum()),
            multiply_adds: per_event(products),
            numerical: differences.finish(),
            task,
        })
    }
}

impl Run {
    fn new(
        network: Arc<Network>,
        sensor: Sensor,
        approximations: &Approximations,
    ) -> Result<Self, EngineError> {
        let engine = EventPredictor::new(
            Mode::Incremental,
            network,
            sensor,
            approximations,
            engine::Options::default(),
        )?;
        Ok(Self { engine, last: Vec::new(), outputs: Vec::new() })
    }

    /// Forgets all events, and predicts from the empty window.
    fn reset(&mut self) -> Result<(), EngineError> {
        self.engine.reset();
        self.last.clear();
        self.last.extend_from_slice(self.engine.predict()?.values);
        Ok(())
    }

    /// Pushes `events`, and stores the prediction after each of them.
    fn push(&mut self, events: &[Event], lap: &mut Lap) -> Result<(), EngineError> {
        self.outputs.clear();
        for &event in events {
            let (passes, filtering) = self.engine.admit(event);
            let start = Instant::now();
            let accepted = passes && self.engine.push(event) == Outcome::Accepted;
            let push = filtering + start.elapsed();
            let mut predict = Duration::ZERO;
            if accepted {
                let start = Instant::now();
                let prediction = self.engine.predict();
                predict = start.elapsed();
                self.last.copy_from_slice(prediction?.values);
            }
            lap.push((push, push + predict));
            self.outputs.extend_from_slice(&self.last);
        }
        Ok(())
    }
}

impl Judge<'_> {
    /// The share of wrong answers with `setting`; `None` without answers.
    fn error(&self, setting: &Setting) -> Result<Option<TaskError>> {
        let count = |trial: &Trial| {
            let wrong = trial.outcomes(|_| (), |training, chosen| self.wrong(training, chosen, setting))?;
            Ok((wrong.iter().filter(|(_, wrong)| *wrong).count() as u64, wrong.len() as u64))
        };
        let counts = self.trials.iter().map(count).collect::<Result<Vec<_>>>()?;
        Ok(TaskError::new(self.of, &counts))
    }

    /// Whether the answer for each of the recordings `chosen` is wrong.
    fn wrong(&self, training: &Training, chosen: &[usize], setting: &Setting) -> Result<Vec<bool>> {
        let network = self.description.network(&training.weights).map_err(weights_error(&training.label))?;
        let network = Arc::new(setting.network(&network)?);
        let (sensor, approximations) = (self.data.set.sensor, &setting.approximations);
        let engine = EventPredictor::new(
            Mode::Incremental,
            network,
            sensor,
            approximations,
            engine::Options::default(),
        )?;
        let is_wrong = |engine: &mut EventPredictor, &recording: &usize| {
            let recording = &self.data.recordings[recording];
            let events = recording.events.iter().copied().step_by(self.stride);
            Ok::<_, EngineError>(answer(engine, events, setting.reads_matter())? != recording.class)
        };
        self.workers.for_each(&engine, chosen, is_wrong)
    }
}

/// The class at the end of `events`; a prediction is read after `each` event, or only at the end.
fn answer(
    engine: &mut EventPredictor,
    events: impl Iterator<Item = Event>,
    each: bool,
) -> Result<usize, EngineError> {
    engine.reset();
    for event in events {
        let (passes, _) = engine.admit(event);
        if passes && engine.push(event) == Outcome::Accepted && each {
            engine.predict()?;
        }
    }
    Ok(predicted(engine.predict()?.values))
}
