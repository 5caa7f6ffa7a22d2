//! Runs a network over the events of a recording or a live stream, and predicts whenever a prediction is due.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::{Admission, Engine, Event, Outcome, Sensor};

use super::prediction::{EventPrediction, Observer, Prediction};
use super::state::{EVERY, RunOptions, Saver};
use super::summary::{Ended, Ending, EventSummary, Summary};
use crate::answer::{Classes, Values};
use crate::approximations::Approximations;
use crate::error::PipelineError;
use crate::interrupt;
use crate::latency::{Latency, microseconds};
use crate::losses::LossWatch;
use crate::model::Model;
use crate::predictor::EventPredictor;
use crate::schedule::{Last, Schedule};
use crate::source::Source;

/// A network over events with its source, before the run.
pub struct EventRun {
    source: Source,
    sensor: Sensor,
    limit: u64,
    approximations: Approximations,
    layers: Vec<String>,
    schedule: Schedule,
    /// Predicts for the schedule which events will be accepted, and at what time.
    gate: Admission,
    saver: Option<Saver>,
    steps: Steps,
}

/// Pushes events and reads predictions.
struct Steps {
    predictor: EventPredictor,
    classes: Classes,
    push: Latency,
    predict: Latency,
    /// Time spent since the last prediction.
    update: Duration,
    /// Time of the first accepted event.
    epoch_us: Option<i64>,
    taken: u64,
    nodes_max: usize,
}

impl EventRun {
    /// A run of `model` over the events of `source`, which come from `sensor`.
    ///
    /// # Errors
    /// The engine refuses the sensor, an approximation, or (as [`PipelineError::Resume`]) the state to resume from.
    pub fn new(
        model: &Model,
        source: Source,
        sensor: Sensor,
        options: RunOptions,
    ) -> Result<Self, PipelineError> {
        let network = Arc::new(model.network.clone());
        let layers = network.layers().into_iter().map(str::to_owned).collect();
        let RunOptions { mode, every, late, approximations, limit, resume, save, .. } = options;
        let mut predictor = EventPredictor::new(mode, network, sensor, late, &approximations)?;
        let mut schedule = Schedule::new(every.unwrap_or(EVERY));
        let mut gate = Admission::new(sensor, late);
        if let Some(bytes) = resume {
            predictor = predictor.resume(&bytes).map_err(PipelineError::Resume)?;
            if let Some(engine) = predictor.engine()
                && let (Some(first_us), Some(now_us)) = (engine.epoch_us(), engine.now_us())
            {
                gate.resume(first_us, now_us);
                schedule.resume(first_us, now_us, engine.counters().events.accepted);
            }
        }
        let steps = Steps {
            epoch_us: predictor.engine().and_then(Engine::epoch_us),
            predictor,
            classes: Classes::new(model.card.classes.clone()),
            push: Latency::new(),
            predict: Latency::new(),
            update: Duration::ZERO,
            taken: 0,
            nodes_max: 0,
        };
        let limit = limit.unwrap_or(u64::MAX);
        Ok(Self {
            source,
            sensor,
            limit,
            approximations,
            layers,
            schedule,
            gate,
            saver: save.map(Saver::new),
            steps,
        })
    }

    /// The source.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// The number of events that the run will take, if it is known.
    pub fn total(&self) -> Option<u64> {
        self.source.remaining().map(|remaining| remaining.min(self.limit))
    }

