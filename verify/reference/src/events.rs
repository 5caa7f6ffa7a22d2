//! A network over events, computed from scratch in f64.
//!
//! Input: a [`Stream`]. Output: every feature of every level, the readout, the prediction.
//! Neighbourhoods and cells equal the engine's; values differ only by rounding.

mod pool;

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use meissner_engine::frames::{FrameLayer, FrameLayerKind, FrameNetworkParts, FrameShape};
use meissner_engine::{
    Candidates, DenseLayer, EngineError, Event, Fraction, Level, Network, Normalisation, Sensor, Stream,
};

use crate::convolution::{BatchNorm, Convolution, Edge};
use crate::frames::FrameReference;

/// A network cannot be evaluated here.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// Scales and grid origin are recomputed from each graph.
    #[error("network {0:?}: expected fixed scales, found ones that are normalised over each graph")]
    PerGraph(String),
    /// The head's parameters are missing, or do not belong to the network.
    #[error("network {network:?}: parameters of a head: expected {expected}, found {found}")]
    Head {
        /// Name of the network.
        network: String,
        /// Whether it has a head.
        expected: &'static str,
        /// Whether parameters were given.
        found: &'static str,
    },
    /// A frame network's parts do not fit together.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

/// Rows of a feature, each with one value per channel.
pub type Rows = Vec<Vec<f64>>;

/// A network over the events of a sensor.
#[derive(Clone, Debug)]
pub struct EventReference {
    network: Arc<Network>,
    sensor: Sensor,
    /// Blocks of each level.
    blocks: Vec<Vec<Convolution>>,
    /// The head, or the dense layers over the values of the readout.
    head: FrameReference,
}

/// One level.
#[derive(Clone, Debug)]
pub struct ReferenceLevel {
    /// The level's input, then the output of each block.
    pub features: Vec<Rows>,
    /// First row that is in the window; earlier rows are needed for `frozen` in-edges.
    pub first: usize,
    edges: Vec<Vec<Edge>>,
    /// Fractions of sensor and span, with time relative to the epoch.
    positions: Vec<[f64; 3]>,
    /// Index of each row's cell along x, y and t; empty at the event level.
    cells: Vec<[i64; 3]>,
}

/// All activations of a stream.
#[derive(Clone, Debug)]
pub struct EventTrace {
    /// The event level, then one per pooling.
    pub levels: Vec<ReferenceLevel>,
    /// (cells, channels).
    pub readout: Rows,
    /// Outputs of the last layer.
    pub prediction: Vec<f64>,
}

impl EventReference {
    /// `network` over the events of `sensor`; `head` holds the parameters of its head, if any.
    ///
    /// # Errors
    /// [`ReferenceError::PerGraph`] for per-graph normalisation, [`ReferenceError::Head`] if only
    /// one of `head` and the network's head exists, [`ReferenceError::Engine`] if the head's layers
    /// do not fit.
    pub fn new(
        network: impl Into<Arc<Network>>,
        sensor: Sensor,
        head: Option<FrameNetworkParts>,
    ) -> Result<Self, ReferenceError> {
        let network = network.into();
        let parts = network.parts();
        if parts.normalisation == Normalisation::PerGraph {
            return Err(ReferenceError::PerGraph(parts.name.clone()));
        }
        if parts.head.is_some() != head.is_some() {
            let word = |there: bool| if there { "some" } else { "none" };
            let (expected, found) = (word(parts.head.is_some()), word(head.is_some()));
            return Err(ReferenceError::Head { network: parts.name.clone(), expected, found });
        }
        let head = head.unwrap_or_else(|| dense(&network));
        let blocks = |level: &Level| level.blocks.iter().map(|block| Convolution::new(&block.conv)).collect();
        Ok(Self {
            sensor,
            blocks: (0..network.levels()).map(|l| blocks(network.level(l))).collect(),
            head: FrameReference::new(head)?,
            network,
        })
    }

    /// Replaces the folded batch norms of these blocks, given by name, by the norms as trained.
    ///
    /// # Panics
    /// If a norm does not have one value per channel of its block.
    #[must_use]
    pub fn with_norms(mut self, norms: &BTreeMap<String, BatchNorm>) -> Self {
        for (l, blocks) in self.blocks.iter_mut().enumerate() {
            for (conv, block) in blocks.iter_mut().zip(&self.network.level(l).blocks) {
                if let Some(norm) = norms.get(&block.name) {
                    let lengths = [&norm.gamma, &norm.beta, &norm.mean, &norm.variance].map(Vec::len);
                    let name = &block.name;
                    assert_eq!(lengths, [block.conv.outputs(); 4], "{name}: a value for each channel");
                    conv.norm = norm.clone();
                }
            }
        }
        self
    }

    /// Computes every row of every layer. O(n^2) for the neighbourhoods of n events.
    ///
    /// # Panics
    /// If `Batch::forward` refuses `stream`: a pixel, an order of times or a time difference.
    pub fn forward(&self, stream: Stream<'_>) -> EventTrace {
        let parts = self.network.parts();
        let mut levels = vec![event_level(self, stream)];
        self.run_blocks(0, &mut levels[0]);
        for (l, (pooling, level)) in parts.pooled.iter().enumerate() {
            let below_pooling = l.checked_sub(1).map(|below| &parts.pooled[below].0);
            let mut pooled = pool::level(self, (pooling, level.scale), &levels[l], below_pooling, stream);
            self.run_blocks(l + 1, &mut pooled);
            levels.push(pooled);
        }
        let readout = pool::readout(self, &levels[levels.len() - 1], stream);
        let prediction = self.after(&readout);
        EventTrace { levels, readout, prediction }
    }

