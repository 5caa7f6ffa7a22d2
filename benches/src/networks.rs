//! The networks that the suites run: the shipped ones, and networks with a single stage.

use std::sync::Arc;

use meissner_engine::{Batch, Candidates, GraphRule, Network, Reach, Search, Sensor};
use meissner_models::{Description, Weights};
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};

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

/// `graphres` with the published checkpoint if the shared folder has it, else with the shipped
/// weights; also the weights, and their source.
///
/// # Panics
/// If the weights cannot be read.
pub fn published_graphres() -> (Arc<Network>, Weights, &'static str) {
    let (source, weights) = match shared("data/checkpoints/contact_angle_graphres.safetensors") {
        Some(path) => ("published checkpoint", Weights::load(path).expect("readable weights")),
        None => ("shipped", Weights::shipped("graphres").expect("shipped weights")),
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

/// The search with a k-d tree, which shares nothing with the engine's, in the same exact order.
pub const TREE: Search = Search::Proposed(meissner_reference::from_tree);

/// A shipped network with other weights. Their training does not matter, because they are only
/// timed.
fn with_weights(name: &str, weights: &Weights) -> Arc<Network> {
    let description = Description::shipped(name).expect("a shipped network");
    Arc::new(description.network_ignoring_preparation(weights).expect("the weights fit"))
}

/// The event graph alone: polarities go straight to one cell and one output.
pub fn graph_only(k: usize, candidates: Candidates) -> Arc<Network> {
    build(k, candidates, [1, 1], Vec::new(), false)
}

/// The stages after the event level: a pooling (if `pooled`) and a readout of 4 x 4 cells.
///
/// A block with a single neighbour computes the channels, so that values differ from event to
/// event. A single channel is the polarity and needs no block.
pub fn pooling_only(channels: usize, pooled: bool, candidates: Candidates) -> Arc<Network> {
    let extras = [true, false, false, false];
    let conv = ConvolutionShape::Spline([2; 3]);
    let block = (channels > 1).then_some(BlockShape { channels, conv, input: 0, skip: None, extras });
    build(1, candidates, [4, 4], block.into_iter().collect(), pooled)
}

fn build(
    k: usize,
    candidates: Candidates,
    grid: [usize; 2],
    blocks: Vec<BlockShape>,
    pooled: bool,
) -> Arc<Network> {
    let from = blocks.len();
    let cell = [(16, 346), (12, 260)];
    let pool = pooled.then_some(PoolShape { from, cell, time: None, mean: true, blocks: Vec::new() });
    let shape = NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k }, candidates },
        span_us: SPAN_US,
        capacity: 32_768,
        place: None,
        blocks,
        pooled: pool.into_iter().collect(),
        from: if pooled { 0 } else { from },
        grid,
        dense: vec![1],
        head: None,
        seed: 7,
    };
    Arc::new(shape.build())
}
