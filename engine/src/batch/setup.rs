//! A batch: its network, sensor, search and instruction set.

use std::ops::Range;
use std::sync::Arc;

use meissner_kernels::Isa;

use crate::network::{Network, Normalisation, Reach};
use crate::{EngineError, Sensor};

/// Search method for the neighbourhoods of a batch. All methods give the same graph.
#[derive(Clone, Copy, Debug, Default)]
pub enum Search {
    /// Compares all pairs: O(n^2), simple enough to be evidently correct.
    #[default]
    Exhaustive,
    /// A function that shares no code with the engine, such as a k-d tree, proposes candidates;
    /// they are sorted as in [`Self::Exhaustive`].
    Proposed(Propose),
    /// The engine's grid and metric, for speed: about O(n k). If nodes read the whole window, a
    /// filter in f32 precedes exact distances. Such a batch is not an oracle.
    Grid,
}

/// Reports the candidate events of each event of [`Places`], in its order. The candidates have no
/// duplicates and any order; they contain the whole neighbourhood, and possibly other events.
pub type Propose = fn(&Places<'_>, &mut dyn FnMut(&[u32]));

/// The events whose neighbourhoods are searched.
#[derive(Clone, Copy, Debug)]
pub struct Places<'a> {
    /// Positions as fractions of sensor and span, with time from the first event. A coordinate is a
    /// quotient of integers, rounded once; the integers determine neighbourhoods.
    pub positions: &'a [[f64; 3]],
    /// Range of indices that each event may read from; it may include the event itself.
    pub candidates: &'a [Range<usize>],
    /// Number and distance of the neighbours.
    pub reach: Reach,
}

/// A network with a sensor, computed from scratch on any number of streams.
#[derive(Clone, Debug)]
pub struct Batch {
    pub(super) network: Arc<Network>,
    pub(super) sensor: Sensor,
    pub(super) search: Search,
    pub(super) isa: Isa,
    /// Whether threads share the rows of one forward pass.
    pub(super) parallel: bool,
}

impl Batch {
    /// A batch of `network` over the events of `sensor`, with exhaustive search.
    ///
    /// # Errors
    /// [`EngineError::Sensor`] for a sensor without pixels.
    pub fn new(network: impl Into<Arc<Network>>, sensor: Sensor) -> Result<Self, EngineError> {
        if sensor.width == 0 || sensor.height == 0 {
            return Err(EngineError::Sensor(sensor));
        }
        let network = network.into();
        Ok(Self { network, sensor, search: Search::default(), isa: Isa::best(), parallel: false })
    }

    /// The same with a different search; [`Search::Grid`] is the fastest over data sets.
    #[must_use]
    pub fn with_search(self, search: Search) -> Self {
        Self { search, ..self }
    }

    /// The same with a different instruction set.
    #[must_use]
    pub fn with_isa(self, isa: Isa) -> Self {
        Self { isa, ..self }
    }

    /// Sets whether rayon's threads share the rows of one forward pass.
    #[must_use]
    pub fn with_parallel_rows(self, parallel: bool) -> Self {
        Self { parallel, ..self }
    }

    /// Search method of the neighbourhoods.
    pub fn search(&self) -> Search {
        self.search
    }

    /// The network.
    pub fn network(&self) -> &Arc<Network> {
        &self.network
    }

    /// The sensor.
    pub fn sensor(&self) -> Sensor {
        self.sensor
    }

    /// Scale of the edge attributes: fixed, or the largest coordinate difference over the edges.
    pub(super) fn scale(&self, fixed: f32, differences: impl Iterator<Item = [f64; 3]>) -> f32 {
        match self.network.parts().normalisation {
            Normalisation::Fixed => fixed,
            Normalisation::PerGraph => {
                let largest = differences.flatten().map(|d| (d as f32).abs()).fold(0.0, f32::max);
                if largest > 0.0 { largest } else { 1.0 }
            }
        }
    }
}
