//! What a batch needs of a stream's past, and no more.
//!
//! Enters: events and moves of time. Leaves: the batch's prediction over the accepted events. Invariants: what is
//! remembered suffices for the batch, and is bounded; the batch shares no search with an engine.
//!
//! With `frozen` in-edges a row of block b holds what its neighbours held in block b - 1, and these are at most a
//! window's capacity of events before it. A row of the window thus depends, over B blocks, on no event before the last
//! (B + 1) capacities; earlier ones are forgotten, and the epoch is kept beside them. Without `frozen` it is one capacity.

use std::collections::VecDeque;
use std::sync::Arc;

use meissner_engine::{
    Admission, Batch, EngineError, Event, LatePolicy, Network, Propose, Search, Sensor, Stream,
};

/// The accepted events that a prediction can depend on, behind a gate of its own that says which are accepted.
#[derive(Clone, Debug)]
pub struct Record {
    gate: Admission,
    batch: Batch,
    events: VecDeque<Event>,
    most: usize,
}

impl Record {
    /// Remembers what an exact engine of `network` on `sensor` accepts that treats late events as `late` says. 16 bytes
    /// for each event that is remembered, at most [`Self::most`]. Neighbours are found by comparing all pairs of them.
    ///
    /// # Errors
    /// [`EngineError::Sensor`] for a sensor without pixels.
    pub fn new(
        network: impl Into<Arc<Network>>,
        sensor: Sensor,
        late: LatePolicy,
    ) -> Result<Self, EngineError> {
        let network = network.into();
        let parts = network.parts();
        let windows = if parts.graph.is_frozen() { parts.events.blocks.len() + 1 } else { 1 };
        let most = parts.capacity.saturating_mul(windows);
        let batch = Batch::new(network, sensor)?;
        Ok(Self { gate: Admission::new(sensor, late), batch, events: VecDeque::new(), most })
    }

    /// The same, with neighbours among what `propose` proposes: faster for thousands of events.
    #[must_use]
    pub fn with_proposals(mut self, propose: Propose) -> Self {
        self.batch = self.batch.with_search(Search::Proposed(propose));
        self
    }

    /// How neighbours are found.
    pub fn search(&self) -> Search {
        self.batch.search()
    }

    /// Most events that are remembered.
    pub fn most(&self) -> usize {
        self.most
    }

    /// Accepted events that are remembered, from the oldest.
    pub fn events(&self) -> impl Iterator<Item = Event> {
        self.events.iter().copied()
    }

    /// Takes an event, as `Engine::push` does.
    pub fn push(&mut self, event: Event) {
        if let Ok(event) = self.gate.admit(event) {
            if self.events.len() == self.most {
                self.events.pop_front();
            }
            self.events.push_back(event);
        }
    }

    /// Moves time on, as `Engine::advance` does.
    pub fn advance(&mut self, t_us: i64) {
        self.gate.advance(t_us);
    }

    /// Forgets all events, as `Engine::reset` does; the memory for them is kept.
    pub fn reset(&mut self) {
        self.gate.reset();
        self.events.clear();
    }

    /// The prediction from scratch over the accepted events. Cost: a row in every layer for each event remembered.
    ///
    /// # Errors
    /// [`EngineError::NotANumber`] as [`Batch::forward`].
    pub fn from_scratch(&mut self) -> Result<Vec<f32>, EngineError> {
        let stream = Stream {
            epoch_us: self.gate.epoch_us().unwrap_or(0),
            now_us: self.gate.now_us().unwrap_or(0),
            events: self.events.make_contiguous(),
        };
        Ok(self.batch.forward(stream)?.prediction)
    }
}

#[cfg(test)]
mod tests {
    use meissner_engine::{Event, LatePolicy, Network, Places, Search, Sensor};
    use meissner_models::{Description, Weights};

    use super::Record;

    fn network() -> Network {
        let weights = Weights::shipped("tactigraph-past").expect("weights from a seed come with it");
        Description::shipped("tactigraph-past").expect("it is shipped").network(&weights).expect("they fit")
    }

    fn none(places: &Places<'_>, tell: &mut dyn FnMut(&[u32])) {
        places.positions.iter().for_each(|_| tell(&[]));
    }

    #[test]
    fn a_record_never_searches_by_the_engines_grid() {
        let record = || Record::new(network(), Sensor::new(20, 20), LatePolicy::Drop).expect("it has pixels");
        assert!(matches!(record().search(), Search::Exhaustive));
        assert!(matches!(record().with_proposals(none).search(), Search::Proposed(_)));
        // What is proposed is what the batch goes by: without neighbours it predicts something else.
        let predict = |mut record: Record| {
            (0..9).for_each(|i| record.push(Event::new(i, i as u16, 3, i % 2 == 0)));
            record.from_scratch().expect("finite")
        };
        assert_ne!(predict(record()), predict(record().with_proposals(none)));
    }
}
