//! The networks that the suites run: the shipped ones, and ones that consist of a single stage.

use std::sync::Arc;

use meissner_engine::{
    Batch, Block, Candidates, ConvolutionScratch, DenseLayer, Fraction, GraphRule, Level, LevelTrace,
    Network, NetworkParts, Normalisation, Pooling, Position, Reach, Readout, Search, Sensor,
};
use meissner_kernels::{Activation, Dense, Isa, Matrix, SplineConv, SplineParts};
use meissner_models::random::Random;
use meissner_models::{Description, Weights};

use crate::streams::{SPAN_US, shared};

/// Shipped networks that run event by event.
pub const INCREMENTAL: [&str; 3] = ["graphres", "tactigraph", "tactigraph-past"];

/// A shipped network with its shipped weights.
///
/// # Panics
/// If there is none of that name.
pub fn shipped(name: &str) -> Arc<Network> {
    with_weights(name, &Weights::shipped(name).expect("shipped weights"))
}

/// `graphres` with the published checkpoint where the shared folder has it, else with the shipped weights; the weights,
/// and where they are from.
///
/// # Panics
/// If the weights cannot be read.
pub fn published_graphres() -> (Arc<Network>, Weights, &'static str) {
    let (source, weights) = match shared("data/checkpoints/contact_angle_graphres.safetensors") {
        Some(path) => ("published checkpoint", Weights::load(path).expect("readable weights")),
        None => ("shipped (drawn from a seed)", Weights::shipped("graphres").expect("shipped weights")),
    };
    (with_weights("graphres", &weights), weights, source)
}

/// The batch of a network that searches neighbours on a grid of pixels.
///
/// # Panics
/// If the sensor has no pixels.
pub fn grid_batch(network: &Arc<Network>, sensor: Sensor) -> Batch {
    Batch::new(network.clone(), sensor).expect("the sensor has pixels").with_search(Search::Grid)
}

/// The features that the blocks of `level` write over the graph of `trace`, after the one that enters the level.
///
/// `adjust` may change each feature after it is computed, and is told its block.
pub fn level_features(
    level: &Level,
    trace: &LevelTrace,
    entering: Matrix,
    mut adjust: impl FnMut(usize, &mut Matrix),
) -> Vec<Matrix> {
    let mut scratch = ConvolutionScratch::default();
    let mut features = vec![entering];
    for (b, block) in level.blocks.iter().enumerate() {
        let mut out = Matrix::zeros(trace.edges.rows(), block.conv.outputs());
        let (input, skip) = (&features[block.input], block.skip.map(|skip| &features[skip]));
        let row = |i| trace.edges.read(i, input.row(i), skip.map(|skip| skip.row(i)));
        let rows: Vec<_> = (0..out.rows()).map(row).collect();
        block.conv.rows(Isa::best(), input, &rows, &mut scratch, out.lanes_mut());
        adjust(b, &mut out);
        features.push(out);
    }
    features
}

/// A shipped network with other weights, whatever they were trained on: they are only timed.
///
/// # Panics
/// If there is none of that name, or the weights do not fit it.
pub fn with_weights(name: &str, weights: &Weights) -> Arc<Network> {
    let description = Description::shipped(name).expect("a shipped network");
    Arc::new(description.network_regardless(weights).expect("the weights fit"))
}

/// The event graph alone: polarities go straight to one cell and one output.
pub fn graph_only(k: usize, candidates: Candidates) -> Arc<Network> {
    build("graph", k, candidates, Vec::new(), Vec::new(), [1, 1])
}

/// The stages after the event level: a pooling with the published cells (where `pooled`), and a readout of 4 x 4 cells,
/// over `channels` channels.
///
/// A block with a single neighbour computes the channels. Their values differ from event to event; otherwise each event
/// that expires would be a maximum. A single channel is the polarity and needs no block; nearly all its values are maxima.
///
/// # Panics
/// Never: the parts fit.
pub fn pooling_only(channels: usize, pooled: bool, candidates: Candidates) -> Arc<Network> {
    let mut blocks = Vec::new();
    if channels > 1 {
        let weight = Random::new(7).values(8 * channels, 1.0);
        let parts = SplineParts {
            inputs: 1,
            outputs: channels,
            kernel: [2, 2, 2],
            root: Some(Random::new(8).values(channels, 1.0)),
            weight,
            ..SplineParts::default()
        };
        let conv = SplineConv::new(&parts).expect("sizes fit").into();
        blocks.push(Block { name: "spread".to_owned(), input: 0, skip: None, conv });
    }
    let fraction = |n, d| Fraction::new(n, d).expect("a positive fraction");
    let pooling = Pooling {
        name: "pool".to_owned(),
        from: blocks.len(),
        cell: [fraction(16, 346), fraction(12, 260)],
        time: None,
        position: Position::Mean,
    };
    let above = pooled.then(|| (pooling, Level { scale: 0.4, blocks: Vec::new() }));
    build("pooling", 1, candidates, blocks, above.into_iter().collect(), [4, 4])
}

fn build(
    name: &str,
    k: usize,
    candidates: Candidates,
    blocks: Vec<Block>,
    pooled: Vec<(Pooling, Level)>,
    grid: [usize; 2],
) -> Arc<Network> {
    let channels = blocks.last().map_or(1, |block| block.conv.outputs());
    let from = if pooled.is_empty() { blocks.len() } else { 0 };
    let cells = grid[0] * grid[1];
    let weight = Random::new(9).values(cells * channels, 0.1);
    let dense = Dense::new(cells, channels, 1, &weight, None, Activation::Identity).expect("sizes fit");
    let parts = NetworkParts {
        name: name.to_owned(),
        span_us: SPAN_US,
        capacity: 32_768,
        graph: GraphRule { reach: Reach::Knn { k }, candidates },
        normalisation: Normalisation::Fixed,
        events: Level { scale: 0.5, blocks },
        pooled,
        readout: Readout { from, columns: grid[0], rows: grid[1], by_time: false },
        dense: vec![DenseLayer { name: "out".to_owned(), dense }],
        head: None,
    };
    Arc::new(Network::new(parts).expect("the parts fit"))
}
