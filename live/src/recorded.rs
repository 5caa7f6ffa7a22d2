//! An engine and a batch over the same events.
//!
//! Input: events and clock advances. Output: the engine's predictions, and on request the batch's. Invariant: engine
//! and batch receive the same input.

use meissner_engine::{BatchEngine, EngineError, Event, EventCounters, Outcome, Prediction, Predictor};

/// An engine and a [`BatchEngine`] that receive the same events, to compare their predictions.
#[derive(Clone, Debug)]
pub struct Recorded<P> {
    predictor: P,
    batch: BatchEngine,
}

impl<P: Predictor<Input = Event>> Recorded<P> {
    /// Combines `predictor` and `batch`, which must have the same network, sensor and late policy and must not have
    /// seen an event. For long streams the batch should have [bounded memory](BatchEngine::with_bounded_memory).
    pub fn new(predictor: P, batch: BatchEngine) -> Self {
        Self { predictor, batch }
    }

    /// The predictor.
    pub fn predictor(&self) -> &P {
        &self.predictor
    }

    /// The batch.
    pub fn batch(&self) -> &BatchEngine {
        &self.batch
    }

    /// The batch's prediction over the accepted events.
    ///
    /// # Errors
    /// As [`BatchEngine::predict`].
    pub fn from_scratch(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.batch.predict()
    }
}

impl<P: Predictor<Input = Event>> Predictor for Recorded<P> {
    type Input = Event;

    fn push(&mut self, event: Event) -> Outcome {
        self.batch.push(event);
        self.predictor.push(event)
    }

    fn push_from(&mut self, events: &mut Vec<Event>) {
        self.batch.push_slice(events);
        self.predictor.push_from(events);
    }

    fn advance(&mut self, t_us: i64) {
        self.batch.advance(t_us);
        self.predictor.advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.predictor.predict()
    }

    fn reset(&mut self) {
        self.batch.reset();
        self.predictor.reset();
    }

    fn event_counters(&self) -> EventCounters {
        self.predictor.event_counters()
    }
}
