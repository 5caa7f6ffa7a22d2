//! An engine whose computing time can be read while it works.
//!
//! Enters: the calls of the thread that owns it. Leaves: the processor time of this thread, for other threads. It is written after each
//! prediction and every 16 pushes: reading it is a call of the operating system.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use meissner::live::Predictor;
use meissner::{EngineError, EventCounters, Outcome, Prediction};

use crate::realtime::computing_time;

/// Pushes between two readings: about 20 microseconds of work.
const PUSHES: u32 = 16;

/// Reads the computing time of a [`Metered`] engine.
#[derive(Clone, Debug, Default)]
pub struct Meter(Arc<AtomicU64>);

impl Meter {
    /// For how long the engine's thread had a processor.
    pub fn read(&self) -> Duration {
        Duration::from_nanos(self.0.load(Ordering::Relaxed))
    }

    fn write(&self) {
        self.0.store(computing_time().as_nanos() as u64, Ordering::Relaxed);
    }
}

/// An engine with a [`Meter`].
#[derive(Debug)]
pub struct Metered<P> {
    engine: P,
    meter: Meter,
    pushes: u32,
}

impl<P> Metered<P> {
    /// `engine`, measured by `meter`.
    pub fn new(engine: P, meter: Meter) -> Self {
        Self { engine, meter, pushes: 0 }
    }

    /// The engine.
    pub fn engine(&self) -> &P {
        &self.engine
    }
}

impl<P: Predictor> Predictor for Metered<P> {
    type Input = P::Input;

    fn push(&mut self, input: P::Input) -> Outcome {
        let outcome = self.engine.push(input);
        self.pushes += 1;
        if self.pushes == PUSHES {
            self.pushes = 0;
            self.meter.write();
        }
        outcome
    }

    fn advance(&mut self, t_us: i64) {
        self.engine.advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        let prediction = self.engine.predict();
        self.meter.write();
        prediction
    }

    fn reset(&mut self) {
        self.engine.reset();
    }

    fn event_counters(&self) -> EventCounters {
        self.engine.event_counters()
    }
}
