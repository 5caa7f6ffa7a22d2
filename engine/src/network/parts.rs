//! What a network is made of: the rule of its graph, its levels of blocks, its poolings, its readout and its head.

use std::sync::Arc;

use meissner_kernels::Dense;

use crate::Fraction;
use crate::convolution::{EdgeReads, GraphConvolution};
use crate::frames::FrameNetwork;

/// Which nodes a node reads from. `knn` and `radius` are one rule: the first `most` candidates in the graph's order
/// whose squared distance is at most `radius`^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    /// The `k` nearest.
    Knn {
        /// Neighbours, 1 to 255.
        k: usize,
    },
    /// Those within `r`, of these the `max` nearest.
    Radius {
        /// Distance, in units of the normalised position.
        r: f64,
        /// Most neighbours, 1 to 255.
        max: usize,
    },
}

impl Reach {
    /// Most in-edges that a node has.
    pub fn most(self) -> usize {
        match self {
            Self::Knn { k } => k,
            Self::Radius { max, .. } => max,
        }
    }

    /// Largest squared distance of an in-edge.
    pub fn limit(self) -> f64 {
        match self {
            Self::Knn { .. } => f64::INFINITY,
            Self::Radius { r, .. } => r * r,
        }
    }
}

/// What becomes of in-edges when the node they come from leaves the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lifetime {
    /// They are replaced by the next nearest: in-edges always refer to the window.
    Window,
    /// A row is computed on arrival and never changed.
    Frozen,
}

/// Which nodes can be neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Candidates {
    /// All in the window: an old event may gain a newer neighbour.
    All,
    /// Those that arrived before.
    Past(Lifetime),
}

/// How neighbourhoods are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraphRule {
    /// How many and how far.
    pub reach: Reach,
    /// Among which.
    pub candidates: Candidates,
}

impl GraphRule {
    /// Whether rows are computed on arrival and never changed.
    pub fn is_frozen(self) -> bool {
        self.candidates == Candidates::Past(Lifetime::Frozen)
    }
}

/// What edge attributes and pooling grids are relative to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Normalisation {
    /// Fixed scales per level, grids from an origin of 0.
    Fixed,
    /// The largest coordinate difference over the edges of each graph, grids from its smallest position: how the
    /// published checkpoint was trained. Batch only.
    PerGraph,
}

/// Position of a pooled node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Position {
    /// Mean of its members' positions.
    Mean,
    /// Centre of its cell.
    Centre,
}

/// How a level's nodes are made from those of the level below.
#[derive(Clone, Debug, PartialEq)]
pub struct Pooling {
    /// Name, for reports.
    pub name: String,
    /// Feature of the level below whose channel-wise maximum enters this level.
    pub from: usize,
    /// Cell size along x and y, as fractions of the sensor.
    pub cell: [Fraction; 2],
    /// Cell size along t, as a fraction of the span; `None` pools over all times.
    pub time: Option<Fraction>,
    /// Where the pooled nodes lie.
    pub position: Position,
}

/// A block of a level.
#[derive(Clone, Debug)]
pub struct Block {
    /// Name, for reports.
    pub name: String,
    /// Feature that is convolved.
    pub input: usize,
    /// Feature that is added to the result.
    pub skip: Option<usize>,
    /// Convolution, activation and batch norm.
    pub conv: GraphConvolution,
}

/// The blocks over one graph.
#[derive(Clone, Debug)]
pub struct Level {
    /// Scale s of the edge attributes u = clamp((`p_j` - `p_i`) / (2 s) + 0.5, 0, 1) and of the offsets (`p_j` - `p_i`) / s.
    pub scale: f32,
    /// In an order in which each reads only what was written before it.
    pub blocks: Vec<Block>,
}

impl Level {
    /// What the blocks read of in-edges.
    pub(crate) fn edge_reads(&self) -> EdgeReads {
        self.blocks.iter().map(|block| block.conv.edge_reads()).fold(EdgeReads::default(), EdgeReads::or)
    }
}

/// The maximum over a grid of the image, cell after cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Readout {
    /// Feature of the last level.
    pub from: usize,
    /// Cells along x.
    pub columns: usize,
    /// Cells along y.
    pub rows: usize,
    /// Whether the poolings' cells in time stay apart: the grid is there once for each of them that a window can fill,
    /// the newest first.
    pub by_time: bool,
}

/// A dense layer after the readout.
#[derive(Clone, Debug)]
pub struct DenseLayer {
    /// Name, for reports.
    pub name: String,
    /// Weights and activation.
    pub dense: Dense,
}

/// What a [`Network`](crate::Network) is made from.
#[derive(Clone, Debug)]
pub struct NetworkParts {
    /// Name, for reports.
    pub name: String,
    /// Length of the window in microseconds.
    pub span_us: i64,
    /// Most events that the window holds.
    pub capacity: usize,
    /// Rule of the event graph.
    pub graph: GraphRule,
    /// What attributes and grids are relative to.
    pub normalisation: Normalisation,
    /// The event level.
    pub events: Level,
    /// Each pooling with the level that it starts.
    pub pooled: Vec<(Pooling, Level)>,
    /// What the dense layers read.
    pub readout: Readout,
    /// In order; the last one's outputs are the prediction. None where there is a head.
    pub dense: Vec<DenseLayer>,
    /// A frame network in place of dense layers; its output is the prediction. It reads the readout as an image: a column and
    /// a row for those of the grid, channel `age C + c` for channel c of the grid that is `age` cells in time old. Without
    /// state: how often predictions are read must not matter.
    pub head: Option<Arc<FrameNetwork>>,
}