    fn run_blocks(&self, l: usize, level: &mut ReferenceLevel) {
        for (conv, block) in self.blocks[l].iter().zip(&self.network.level(l).blocks) {
            let input = &level.features[block.input];
            let skip = block.skip.map(|skip| &level.features[skip]);
            let row = |row: usize| conv.row(input, row, &level.edges[row], skip.map(|skip| &skip[row][..]));
            let rows = (0..input.len()).map(row).collect();
            level.features.push(rows);
        }
    }

    /// Applies the head or the dense layers to the readout.
    fn after(&self, readout: &Rows) -> Vec<f64> {
        let cells = readout.len() / self.network.readout_times();
        let channels = self.network.readout_channels();
        // The image of a head has the cells of each channel together.
        let value = |i: usize| readout[i / cells / channels * cells + i % cells][i / cells % channels];
        let values: Vec<f64> = if self.network.parts().head.is_some() {
            (0..readout.len() * channels).map(value).collect()
        } else {
            readout.concat()
        };
        self.head.clone().push(&values).to_vec()
    }
}

/// The dense layers of `network` as a network over the values of the readout.
fn dense(network: &Network) -> FrameNetworkParts {
    let parts = network.parts();
    let layer = |(from, DenseLayer { name, dense }): (usize, &DenseLayer)| {
        let (weight, bias) = (dense.weight(), Some(dense.bias().to_vec()));
        let (outputs, activation) = (dense.outputs(), dense.activation());
        FrameLayer {
            name: name.clone(),
            from,
            kind: FrameLayerKind::Dense { outputs, weight, bias, activation },
        }
    };
    let cells = parts.readout.columns * parts.readout.rows * network.readout_times();
    let input = FrameShape::Vector(cells * network.readout_channels());
    FrameNetworkParts {
        name: parts.name.clone(),
        input,
        layers: parts.dense.iter().enumerate().map(layer).collect(),
        training: None,
    }
}

/// The event level: neighbourhoods from all pairs in the contract's order (smaller d2, then the
/// later event), d2 = ((dx / width)^2 + (dy / height)^2) + (dt / span)^2 from integer differences.
fn event_level(reference: &EventReference, stream: Stream<'_>) -> ReferenceLevel {
    let parts = reference.network.parts();
    let oldest = stream.now_us.saturating_sub(parts.span_us);
    let in_time = stream.events.iter().take_while(|e| e.t_us < oldest).count();
    let first = in_time.max(stream.events.len().saturating_sub(parts.capacity));
    // Events that have left the window are still inputs of rows that read them on arrival.
    let start = if parts.graph.is_frozen() { 0 } else { first };
    let events = &stream.events[start..];
    let extents =
        [f64::from(reference.sensor.width), f64::from(reference.sensor.height), parts.span_us as f64];
    let scaled = |integers: [i64; 3]| [0, 1, 2].map(|d| integers[d] as f64 / extents[d]);
    let difference = |source: &Event, reader: &Event| {
        let [x, y] = [(source.x, reader.x), (source.y, reader.y)].map(|(a, b)| i64::from(a) - i64::from(b));
        scaled([x, y, source.t_us - reader.t_us])
    };
    let neighbourhood = |i: usize| -> Vec<Edge> {
        let mut found: Vec<(f64, usize)> = candidates(reference, events, i)
            .filter(|&j| j != i)
            .map(|j| {
                let [x, y, t] = difference(&events[j], &events[i]);
                ((x * x + y * y) + t * t, j)
            })
            .filter(|(d2, _)| *d2 <= parts.graph.reach.limit())
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        found.truncate(parts.graph.reach.most());
        let edge =
            |(_, j): (f64, usize)| Edge::new(j, difference(&events[j], &events[i]), parts.events.scale);
        found.into_iter().map(edge).collect()
    };
    let position = |e: &Event| scaled([e.x.into(), e.y.into(), e.t_us - stream.epoch_us]);
    ReferenceLevel {
        edges: (0..events.len()).map(neighbourhood).collect(),
        features: vec![events.iter().map(|e| input(reference, e)).collect()],
        positions: events.iter().map(position).collect(),
        cells: Vec::new(),
        first: first - start,
    }
}

/// The input features of `event`.
fn input(reference: &EventReference, event: &Event) -> Vec<f64> {
    let mut row = vec![if event.on { 1.0 } else { -1.0 }];
    if let Some([x, y]) = reference.network.parts().place {
        // The cell of a pixel is found in integers; the pixel's centre can lie beyond its end.
        let along = |pixel: u16, extent: u16, size: Fraction| {
            let [n, d] = [size.numerator(), size.denominator()].map(u64::from);
            let (length, start) = (u64::from(extent) * n, u64::from(pixel) * d);
            let within = (start - start / length * length) as f64 + 0.5 * d as f64;
            2.0 * within / length as f64 - 1.0
        };
        row.push(along(event.x, reference.sensor.width, x));
        row.push(along(event.y, reference.sensor.height, y));
    }
    row
}

/// Range of event indices from which event `i` may read; it may include `i`.
fn candidates(reference: &EventReference, events: &[Event], i: usize) -> Range<usize> {
    let parts = reference.network.parts();
    match parts.graph.candidates {
        Candidates::All => 0..events.len(),
        Candidates::Past(_) if !parts.graph.is_frozen() => 0..i,
        Candidates::Past(_) => {
            // The window at the event's arrival, after evictions.
            let oldest = events[i].t_us.saturating_sub(parts.span_us);
            let in_time = events[..i].iter().take_while(|e| e.t_us < oldest).count();
            in_time.max((i + 1).saturating_sub(parts.capacity))..i
        }
    }
}