    /// Takes all events, or the events up to a [requested](interrupt::requested) end.
    pub fn run(mut self, observer: &mut dyn Observer) -> Ended {
        let mut watch = LossWatch::new(self.source.is_live());
        let mut result = Ok(());
        while result.is_ok() && self.steps.taken < self.limit && !interrupt::requested() {
            let Some(event) = self.source.next() else { break };
            result = event.and_then(|event| self.take(event, observer));
            let Self { source, sensor, steps, .. } = &self;
            observer.progress(steps.taken);
            watch.look(steps.taken, &source.name, || source.losses(steps.predictor.events(), *sensor));
        }
        let mut ending = Ending(result);
        if ending.saves() {
            ending.then(self.save());
        }
        if ending.predicts() {
            let due = match self.schedule.last() {
                // Not due yet: another run will resume from the state.
                Last::At(_) if self.saver.is_some() => Ok(0),
                Last::Nothing => Ok(0),
                Last::Now => self.steps.read(None, observer),
                Last::At(due_us) => self.steps.read(Some(due_us), observer),
            };
            ending.then(due.map(drop));
        }
        let Self { source, sensor, steps, .. } = self;
        let counters = steps.predictor.counters();
        let mut summary =
            EventSummary::new(&counters, &self.layers, steps.nodes_max, &steps.push, &steps.predict);
        summary.lines_refused = source.lines_refused();
        summary.warnings = watch.end(&source.name, &source.losses(steps.predictor.events(), sensor));
        summary.approximations = steps.predictor.report(&self.approximations);
        summary.salvaged = source.salvaged;
        Ended { summary: Summary::Events(Box::new(summary)), result: ending.0 }
    }

    fn take(&mut self, event: Event, observer: &mut dyn Observer) -> Result<(), PipelineError> {
        let Self { schedule, gate, steps, .. } = self;
        let (passes, filtering) = steps.predictor.admit(event);
        if !passes {
            steps.pushed(filtering);
            return Ok(());
        }
        if let Some(t_us) = schedule.arrival_us(gate, event) {
            schedule.each_due_before(t_us, |due_us| steps.read(Some(due_us), observer))?;
        }
        let start = Instant::now();
        let outcome = steps.predictor.push(event);
        steps.pushed(filtering + start.elapsed());
        steps.nodes_max = steps.nodes_max.max(steps.predictor.nodes());
        if outcome != Outcome::Accepted {
            return Ok(());
        }
        steps.epoch_us = steps.epoch_us.or(Some(event.t_us));
        if schedule.is_due_after_event() {
            steps.read(None, observer)?;
        }
        // An accepted late event counts at the newest time.
        let now_us = steps.predictor.engine().and_then(Engine::now_us).unwrap_or(event.t_us);
        if self.saver.as_mut().is_some_and(|saver| saver.is_due(now_us)) { self.save() } else { Ok(()) }
    }

    /// Writes the state, if requested.
    fn save(&self) -> Result<(), PipelineError> {
        let Some((saver, engine)) = self.saver.as_ref().zip(self.steps.predictor.engine()) else {
            return Ok(());
        };
        saver.write(&engine.to_bytes())
    }
}

impl Steps {
    /// Notes that an event was taken.
    fn pushed(&mut self, spent: Duration) {
        self.push.record(spent);
        self.update += spent;
        self.taken += 1;
    }

    /// Reads a prediction, for the time `due_us` if it is given, and returns the number of events in its window.
    fn read(&mut self, due_us: Option<i64>, observer: &mut dyn Observer) -> Result<usize, PipelineError> {
        let start = Instant::now();
        if let Some(due_us) = due_us {
            self.predictor.advance(due_us);
        }
        let prediction = self.predictor.predict();
        let spent = start.elapsed();
        self.predict.record(spent);
        self.update += spent;
        let prediction = prediction?;
        let now_us = due_us.or(prediction.t_us);
        self.classes.update(prediction.values);
        let shown = EventPrediction {
            t_us: prediction.t_us,
            value: Values(prediction.values),
            answer: self.classes.answer(),
            nodes: prediction.nodes,
            rows: prediction.rows,
            update_us: microseconds(std::mem::take(&mut self.update)),
            elapsed_us: now_us.zip(self.epoch_us).map(|(now, epoch)| i128::from(now) - i128::from(epoch)),
            taken: self.taken,
        };
        observer.prediction(&Prediction::Events(shown)).map_err(PipelineError::Output)?;
        Ok(prediction.nodes)
    }
}
