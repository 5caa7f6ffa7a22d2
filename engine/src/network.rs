//! A network as the engine runs it: the event graph, levels of blocks joined by poolings, a readout, dense layers. Shapes
//! are checked once, here; engine and batch rely on them.
//!
//! A *feature* of a level is what enters it (index 0: the events' polarity, or the pooled maxima) or what its block
//! b wrote (index b + 1). Blocks read any earlier feature of their level, so that a level is an acyclic graph in
//! topological order.

mod check;
mod fingerprint;
mod parts;

use std::sync::OnceLock;

use crate::error::in_range;
use crate::{EngineError, Fraction};
pub use parts::{
    Block, Candidates, DenseLayer, GraphRule, Level, Lifetime, NetworkParts, Normalisation, Pooling,
    Position, Reach, Readout,
};

/// A checked network. Immutable; engines share it by `Arc`.
#[derive(Clone, Debug)]
pub struct Network {
    parts: NetworkParts,
    /// Channels of each feature of each level.
    channels: Vec<Vec<usize>>,
    /// Known from when it was first asked for.
    fingerprint: OnceLock<u64>,
}

impl Network {
    /// Longest span, about 12 days: sums of squared shares of it stay far from f64's limits.
    pub const LONGEST_SPAN_US: i64 = check::LONGEST_SPAN_US;
    /// Most events that a window may be asked to hold.
    pub const LARGEST_CAPACITY: usize = check::LARGEST_CAPACITY;
    /// Most in-edges of a node.
    pub const MOST_NEIGHBOURS: usize = check::MOST_NEIGHBOURS;
    /// Most cells of a pooling.
    pub const MOST_CELLS: usize = check::MOST_CELLS;

    /// Checks that `parts` fit together.
    ///
    /// # Errors
    /// [`EngineError::Option`] for the graph, span and capacity; [`EngineError::Network`] for layers that read what
    /// does not exist yet or has other channels.
    pub fn new(parts: NetworkParts) -> Result<Self, EngineError> {
        let channels = check::channels(&parts)?;
        Ok(Self { parts, channels, fingerprint: OnceLock::new() })
    }

    /// What the network is made of.
    pub fn parts(&self) -> &NetworkParts {
        &self.parts
    }

    /// Name, for reports.
    pub fn name(&self) -> &str {
        &self.parts.name
    }

    /// What tells this network from others: of structure, names and the bits of all parameters as they are computed with.
    /// Equal networks have equal ones; others collide by chance alone, though not for someone who wants them to. O(parameters)
    /// once.
    pub fn fingerprint(&self) -> u64 {
        *self.fingerprint.get_or_init(|| fingerprint::of(&self.parts))
    }

    /// Number of values in a prediction.
    pub fn outputs(&self) -> usize {
        let head = self.parts.head.as_ref().map(|head| head.output().values());
        head.or(self.parts.dense.last().map(|layer| layer.dense.outputs())).unwrap_or(0)
    }

    /// Number of levels: the event level and one per pooling.
    pub fn levels(&self) -> usize {
        self.channels.len()
    }

    /// Level `level`: 0 is the event level.
    ///
    /// # Panics
    /// If there is no such level.
    pub fn level(&self, level: usize) -> &Level {
        if level == 0 { &self.parts.events } else { &self.parts.pooled[level - 1].1 }
    }

    /// Channels of each feature of level `level`.
    ///
    /// # Panics
    /// If there is no such level.
    pub fn channels(&self, level: usize) -> &[usize] {
        &self.channels[level]
    }

    /// Channels that the readout takes the maximum of.
    pub fn readout_channels(&self) -> usize {
        self.channels[self.channels.len() - 1][self.parts.readout.from]
    }

    /// How often the readout's grid is there: once, or once for each cell in time that a window can fill.
    pub fn readout_times(&self) -> usize {
        self.readout_time().map_or(1, check::times)
    }

    /// Length of the cells in time that the readout keeps apart, as a share of the span.
    pub(crate) fn readout_time(&self) -> Option<Fraction> {
        let last = self.parts.pooled.last();
        last.and_then(|(pooling, _)| pooling.time).filter(|_| self.parts.readout.by_time)
    }

    /// Names of the layers that compute rows: the blocks of level 0, each pooling with its blocks, in order.
    pub fn layers(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.parts.events.blocks.iter().map(|b| b.name.as_str()).collect();
        for (pooling, level) in &self.parts.pooled {
            names.push(&pooling.name);
            names.extend(level.blocks.iter().map(|b| b.name.as_str()));
        }
        names
    }
}

/// A network changed before it runs: a coarser graph, a shorter memory. Each is checked again and exact in itself: engine and
/// batch agree on it bit for bit. Only a measurement can say how its predictions differ from those of the network before.
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
        let mut parts = self.parts;
        change(&mut parts);
        Self::new(parts)
    }
}
