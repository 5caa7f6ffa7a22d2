//! An engine that remembers what it accepted, to be held against a batch.
//!
//! Enters: events and moves of time. Leaves: the same prediction as the engine's, and on request the batch's over the
//! accepted events. Invariant: engine and record are given the same.

use std::sync::Arc;

use meissner_engine::{EngineError, Event, LatePolicy, Network, Outcome, Prediction, Propose, Sensor};

use crate::{Predictor, Record};

/// An exact engine and the [`Record`] of what it accepted.
#[derive(Clone, Debug)]
pub struct Recorded<P> {
    predictor: P,
    record: Record,
}

impl<P: Predictor> Recorded<P> {
    /// Remembers what `predictor`, new and exact, accepts: an engine of `network` on `sensor` that treats late events
    /// as `late` says. 16 bytes for each event that is remembered, at most [`Self::most`].
    ///
    /// # Errors
    /// [`EngineError::Sensor`] for a sensor without pixels.
    pub fn new(
        predictor: P,
        network: impl Into<Arc<Network>>,
        sensor: Sensor,
        late: LatePolicy,
    ) -> Result<Self, EngineError> {
        Ok(Self { predictor, record: Record::new(network, sensor, late)? })
    }

    /// The same, with neighbours among what `propose` proposes, as [`Record::with_proposals`].
    #[must_use]
    pub fn with_proposals(self, propose: Propose) -> Self {
        Self { record: self.record.with_proposals(propose), ..self }
    }

    /// The predictor.
    pub fn predictor(&self) -> &P {
        &self.predictor
    }

    /// Most events that are remembered.
    pub fn most(&self) -> usize {
        self.record.most()
    }

    /// Accepted events that are remembered, from the oldest.
    pub fn events(&self) -> impl Iterator<Item = Event> {
        self.record.events()
    }

    /// The prediction from scratch, as [`Record::from_scratch`].
    ///
    /// # Errors
    /// As [`Record::from_scratch`].
    pub fn from_scratch(&mut self) -> Result<Vec<f32>, EngineError> {
        self.record.from_scratch()
    }
}

impl<P: Predictor> Predictor for Recorded<P> {
    fn push(&mut self, event: Event) -> Outcome {
        self.record.push(event);
        self.predictor.push(event)
    }

    fn advance(&mut self, t_us: i64) {
        self.record.advance(t_us);
        self.predictor.advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.predictor.predict()
    }
}
