//! The engine under soak, and beside it the record of what it accepted.
//!
//! Enters: events and disturbances. Leaves: latencies, and checks against the batch. Invariant: engine and record are given
//! the same, but for what the engine is to forget.

use std::sync::Arc;
use std::time::Instant;

use meissner_engine::{BatchEngine, Engine, Event, EventCounters, Network, Search, Sensor};

use super::disturbance::Disturbance;
use super::endless::Endless;
use super::report::{Calls, Disturbances};
use crate::error::CliError;
use meissner_pipeline::latency::Latency;

/// Latencies of every call.
pub(super) type Timed = Calls<Latency>;

/// A prediction, held against the batch.
#[derive(Debug)]
pub(super) struct Checked {
    pub(super) t_us: Option<i64>,
    pub(super) nodes: usize,
    pub(super) bits: Vec<u32>,
    /// Events that the batch went over.
    pub(super) compared: usize,
    pub(super) equal: bool,
}

/// An engine that goes on and on.
pub(super) struct Subject {
    engine: Engine,
    record: BatchEngine,
    done: Disturbances,
}

impl Subject {
    /// An engine of `network` with the default options.
    pub(super) fn new(network: Arc<Network>, sensor: Sensor) -> Result<Self, CliError> {
        let search = Search::Proposed(meissner_reference::PROPOSE);
        let record =
            BatchEngine::new(Arc::clone(&network), sensor)?.with_search(search).with_bounded_memory();
        Ok(Self { engine: Engine::new(network, sensor)?, record, done: Disturbances::default() })
    }

    /// Pushes `event`, and predicts where that is due.
    pub(super) fn push(&mut self, event: Event, predict: bool, timed: &mut Timed) -> Result<(), CliError> {
        let start = Instant::now();
        self.engine.push(event);
        let pushed = Instant::now();
        if predict {
            self.engine.predict()?;
            timed.predict.record(pushed.elapsed());
        }
        timed.push.record(pushed - start);
        self.record.push(event);
        Ok(())
    }

    /// Does what `disturbance` says, at the place where `stream` stands.
    pub(super) fn disturb(&mut self, disturbance: Disturbance, stream: &mut Endless) -> Result<(), CliError> {
        match disturbance {
            Disturbance::Silence => {
                stream.fall_silent();
                self.done.silences += 1;
            }
            Disturbance::Advance => {
                let middle = stream.fall_silent();
                self.engine.advance(middle);
                self.record.advance(middle);
                self.done.advances += 1;
            }
            Disturbance::Bytes => {
                let before = self.bits()?;
                let bytes = self.engine.to_bytes();
                let mut restored = Engine::new(Arc::clone(self.engine.network()), self.engine.sensor())?;
                restored.restore_bytes(&bytes)?;
                self.engine = restored;
                self.done.bytes += 1;
                self.returned(&before)?;
            }
            Disturbance::Snapshot { detour } => {
                let before = self.bits()?;
                let snapshot = self.engine.snapshot();
                let mut ahead = stream.clone();
                for _ in 0..detour {
                    self.engine.push(ahead.next());
                }
                self.engine.predict()?;
                self.engine.restore(&snapshot)?;
                self.done.snapshots += 1;
                self.returned(&before)?;
            }
            Disturbance::Reset => {
                self.engine.reset();
                self.record.reset();
                self.done.resets += 1;
            }
        }
        Ok(())
    }

    /// Holds the prediction against the batch.
    pub(super) fn check(&mut self) -> Result<Checked, CliError> {
        let batch = to_bits(self.record.predict()?.values);
        let prediction = self.engine.predict()?;
        let bits = to_bits(prediction.values);
        Ok(Checked {
            t_us: prediction.t_us,
            nodes: prediction.nodes,
            compared: self.record.events().len(),
            equal: bits == batch,
            bits,
        })
    }

    /// What became of the events.
    pub(super) fn counters(&self) -> EventCounters {
        self.engine.counters().events
    }

    pub(super) fn disturbances(&self) -> Disturbances {
        self.done
    }

    /// Counts a state that was returned to and does not predict as it did.
    fn returned(&mut self, before: &[u32]) -> Result<(), CliError> {
        self.done.returns_that_differ += u64::from(self.bits()? != before);
        Ok(())
    }

    fn bits(&mut self) -> Result<Vec<u32>, CliError> {
        Ok(to_bits(self.engine.predict()?.values))
    }
}

fn to_bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}
