//! Measures a network over events, with every call timed.
//!
//! Input: the events. Output: histograms for each phase, and the counters of the engine. The cost
//! of an event is its push, and the predictions due before it and after it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::{Admission, Engine, Event, Network, Options, Outcome, Sensor, Stage};
use serde::Serialize;

use super::deadline::{Deadline, DeadlineReport};
use super::phases::{Phase, Phases, WINDOW_US};
use super::{BenchInput, BenchOptions, InputReport};
use crate::approximations::ApproximationReport;
use crate::error::Result;
use crate::latency::{CallLatencies, Latency, clock_us, microseconds};
use crate::memory::peak_resident_bytes;
use crate::model::Model;
use crate::predictor::{EventPredictor, Mode};
use crate::schedule::{Every, Last, Schedule};
use crate::work_counts::WorkCounts;

/// The default period of the deadline report.
const PERIOD_US: i64 = 1000;
/// The default number of events of a slice.
const SLICE: usize = 64;

/// A benchmark of a network over events.
pub struct EventBench<'a> {
    model: &'a Model,
    input: BenchInput,
    options: BenchOptions,
}

/// The report of a network over events. Counts are of one pass, except in distributions.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct EventReport {
    #[serde(flatten)]
    pub input: InputReport,
    pub warmup_events: u64,
    /// Threads that share the work of a prediction.
    pub threads: usize,
    /// Overhead of the clock, which is included in every push and prediction.
    pub clock_us: f64,
    pub predictions: u64,
    /// Largest number of events in the window after any push.
    pub nodes_max: usize,
    /// Times of calls.
    pub latency_us: CallLatencies,
    /// Events divided by the time in pushes and predictions.
    pub events_per_s: Option<f64>,
    /// Bursts, and the other events.
    pub phases: PhasesReport,
    pub skips: WorkCounts,
    /// The approximations, in one pass; `None` if results are exact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub approximations: Option<ApproximationReport>,
    pub work: Work,
    /// Times of the stages in a separate pass; empty if no time was spent.
    pub stages: Vec<StageReport>,
    pub memory: MemoryReport,
    pub slices: SlicesReport,
    pub deadline: DeadlineReport,
}

/// Events that are pushed in slices, with a prediction after each.
#[derive(Debug, Default, Serialize)]
#[non_exhaustive]
pub struct SlicesReport {
    /// Events of a slice; the last may have fewer.
    pub events: usize,
    /// Events of all slices divided by the time in pushes and predictions.
    pub events_per_s: Option<f64>,
    /// Time of a push and the prediction: the delay until a prediction covers the last event.
    pub latency_us: Latency,
}

/// Events of bursts, and the others.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct PhasesReport {
    /// Stream time before an event that determines the phase of the event.
    pub window_us: i64,
    /// Mean rate of the accepted events.
    pub mean_rate_events_per_s: Option<f64>,
    /// Minimum rate of a burst.
    pub burst_rate_events_per_s: Option<f64>,
    pub idle: PhaseReport,
    pub burst: PhaseReport,
}

/// Events of one phase.
#[derive(Debug, Default, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct PhaseReport {
    pub events: u64,
    /// Rows computed over all layers; `None` without events.
    pub rows_per_event: Option<f64>,
    pub latency_us: CallLatencies,
    /// Rows computed, over any number of passes.
    #[serde(skip)]
    rows: u64,
}

/// Rows and multiply-adds.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Work {
    pub rows_per_event: f64,
    pub multiply_adds_per_event: f64,
    /// Multiply-adds divided by the time of the layer stages, in the pass that measured stages.
    pub multiply_adds_per_s: Option<f64>,
    pub layers: Vec<LayerWork>,
}

/// Rows and multiply-adds of a layer.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct LayerWork {
    pub name: String,
    pub rows_per_event: f64,
    /// At full neighbourhoods.
    pub multiply_adds_per_row: u64,
    pub multiply_adds_per_event: f64,
}

