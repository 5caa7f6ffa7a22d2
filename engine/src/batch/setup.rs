//! What a batch computes with, whatever the stream: network, sensor, the search, the instruction set.

use std::ops::Range;
use std::sync::Arc;

use meissner_kernels::Isa;

use crate::Sensor;
use crate::network::{Network, Normalisation, Reach};

/// How the neighbourhoods of a batch are found. All give the same graph.
#[derive(Clone, Copy, Debug, Default)]
pub enum Search {
    /// All pairs: O(n^2), obviously right.
    #[default]
    Exhaustive,
    /// A function that shares nothing with the engine, such as a k-d tree, proposes candidates; they are ordered as in
    /// [`Self::Exhaustive`].
    Proposed(Propose),
    /// The engine's grid of pixels and its metric, for speed: O(n k) or so. Where nodes read from the whole window, a filter
    /// in f32 goes before the exact distances. A batch that searches so shares its search with the engine and is no oracle.
    Grid,
}

/// Tells, for each event of [`Places`] in order, indices of other events in any order, none twice: all that are in its
/// neighbourhood, and any others.
pub type Propose = fn(&Places<'_>, &mut dyn FnMut(&[u32]));

/// The events whose neighbourhoods are searched.
#[derive(Clone, Copy, Debug)]
pub struct Places<'a> {
    /// Positions in shares of sensor and span, time from the first of these events. Each coordinate is a quotient of
    /// integers, rounded once; neighbourhoods follow from the integers.
    pub positions: &'a [[f64; 3]],
    /// Indices that each event may read from, itself not excluded.
    pub candidates: &'a [Range<usize>],
    /// How many of them, and how far.
    pub reach: Reach,
}

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Setup {
    pub(super) network: Arc<Network>,
    pub(super) sensor: Sensor,
    pub(super) search: Search,
    pub(super) isa: Isa,
    /// Whether the rows of one forward pass are shared among threads.
    pub(super) parallel: bool,
}

impl Setup {
    /// Scale of the edge attributes: the description's, or the largest coordinate difference over the edges.
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
