//! A network over events with each of its settings.
//!
//! Enters: streams of events, and recordings with labels where there are any. Leaves: a
//! [`Measurement`] of each setting. The exact network and the setting take turns. A prediction is
//! read after each event that enters, and stands until the next one. It is compared with the exact
//! prediction at every event.
//!
//! Answers: every recording begins with a reset, so the number of threads changes no count. Where a
//! prediction depends on earlier reads (tolerance, stale readout), a prediction is read after each
//! event, as in timing; otherwise at the end.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::{Counters, EngineError, Event, Network, Options, Outcome, Sensor};
use meissner_models::Description;
use meissner_run::approximations::Approximations;
use meissner_run::predictor::{EventPredictor, Mode};

use super::measurement::{Differences, Lap, Measurement, take_turns};
use super::settings::{Setting, mean_rate, settings};
use super::task_error::TaskError;
use super::{NetworkReport, NetworkStudy};
use crate::error::{EvaluateError, weights_error};
use crate::events::EventData;
use crate::metrics::predicted;
use crate::regression::engine::row_costs;
use crate::trainings::Training;
use crate::trials::Trial;
use crate::workers::Workers;

/// Events of a turn.
const TURN: usize = 1000;

/// A network over events with its data.
pub(super) struct EventNetwork<'a> {
    /// The exact network.
    pub(super) network: Network,
    pub(super) sensor: Sensor,
    /// The timed streams; each begins with a reset.
    pub(super) streams: Vec<Vec<Event>>,
    pub(super) repeats: u32,
    /// Answers against labels, where there are any.
    pub(super) judge: Option<Judge<'a>>,
}

/// Trainings of a network with labelled recordings.
pub(super) struct Judge<'a> {
    /// The part of the data set, for reports.
    pub(super) of: &'static str,
    pub(super) data: Arc<EventData>,
    /// Every `stride`-th event of a recording is taken.
    pub(super) stride: usize,
    pub(super) description: Description,
    pub(super) trials: Vec<Trial>,
    pub(super) workers: &'a Workers,
}

/// An engine that is timed.
struct Run {
    engine: EventPredictor,
    /// The last prediction.
    last: Vec<f32>,
    /// Predictions after each event of the last turn.
    outputs: Vec<f32>,
}

impl<'a> EventNetwork<'a> {
    /// The study of this network, for a `report` without settings.
    pub(super) fn study(self, report: NetworkReport) -> Result<NetworkStudy<'a>, EvaluateError> {
        let settings = settings(&self.network, mean_rate(&self.streams), 0);
        // A network that a setting does not fit is refused before anything is measured.
        settings.iter().try_for_each(|setting| setting.network(&self.network).map(drop))?;
        let names = settings.iter().map(|setting| setting.name.clone()).enumerate().collect();
        let measure = Box::new(move |setting: usize| self.measure(&settings[setting]));
        Ok(NetworkStudy { report, settings: names, measure })
    }

    fn measure(&self, setting: &Setting) -> Result<Measurement, EvaluateError> {
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
        let engine =
            EventPredictor::new(Mode::Incremental, network, sensor, approximations, Options::default())?;
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
    fn error(&self, setting: &Setting) -> Result<Option<TaskError>, EvaluateError> {
        let count = |trial: &Trial| {
            let wrong = trial.outcomes(|_| (), |training, chosen| self.wrong(training, chosen, setting))?;
            Ok((wrong.iter().filter(|(_, wrong)| *wrong).count() as u64, wrong.len() as u64))
        };
        let counts = self.trials.iter().map(count).collect::<Result<Vec<_>, EvaluateError>>()?;
        Ok(TaskError::new(self.of, &counts))
    }

    /// Whether the answer for each of the recordings `chosen` is wrong.
    fn wrong(
        &self,
        training: &Training,
        chosen: &[usize],
        setting: &Setting,
    ) -> Result<Vec<bool>, EvaluateError> {
        let network = self.description.network(&training.weights).map_err(weights_error(&training.label))?;
        let network = Arc::new(setting.network(&network)?);
        let (sensor, approximations) = (self.data.set.sensor, &setting.approximations);
        let engine =
            EventPredictor::new(Mode::Incremental, network, sensor, approximations, Options::default())?;
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
