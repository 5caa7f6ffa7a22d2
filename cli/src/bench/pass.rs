//! One engine over all events, every call timed.
//!
//! Enters: the events and their phases. Leaves: histograms for each phase, and the engine with its counters. What an
//! event brought about counts for it: its push, predictions that were due before it could enter, and the one due
//! after it; at the end of the stream, also the last one.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::{Event, LatePolicy, Network, Options, Outcome, Sensor};

use super::phases::{Phase, Phases};
use crate::args::{ApproximationArgs, Every};
use crate::error::CliError;
use crate::progress::Progress;
use meissner_pipeline::filtered::FilteredEngine;
use meissner_pipeline::latency::Latency;
use meissner_pipeline::schedule::{Last, Schedule};

/// What all passes have in common.
pub(super) struct Passes {
    pub(super) network: Arc<Network>,
    pub(super) sensor: Sensor,
    pub(super) late: LatePolicy,
    pub(super) approximations: ApproximationArgs,
    pub(super) every: Every,
    pub(super) progress: Progress,
    /// Events taken so far, over all passes.
    pub(super) taken: u64,
}

/// Latencies of one phase, over any number of passes.
#[derive(Debug)]
pub(super) struct Latencies {
    pub(super) push: Latency,
    pub(super) predict: Latency,
    /// What each event brought about.
    pub(super) push_predict: Latency,
    /// Rows that were computed.
    pub(super) rows: u64,
}

/// What the latency passes leave.
#[derive(Debug)]
pub(super) struct Measured {
    pub(super) idle: Latencies,
    pub(super) burst: Latencies,
    /// Most events in the window after any push.
    pub(super) nodes_max: usize,
}

impl Latencies {
    fn new() -> Self {
        Self { push: Latency::new(), predict: Latency::new(), push_predict: Latency::new(), rows: 0 }
    }

    /// Reads a prediction, at `due_us` where that is given; the number of events in its window.
    fn read(
        &mut self,
        front: &mut FilteredEngine,
        due_us: Option<i64>,
        both: &mut Duration,
    ) -> Result<usize, CliError> {
        let start = Instant::now();
        if let Some(due_us) = due_us {
            front.readout.advance(due_us);
        }
        let prediction = front.readout.predict();
        let spent = start.elapsed();
        let prediction = prediction?;
        self.predict.record(spent);
        self.rows += prediction.rows.iter().sum::<u64>();
        *both += spent;
        Ok(prediction.nodes)
    }
}

impl Measured {
    /// Nothing yet.
    pub(super) fn new() -> Self {
        Self { idle: Latencies::new(), burst: Latencies::new(), nodes_max: 0 }
    }

    /// Idle, then burst.
    pub(super) fn phases(&self) -> [&Latencies; 2] {
        [&self.idle, &self.burst]
    }
}

impl Passes {
    /// A new engine.
    pub(super) fn front(&self, stage_times: bool) -> Result<FilteredEngine, CliError> {
        let options = Options::new().with_late(self.late).with_stage_times(stage_times);
        Ok(FilteredEngine::new(
            Arc::clone(&self.network),
            self.sensor,
            &self.approximations.values(),
            options,
        )?)
    }

    /// The next event has been taken.
    pub(super) fn count(&mut self) {
        self.taken += 1;
        self.progress.set(self.taken);
    }

    /// A new engine over `events`, the first of those in `phases`; measures `into`.
    pub(super) fn latency(
        &mut self,
        events: &[Event],
        phases: &Phases,
        stage_times: bool,
        into: &mut Measured,
    ) -> Result<FilteredEngine, CliError> {
        let mut front = self.front(stage_times)?;
        let mut schedule = Schedule::new(self.every, self.sensor, self.late);
        for (index, &event) in events.iter().enumerate() {
            let latencies = match phases.of(index) {
                Phase::Idle => &mut into.idle,
                Phase::Burst => &mut into.burst,
            };
            let mut both = Duration::ZERO;
            let (passes, filtering) = front.admit(event);
            // What a filter drops moves no time on.
            let arrival_us = if passes { schedule.arrival_us(event) } else { None };
            if let Some(t_us) = arrival_us {
                while let Some(due_us) = schedule.due_before(t_us) {
                    if latencies.read(&mut front, Some(due_us), &mut both)? == 0 {
                        schedule.skip_to(t_us);
                    }
                }
            }
            let start = Instant::now();
            let accepted = passes && front.readout.push(event) == Outcome::Accepted;
            let spent = filtering + start.elapsed();
            latencies.push.record(spent);
            both += spent;
            if accepted && schedule.is_due_after_event() {
                latencies.read(&mut front, None, &mut both)?;
            }
            if index + 1 == events.len()
                && let Last::At(due_us) = schedule.last()
            {
                latencies.read(&mut front, Some(due_us), &mut both)?;
            }
            latencies.push_predict.record(both);
            into.nodes_max = into.nodes_max.max(front.engine().nodes());
            self.count();
        }
        Ok(front)
    }
}
