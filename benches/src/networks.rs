//! The networks that the suites run: the shipped ones, and ones that consist of a single stage.

use std::sync::Arc;

use meissner_engine::{
    Block, Candidates, DenseLayer, Fraction, GraphRule, Level, Network, NetworkParts, Normalisation, Pooling,
    Position, Reach, Readout,
};
use meissner_kernels::{Activation, Dense, SplineConv, SplineParts};
use meissner_models::{Description, Weights};

use crate::streams::SPAN_US;
use meissner_models::random::Random;

/// Shipped networks that run event by event.
pub const INCREMENTAL: [&str; 3] = ["graphres", "tactigraph", "tactigraph-past"];

/// A shipped network with its shipped weights.
///
/// # Panics
/// If there is none of that name.
pub fn shipped(name: &str) -> Arc<Network> {
    with_weights(name, &Weights::shipped(name).expect("shipped weights"))
}

/// A shipped network with other weights, whatever they were trained on: they are there to be timed.
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

/// What lies behind the event level: a pooling with the published cells (where `pooled`), and a readout of 4 x 4
/// cells, over `channels` channels.
///
/// A block with a single neighbour makes the channels: they have to come from somewhere, and values must differ from
/// event to event, or each one that leaves would be a maximum. One channel is the polarity, and needs no block; there
/// nearly all are maxima.
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
        let conv = SplineConv::new(&parts).expect("sizes fit");
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
