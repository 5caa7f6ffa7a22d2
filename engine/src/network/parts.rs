//! Parts of a network: the graph rule, levels of blocks, poolings, readout and head.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use meissner_kernels::Dense;

use crate::convolution::{EdgeReads, GraphConvolution};
use crate::frames::FrameNetwork;

/// The neighbours of a node. `knn` and `radius` are one rule: the first `most` candidates in order
/// whose squared distance is at most `radius`^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    /// The `k` nearest nodes.
    Knn {
        /// Neighbours, 1 to 255.
        k: usize,
    },
    /// The `max` nearest nodes within `r`.
    Radius {
        /// Distance, in units of the normalised position.
        r: f64,
        /// Maximum number of neighbours, 1 to 255.
        max: usize,
    },
}

impl Reach {
    /// Largest number of in-edges of a node.
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

/// Rule for in-edges whose source leaves the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lifetime {
    /// They are replaced by the next nearest node: in-edges always refer to nodes in the window.
    Window,
    /// A row is computed on arrival and never changed.
    Frozen,
}

/// Nodes that can be neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Candidates {
    /// All nodes in the window: an old event may gain a newer neighbour.
    All,
    /// Only nodes that arrived before.
    Past(Lifetime),
}

/// The rule that determines neighbourhoods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraphRule {
    /// Number and distance of the neighbours.
    pub reach: Reach,
    /// Nodes that can be neighbours.
    pub candidates: Candidates,
}

impl GraphRule {
    /// Whether rows are computed on arrival and never changed.
    pub fn is_frozen(self) -> bool {
        self.candidates == Candidates::Past(Lifetime::Frozen)
    }
}

/// Reference of edge attributes and pooling grids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Normalisation {
    /// Fixed scales per level; grids with origin 0.
    Fixed,
    /// The largest coordinate difference over each graph's edges, and grids that start at its
    /// smallest position, as in the training of the published checkpoint. Batch only.
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

/// Rule that makes the nodes of a level from those of the level below.
#[derive(Clone, Debug, PartialEq)]
pub struct Pooling {
    /// Name, for reports.
    pub name: String,
    /// Feature of the level below whose channel-wise maximum is the input of this level.
    pub from: usize,
    /// Cell size along x and y, as fractions of the sensor.
    pub cell: [Fraction; 2],
    /// Cell size along t, as a fraction of the span; `None` pools over all times.
    pub time: Option<Fraction>,
    /// Position of the pooled nodes.
    pub position: Position,
}

/// A block of a level.
#[derive(Clone, Debug)]
pub struct Block {
    /// Name, for reports.
    pub name: String,
    /// Input feature of the convolution.
    pub input: usize,
    /// Feature added to the result.
    pub skip: Option<usize>,
    /// Convolution, activation and batch norm.
    pub conv: GraphConvolution,
}

/// The blocks over one graph.
#[derive(Clone, Debug)]
pub struct Level {
    /// Scale s: attributes clamp((`p_j` - `p_i`) / (2 s) + 0.5, 0, 1), offsets (`p_j` - `p_i`) / s.
    pub scale: f32,
    /// Blocks in topological order: each reads only features written before it.
    pub blocks: Vec<Block>,
}

impl Level {
    pub(crate) fn edge_reads(&self) -> EdgeReads {
        self.blocks.iter().map(|block| block.conv.edge_reads()).fold(EdgeReads::default(), EdgeReads::or)
    }
}

/// Rule that combines the rows of a cell into one row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aggregation {
    /// The maximum of each channel.
    Max,
    /// The sum of each channel, from 0 in order of arrival.
    Sum,
}

/// The maximum or sum over a grid of the image, cells row-major. An empty cell is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Readout {
    /// Feature of the last level.
    pub from: usize,
    /// Cells along x.
    pub columns: usize,
    /// Cells along y.
    pub rows: usize,
    /// Rule that combines a cell's rows into one: a sum counts events, a maximum does not. Sums are
    /// of events, without pooling, in the order of
    /// [`Network::sum_part_us`](crate::Network::sum_part_us).
    pub aggregation: Aggregation,
    /// Whether cells in time stay separate: one copy of the grid for each time cell that a window
    /// can occupy, newest first.
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

