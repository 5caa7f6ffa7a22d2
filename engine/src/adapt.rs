//! A network changed before it runs: a coarser graph, a shorter memory.
//!
//! Enters: a checked network. Leaves: another one, checked again. What leaves is exact in itself: engine and batch agree on
//! it bit for bit. What it predicts differs from what the network that entered does, by what only a measurement can say.

use crate::EngineError;
use crate::network::{Network, NetworkParts, Reach, in_range};

impl Network {
    /// The same network with another span.
    ///
    /// # Errors
    /// [`EngineError::Option`] where the span is out of range.
    pub fn with_span_us(self, span_us: i64) -> Result<Self, EngineError> {
        self.changed(|parts| parts.span_us = span_us)
    }

    /// The same network with a window of at most `capacity` events.
    ///
    /// # Errors
    /// [`EngineError::Option`] where the capacity is out of range.
    pub fn with_capacity(self, capacity: usize) -> Result<Self, EngineError> {
        self.changed(|parts| parts.capacity = capacity)
    }

    /// The same network where a node of the event graph reads the first `most` of its neighbours.
    ///
    /// # Errors
    /// [`EngineError::Option`] for none, or for more than the network has: it has seen no such graph.
    pub fn with_neighbours(self, most: usize) -> Result<Self, EngineError> {
        in_range("neighbours of a node", most as i64, 1, self.parts().graph.reach.most() as i64)?;
        self.changed(|parts| {
            let (Reach::Knn { k: old } | Reach::Radius { max: old, .. }) = &mut parts.graph.reach;
            *old = most;
        })
    }

    fn changed(self, change: impl FnOnce(&mut NetworkParts)) -> Result<Self, EngineError> {
        let mut parts = self.into_parts();
        change(&mut parts);
        Self::new(parts)
    }
}
