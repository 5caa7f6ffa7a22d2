//! Runs a network over events, and predicts whenever a prediction is due.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::{ClockWatch, Decision, Engine, Event, Options, Outcome, RestartPolicy, Sensor};

use super::prediction::{EventPrediction, Observer, Prediction};
use super::summary::{EventSummary, Summary};
use super::{EVERY, RunOptions, Saver, Steps, StreamRun};
use crate::answer::{Classes, Values};
use crate::approximations::Approximations;
use crate::clock::Passed;
use crate::error::{Result, RunError};
use crate::latency::{Latencies, Latency, microseconds};
use crate::losses::{InputLosses, LossWarning};
use crate::model::Model;
use crate::predictor::EventPredictor;
use crate::schedule::{Last, Schedule};
use crate::source::Source;
use crate::training::Training;
use crate::work_counts::{WorkCounts, dropped};

/// A network over events with its source, before the run.
pub type EventRun = StreamRun<EventSteps>;

/// Pushes events into a network over events, and reads its predictions.
pub struct EventSteps {
    predictor: EventPredictor,
    approximations: Approximations,
    layers: Vec<String>,
    schedule: Schedule,
    /// Decides about restarts before schedule and engine, which get events at their own time.
    watch: ClockWatch,
    classes: Classes,
    training: Training,
    passed: Passed,
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
    /// The engine refuses the sensor, an approximation, or (as [`RunError::Resume`]) the state.
    pub fn new(model: &Model, source: Source, sensor: Sensor, options: RunOptions) -> Result<Self> {
        let network = Arc::new(model.network.clone());
        let layers = network.layers().into_iter().map(str::to_owned).collect();
        let RunOptions {
            mode, every, late, restart, approximations, two_threads, limit, resume, save, ..
        } = options;
        let watch = ClockWatch::new(restart, sensor, network.parts().span_us);
        let engine_options =
            Options::new().with_late(late).with_restart(RestartPolicy::Keep).with_two_threads(two_threads);
        let mut predictor = EventPredictor::new(mode, network, sensor, &approximations, engine_options)?;
        let mut schedule = Schedule::new(every.unwrap_or(EVERY));
        if let Some(bytes) = resume {
            predictor = predictor.resume(&bytes).map_err(RunError::Resume)?;
            if let Some(engine) = predictor.engine()
                && let (Some(first_us), Some(now_us)) = (engine.epoch_us(), engine.now_us())
            {
                schedule.resume(first_us, now_us, engine.counters().events.accepted);
            }
        }
        let steps = EventSteps {
            epoch_us: predictor.engine().and_then(Engine::epoch_us),
            predictor,
            approximations,
            layers,
            schedule,
            watch,
            classes: Classes::new(model.card.classes.clone()),
            training: Training::new(&model.card.outputs),
            passed: Passed::default(),
            push: Latency::new(),
            predict: Latency::new(),
            update: Duration::ZERO,
            taken: 0,
            nodes_max: 0,
        };
        Ok(Self { source, sensor, limit: limit.unwrap_or(u64::MAX), saver: save.map(Saver::new), steps })
    }
}

impl Steps for EventSteps {
    fn take(&mut self, event: Event, observer: &mut dyn Observer) -> Result<()> {
        match self.watch.decide(event, self.predictor.now_us()) {
            None => self.enter(event, observer),
            Some(decision) => self.carry_out(&decision, observer),
        }
    }

    fn taken(&self) -> u64 {
        self.taken
    }

    fn now_us(&self) -> Option<i64> {
        self.predictor.engine().and_then(Engine::now_us)
    }

    fn state(&mut self) -> Option<Vec<u8>> {
        self.predictor.engine().map(Engine::to_bytes)
    }

    fn settle(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let decision = self.watch.end(self.predictor.now_us());
        self.carry_out(&decision, observer)
    }

    fn finish(&mut self, resumes: bool, observer: &mut dyn Observer) -> Result<()> {
        match self.schedule.last() {
            Last::Now => self.read(None, observer)?,
            Last::At(due_us) if !resumes => self.read(Some(due_us), observer)?,
            Last::Nothing | Last::At(_) => 0,
        };
        Ok(())
    }