/// Parts of a [`Network`](crate::Network).
#[derive(Clone, Debug)]
pub struct NetworkParts {
    /// Name, for reports.
    pub name: String,
    /// Length of the window in microseconds.
    pub span_us: i64,
    /// Largest number of events in the window.
    pub capacity: usize,
    /// Rule of the event graph.
    pub graph: GraphRule,
    /// Reference of edge attributes and grids.
    pub normalisation: Normalisation,
    /// Cells, as fractions of the sensor along x and y, if an event's place in its cell is an
    /// input. The channels are then polarity (-1 or 1) and the place of the pixel's centre along x
    /// and y, from -1 at a cell's start to 1 at its end ([`Fraction::place`]). `None`: polarity
    /// only.
    pub place: Option<[Fraction; 2]>,
    /// The event level.
    pub events: Level,
    /// Each pooling with the level that it starts.
    pub pooled: Vec<(Pooling, Level)>,
    /// Input of the dense layers or of the head.
    pub readout: Readout,
    /// Dense layers in order; the outputs of the last are the prediction. Empty if there is a head.
    pub dense: Vec<DenseLayer>,
    /// A frame network that predicts instead of dense layers. It reads the readout as an image of
    /// the grid: channel `age C + c` is channel c of the grid `age` time cells old. It is
    /// stateless: predictions cannot depend on how often they are read.
    pub head: Option<Arc<FrameNetwork>>,
}

/// A positive fraction such as 16/346.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fraction {
    numerator: u32,
    denominator: u32,
}

impl Fraction {
    /// `numerator` / `denominator`; `None` if either is zero.
    pub fn new(numerator: u32, denominator: u32) -> Option<Self> {
        (numerator > 0 && denominator > 0).then_some(Self { numerator, denominator })
    }

    /// The numerator.
    pub fn numerator(self) -> u32 {
        self.numerator
    }

    /// The denominator.
    pub fn denominator(self) -> u32 {
        self.denominator
    }

    pub(crate) const ONE: Self = Self { numerator: 1, denominator: 1 };

    /// The smallest number of `size`s whose total length is at least this one. Saturates.
    pub(crate) fn cells_of(self, size: Self) -> usize {
        let length = u64::from(self.numerator) * u64::from(size.denominator);
        let part = u64::from(self.denominator) * u64::from(size.numerator);
        usize::try_from(length.div_ceil(part)).unwrap_or(usize::MAX)
    }

    /// Number of cells of this size that cover 0 <= p < 1 from an origin of 0.
    pub fn cells(self) -> usize {
        (self.denominator as usize).div_ceil(self.numerator as usize)
    }

    /// Cell that contains `position` / `extent`: floor(position / extent / self), in integers.
    /// Saturates.
    ///
    /// # Panics
    /// If `extent` is not positive, or has more than 62 bits.
    #[inline]
    pub fn cell(self, position: i128, extent: i128) -> i128 {
        assert!(0 < extent && extent >> 62 == 0, "an extent must be positive and of at most 62 bits");
        let [size, parts] = [extent * i128::from(self.numerator), self.denominator.into()];
        if position.unsigned_abs() >> 95 == 0 {
            return (position * parts).div_euclid(size);
        }
        // Two steps, as the product does not fit: the upper bits, then their remainder (below 2^94)
        // with the lower bits.
        let upper = (position >> 32) * parts;
        let lower = (upper.rem_euclid(size) << 32) + (position & 0xffff_ffff) * parts;
        upper.div_euclid(size).saturating_mul(1 << 32).saturating_add(lower.div_euclid(size))
    }

    /// Place of the centre of pixel `pixel` of `extent` in its cell: -1 at the start, 1 at the end.
    /// The cell is that of [`Self::cell`]; its last pixel's centre can lie beyond its end.
    ///
    /// # Panics
    /// If `extent` is 0.
    pub fn place(self, pixel: u16, extent: u16) -> f32 {
        // Twice the lengths in 1 / denominator pixels: below 2^50, so only the quotient is rounded.
        let [size, parts] = [i64::from(extent) * i64::from(self.numerator), self.denominator.into()];
        let within = 2 * (i64::from(pixel) * parts % size) + parts;
        ((within - size) as f64 / size as f64) as f32
    }

    /// Centre of cell `index`, as a fraction of the whole.
    #[inline]
    pub fn centre(self, index: i64) -> f64 {
        (index as f64 + 0.5) * f64::from(self.numerator) / f64::from(self.denominator)
    }
}

impl fmt::Display for Fraction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.numerator, self.denominator)
    }
}

impl FromStr for Fraction {
    type Err = String;

    /// Parses "16/346".
    fn from_str(s: &str) -> Result<Self, String> {
        let parse = || {
            let (n, d) = s.split_once('/')?;
            Self::new(n.trim().parse().ok()?, d.trim().parse().ok()?)
        };
        parse().ok_or_else(|| {
            format!("expected a fraction of positive integers such as \"16/346\", found {s:?}")
        })
    }
}
