//! An engine with event filters before it and a readout that may be stale.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::filters::{Chain, EventFilter};
use meissner_engine::{Counters, Engine, EngineError, Event, Network, Options, Sensor, StaleReadout};

use crate::approximations::Approximations;

/// An engine with event filters and a readout that may be stale.
#[derive(Clone, Debug)]
pub struct FilteredEngine {
    /// Filters, in the order in which events come to them.
    pub chain: Chain,
    /// The engine with its readout.
    pub readout: StaleReadout,
}

impl FilteredEngine {
    /// An engine for `network`, which `approximations` have changed already, with what else of them there is; `options`
    /// but for their tolerance.
    ///
    /// # Errors
    /// The engine refuses the sensor, an option or an approximation.
    pub fn new(
        network: Arc<Network>,
        sensor: Sensor,
        approximations: &Approximations,
        options: Options,
    ) -> Result<Self, EngineError> {
        let tolerance = approximations.tolerance.unwrap_or(0.0);
        let engine = Engine::with_options(network, sensor, options.with_tolerance(tolerance))?;
        let readout = StaleReadout::new(engine, approximations.staleness())?;
        Ok(Self { chain: approximations.chain(sensor)?, readout })
    }

    /// Forgets all events; counters go on.
    pub fn reset(&mut self) {
        self.chain.reset();
        self.readout.reset();
    }

    /// Whether `event` passes the filters, and how long that took; no time where there are none.
    pub fn admit(&mut self, event: Event) -> (bool, Duration) {
        if self.chain.filters().is_empty() {
            return (true, Duration::ZERO);
        }
        let start = Instant::now();
        let passes = self.chain.admit(event);
        (passes, start.elapsed())
    }

    /// Hands `events` to the engine, but for those that a filter drops.
    pub fn push_slice(&mut self, events: &[Event]) {
        for &event in events {
            if self.chain.admit(event) {
                self.readout.push(event);
            }
        }
    }

    /// The engine.
    pub fn engine(&self) -> &Engine {
        self.readout.engine()
    }

    /// Events that no filter has dropped.
    pub fn passed(&self) -> u64 {
        self.engine().counters().events.pushed
    }

    /// The engine's counters, with events that a filter dropped and predictions that stood among those that came.
    pub fn counters(&self) -> Counters {
        let mut counters = self.engine().counters();
        counters.events.pushed += self.chain.counters().dropped;
        counters.predictions.read += self.readout.stale();
        counters
    }
}