    fn losses(&self, source: &Source, sensor: Sensor) -> InputLosses {
        source.losses(self.predictor.events(), sensor)
    }

    fn summary(self, source: Source, warnings: Vec<LossWarning>) -> Summary {
        let counters = self.predictor.counters();
        let spent = self.push.total() + self.predict.total();
        let seconds = spent.as_secs_f64();
        self.training.warn(&source.name);
        let events = counters.events.pushed;
        Summary::Events(Box::new(EventSummary {
            events,
            lines_refused: source.lines_refused(),
            accepted: counters.events.accepted,
            dropped: dropped(&counters.events),
            restarts: counters.events.restarts,
            predictions: counters.predictions.read,
            nodes_max: self.nodes_max,
            latency_us: Latencies::of([("push", &self.push), ("predict", &self.predict)]),
            events_per_s: (events > 0 && seconds > 0.0).then(|| events as f64 / seconds),
            real_time: self.passed.times_real_time(spent),
            outside_training: self.training.outside(),
            unlike_training: self.training.unlike(),
            skips: WorkCounts::new(&counters, &self.layers),
            warnings,
            approximations: self.predictor.report(&self.approximations),
            salvaged: source.salvaged,
        }))
    }
}

impl EventSteps {
    fn carry_out(&mut self, decision: &Decision, observer: &mut dyn Observer) -> Result<()> {
        self.predictor.decided(decision);
        self.taken += decision.outliers;
        if decision.restarts {
            self.schedule.restart();
            self.passed.restart();
            self.epoch_us = None;
        }
        decision.taken.events().iter().try_for_each(|&event| self.enter(event, observer))
    }

    /// Takes an event whose time agrees with the clock.
    fn enter(&mut self, event: Event, observer: &mut dyn Observer) -> Result<()> {
        let (passes, filtering) = self.predictor.admit(event);
        if !passes {
            self.pushed(filtering);
            return Ok(());
        }
        if let Some(t_us) = self.schedule.arrival_us(|| self.predictor.arrival_us(event)) {
            while let Some(due_us) = self.schedule.due_before(t_us) {
                if self.read(Some(due_us), observer)? == 0 {
                    self.schedule.skip_to(t_us);
                }
            }
        }
        let start = Instant::now();
        let outcome = self.predictor.push(event);
        self.pushed(filtering + start.elapsed());
        self.nodes_max = self.nodes_max.max(self.predictor.nodes());
        if outcome == Outcome::Accepted {
            self.epoch_us = self.epoch_us.or(Some(event.t_us));
            self.passed.event(event.t_us);
            if self.schedule.is_due_after_event() {
                self.read(None, observer)?;
            }
        } else {
            tracing::debug!(?event, ?outcome, "not accepted");
        }
        Ok(())
    }

    fn pushed(&mut self, spent: Duration) {
        self.push.record(spent);
        self.update += spent;
        self.taken += 1;
    }

    /// Reads a prediction, at `due_us` if given; returns the number of events in its window.
    fn read(&mut self, due_us: Option<i64>, observer: &mut dyn Observer) -> Result<usize> {
        let start = Instant::now();
        if let Some(due_us) = due_us {
            self.predictor.advance(due_us);
        }
        let prediction = self.predictor.predict();
        let spent = start.elapsed();
        self.predict.record(spent);
        self.update += spent;
        let prediction = prediction?;
        tracing::trace!(prediction.t_us, prediction.nodes, rows = ?prediction.rows, ?spent, "predicted");
        let now_us = due_us.or(prediction.t_us);
        self.classes.update(prediction.values);
        self.training.update(prediction.values, prediction.unlike);
        let shown = EventPrediction {
            t_us: prediction.t_us,
            value: Values(prediction.values),
            answer: self.classes.answer(),
            outside_training: self.training.newest(),
            unlike: prediction.unlike,
            nodes: prediction.nodes,
            rows: prediction.rows,
            update_us: microseconds(std::mem::take(&mut self.update)),
            at_us: now_us,
            elapsed_us: now_us.zip(self.epoch_us).map(|(now, epoch)| i128::from(now) - i128::from(epoch)),
            taken: self.taken,
        };
        observer.prediction(&Prediction::Events(shown)).map_err(RunError::Output)?;
        Ok(prediction.nodes)
    }
}