/// Time of a stage.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct StageReport {
    pub name: &'static str,
    pub us_per_event: f64,
    /// Share of the time of all stages.
    pub share: f64,
}

/// Memory of the engine and of the process.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct MemoryReport {
    /// Approximate size of a new engine.
    pub state_bytes: u64,
    /// Peak resident memory after the latency passes, with the recording, if it is known.
    pub peak_resident_bytes: Option<u64>,
}

#[derive(Default)]
struct Measured {
    idle: PhaseReport,
    burst: PhaseReport,
    /// Largest number of events in the window after any push.
    nodes_max: usize,
}

/// Function that is called after each event, with the number of events so far and the engine.
pub type Progress<'a> = dyn FnMut(u64, &EventPredictor) + 'a;

impl<'a> EventBench<'a> {
    /// A benchmark of `model` over `input`.
    pub fn new(model: &'a Model, input: BenchInput, options: BenchOptions) -> Self {
        Self { model, input, options }
    }

    /// Total number of events of all passes.
    pub fn total(&self) -> u64 {
        self.input.events.len() as u64 * (2 * u64::from(self.options.repeat.max(1)) + 2)
            + self.warmup() as u64
    }

    fn warmup(&self) -> usize {
        usize::try_from(self.options.warmup).unwrap_or(usize::MAX).min(self.input.events.len())
    }

    /// Runs all passes, and calls `progress` with the number of events taken so far and the engine
    /// that took the last one.
    ///
    /// # Errors
    /// The engine refuses an option, or a result is not a number.
    pub fn run(self, progress: &mut Progress<'_>) -> Result<EventReport> {
        let Self { model, input, options, .. } = &self;
        let (events, repeat) = (&input.events, options.repeat.max(1));
        let phases = Phases::new(events, input.sensor, options.late, options.burst_rate);
        let network = Arc::new(model.network.clone());
        let mut passes = Passes { network, sensor: input.sensor, options, progress, taken: 0 };

        let clock_us = clock_us();
        let warmup = self.warmup();
        passes.latency(&events[..warmup], &phases, false, &mut Measured::default())?;
        let mut measured = Measured::default();
        let mut engine = passes.latency(events, &phases, false, &mut measured)?;
        for _ in 1..repeat {
            engine = passes.latency(events, &phases, false, &mut measured)?;
        }
        let slice = if options.slice == 0 { SLICE } else { options.slice };
        let mut slices = SlicesReport { events: slice, ..SlicesReport::default() };
        for _ in 0..repeat {
            passes.slices(events, &mut slices)?;
        }
        let seconds = slices.latency_us.total().as_secs_f64();
        let all = events.len() as f64 * f64::from(repeat);
        slices.events_per_s = (seconds > 0.0).then(|| all / seconds);
        // Measured before the other passes, which also use memory.
        let peak_resident_bytes = peak_resident_bytes();
        let staged = passes.latency(events, &phases, true, &mut Measured::default())?;
        let deadline = passes.deadline(events, options.period_us.unwrap_or(PERIOD_US))?;

        let [Some(run), Some(staged)] = [engine.engine(), staged.engine()] else {
            unreachable!("the predictors are incremental");
        };
        let counters = engine.counters();
        let Measured { mut idle, mut burst, nodes_max } = measured;
        let mut latency_us = CallLatencies::default();
        for (phase, of) in [(Phase::Idle, &mut idle), (Phase::Burst, &mut burst)] {
            of.events = phases.count(phase);
            let measured = of.events as f64 * f64::from(repeat);
            of.rows_per_event = (of.events > 0).then(|| of.rows as f64 / measured);
            latency_us.add(&of.latency_us);
        }
        let seconds = latency_us.push_predict.total().as_secs_f64();
        let skips = WorkCounts::new(&counters, &model.network.layers());
        let count = counters.events.pushed;
        let losses = input.losses(engine.events());
        Ok(EventReport {
            input: input.report(&counters.events, &losses, repeat),
            warmup_events: warmup as u64,
            threads: if options.two_threads { 2 } else { 1 },
            clock_us,
            predictions: counters.predictions.read,
            nodes_max,
            events_per_s: (seconds > 0.0).then(|| latency_us.push.count() as f64 / seconds),
            latency_us,
            phases: PhasesReport {
                window_us: WINDOW_US,
                mean_rate_events_per_s: phases.mean_rate,
                burst_rate_events_per_s: phases.burst_rate,
                idle,
                burst,
            },
            work: Work::new(&skips, &model.multiply_adds, count, staged),
            skips,
            approximations: engine.report(&options.approximations),
            stages: stages(staged, count),
            memory: MemoryReport {
                state_bytes: u64::try_from(run.state_bytes()).unwrap_or(u64::MAX),
                peak_resident_bytes,
            },
            slices,
            deadline: deadline.report(),
        })
    }
}

struct Passes<'a> {
    network: Arc<Network>,
    sensor: Sensor,
    options: &'a BenchOptions,
    progress: &'a mut Progress<'a>,
    /// Events taken so far, over all passes.
    taken: u64,
}

impl Passes<'_> {
    fn engine(&self, stage_times: bool) -> Result<EventPredictor> {
        let options = Options::new().with_late(self.options.late).with_restart(self.options.restart);
        let options = options.with_stage_times(stage_times).with_two_threads(self.options.two_threads);
        let options = options.with_record_rows(self.options.record_rows);
        let network = Arc::clone(&self.network);
        let approximations = &self.options.approximations;
        Ok(EventPredictor::new(Mode::Incremental, network, self.sensor, approximations, options)?)
    }

    fn count(&mut self, engine: &EventPredictor) {
        self.taken += 1;
        (self.progress)(self.taken, engine);
    }

    /// Runs a new engine over `events`, the first in `phases`; latencies go to `into`.
    fn latency(
        &mut self,
        events: &[Event],
        phases: &Phases,
        stage_times: bool,
        into: &mut Measured,
    ) -> Result<EventPredictor> {
        let mut engine = self.engine(stage_times)?;
        let mut schedule = Schedule::new(self.options.every.unwrap_or(Every::Events(1)));
        for (index, &event) in events.iter().enumerate() {
            let phase = match phases.of(index) {
                Phase::Idle => &mut into.idle,
                Phase::Burst => &mut into.burst,
            };
            let mut both = Duration::ZERO;
            let (passes, filtering) = engine.admit(event);
            // Dropped events do not advance the clock.
            if passes && let Some(t_us) = schedule.arrival_us(|| engine.arrival_us(event)) {
                schedule.each_due_before(t_us, |due_us| phase.read(&mut engine, Some(due_us), &mut both))?;
            }
            let start = Instant::now();
            let accepted = passes && engine.push(event) == Outcome::Accepted;
            let spent = filtering + start.elapsed();
            phase.latency_us.push.record(spent);
            both += spent;
            if accepted && schedule.is_due_after_event() {
                phase.read(&mut engine, None, &mut both)?;
            }
            if index + 1 == events.len()
                && let Last::At(due_us) = schedule.last()
            {
                phase.read(&mut engine, Some(due_us), &mut both)?;
            }
            phase.latency_us.push_predict.record(both);
            into.nodes_max = into.nodes_max.max(engine.nodes());
            self.count(&engine);
        }
        Ok(engine)
    }

    /// Runs a new engine over slices of `events`, and records their latencies in `into`.
    fn slices(&mut self, events: &[Event], into: &mut SlicesReport) -> Result<()> {
        let mut engine = self.engine(false)?;
        for slice in events.chunks(into.events) {
            let start = Instant::now();
            engine.push_slice(slice);
            let prediction = engine.predict().map(drop);
            into.latency_us.record(start.elapsed());
            prediction?;
            slice.iter().for_each(|_| self.count(&engine));
        }
        Ok(())
    }

    /// Runs a new engine over `events`, in periods of `period_us`.
    fn deadline(&mut self, events: &[Event], period_us: i64) -> Result<Deadline> {
        let mut engine = self.engine(false)?;
        let gate = Admission::new(self.sensor, self.options.late);
        let mut gate = gate.with_filters(self.network.filters())?;
        let mut schedule = Schedule::new(Every::StreamUs(period_us));
        let mut deadline = Deadline::new(period_us);
        let mut waiting = Vec::new();
        for &event in events {
            if let Some(t_us) = schedule.arrival_us(|| Some(gate.admit(event).ok()?.t_us)) {
                schedule.each_due_before(t_us, |end_us| {
                    period(&mut deadline, &mut engine, &mut waiting, end_us)
                })?;
            }
            waiting.push(event);
            self.count(&engine);
        }
        if let Last::At(end_us) = schedule.last() {
            period(&mut deadline, &mut engine, &mut waiting, end_us)?;
        }
        Ok(deadline)
    }
}

/// Does the work of the period until `end_us`; returns the number of events in the window.
fn period(
    deadline: &mut Deadline,
    engine: &mut EventPredictor,
    waiting: &mut Vec<Event>,
    end_us: i64,
) -> Result<usize> {
    let before = engine.events();
    let start = Instant::now();
    engine.push_slice(waiting);
    engine.advance(end_us);
    let prediction = engine.predict().map(drop);
    let work = start.elapsed();
    prediction?;
    let after = engine.events();
    let entered = after.accepted - before.accepted;
    let left = (after.expired + after.evicted) - (before.expired + before.evicted);
    deadline.record(entered.max(left), end_us, work);
    waiting.clear();
    Ok(engine.nodes())
}

impl PhaseReport {
    /// Reads a prediction, at `due_us` if given; returns the number of events in its window.
    fn read(
        &mut self,
        engine: &mut EventPredictor,
        due_us: Option<i64>,
        both: &mut Duration,
    ) -> Result<usize> {
        let start = Instant::now();
        if let Some(due_us) = due_us {
            engine.advance(due_us);
        }
        let prediction = engine.predict();
        let spent = start.elapsed();
        let prediction = prediction?;
        self.latency_us.predict.record(spent);
        self.rows += prediction.rows.iter().sum::<u64>();
        *both += spent;
        Ok(prediction.nodes)
    }
}

impl Work {
    fn new(skips: &WorkCounts, multiply_adds: &[u64], events: u64, staged: &Engine) -> Self {
        let per_event = |count: f64| if events > 0 { count / events as f64 } else { 0.0 };
        let layers: Vec<LayerWork> = skips
            .layers
            .iter()
            .zip(multiply_adds)
            .map(|(layer, &of_row)| LayerWork {
                name: layer.name.clone(),
                rows_per_event: per_event(layer.recomputed as f64),
                multiply_adds_per_row: of_row,
                multiply_adds_per_event: per_event(layer.recomputed as f64 * of_row as f64),
            })
            .collect();
        let multiply_adds_per_event = layers.iter().map(|layer| layer.multiply_adds_per_event).sum();
        let is_of_layers = |stage| matches!(stage, Stage::EventLayers | Stage::PooledLayers);
        let times = staged.stage_times();
        let seconds: f64 =
            times.iter().filter(|(stage, _)| is_of_layers(*stage)).map(|(_, time)| time.as_secs_f64()).sum();
        Self {
            rows_per_event: layers.iter().map(|layer| layer.rows_per_event).sum(),
            multiply_adds_per_event,
            multiply_adds_per_s: (seconds > 0.0).then(|| multiply_adds_per_event * events as f64 / seconds),
            layers,
        }
    }
}

fn stages(engine: &Engine, events: u64) -> Vec<StageReport> {
    let times = engine.stage_times().map(|(stage, time)| (stage, microseconds(time)));
    let total: f64 = times.iter().map(|(_, us)| us).sum();
    if total == 0.0 {
        return Vec::new();
    }
    let report = |(stage, us): (Stage, f64)| StageReport {
        name: stage.name(),
        us_per_event: us / events as f64,
        share: us / total,
    };
    times.into_iter().map(report).collect()
}
