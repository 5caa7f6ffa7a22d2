//! The window of 7,006 events through `graphres` on one thread, to compare with other software:
//! `cargo run --release -p meissner-benches --example window -- [--export FILE] [--runs N]`.
//!
//! Prints one JSON object. `--export` also writes a peer's inputs (positions, polarities,
//! neighbours, weights) and the expected results (the fifth block's rows, the prediction).

use std::collections::BTreeMap;
use std::hint::black_box;
use std::sync::Arc;

use meissner_benches::streams::{self, Recording, SPAN_US, WINDOW};
use meissner_benches::{Result, networks, timing};
use meissner_engine::{Batch, Candidates, ConvolutionScratch, EngineError, Network, Stream, Trace};
use meissner_kernels::{Isa, Matrix};
use meissner_models::{Tensor, Weights};
use serde_json::json;

const K: usize = 16;

fn main() -> Result<()> {
    let (mut export, mut runs) = (None, 15);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match (argument.as_str(), arguments.next()) {
            ("--export", Some(path)) => export = Some(path),
            ("--runs", Some(count)) => runs = count.parse()?,
            _ => return Err("usage: window [--export FILE] [--runs N]".into()),
        }
    }
    let window = streams::window();
    let (network, weights, source) = networks::published_graphres();
    let batch = networks::grid_batch(&network, window.sensor);
    let graph = networks::grid_batch(&networks::graph_only(K, Candidates::All), window.sensor);
    let stream = Stream::new(&window.events);
    let trace = batch.forward(stream)?;
    check(&network, &window, &batch, &trace)?;
    if let Some(path) = export {
        std::fs::write(path, safetensors(&window, &network, &trace, &weights)?)?;
    }
    let graph_ms = timing::median_ms(runs, || black_box(graph.forward(stream)).map(drop))?;
    let layers_ms = timing::median_ms(runs, || {
        black_box(Ok::<_, EngineError>(event_layers(&network, &trace))).map(drop)
    })?;
    let forward_ms = timing::median_ms(runs, || black_box(batch.forward(stream)).map(drop))?;
    let report = json!({
        "window": window.name,
        "weights": source,
        "isa": Isa::best().name(),
        "runs": runs,
        "graph_ms": graph_ms,
        "event_layers_ms": layers_ms,
        "forward_ms": forward_ms,
    });
    println!("{report}");
    Ok(())
}

/// Checks that the graph equals a k-d tree's, that the layers alone equal the complete pass, and
/// that the engine agrees.
fn check(network: &Arc<Network>, window: &Recording, batch: &Batch, trace: &Trace) -> Result<()> {
    let tree = batch.clone().with_search(networks::TREE).forward(Stream::new(&window.events))?;
    let neighbours = |trace: &Trace, row| trace.levels[0].edges.row(row).to_vec();
    for row in 0..WINDOW {
        assert_eq!(neighbours(trace, row), neighbours(&tree, row), "neighbours of {row}");
    }
    let features = event_layers(network, trace);
    for (alone, whole) in features.iter().zip(&trace.levels[0].features) {
        assert_eq!(alone.lanes(), whole.lanes(), "a layer alone");
    }
    timing::checked_engine(network, window.sensor, &window.events);
    Ok(())
}

/// The features of the event level, given its graph.
fn event_layers(network: &Network, trace: &Trace) -> Vec<Matrix> {
    let level = &trace.levels[0];
    let mut scratch = ConvolutionScratch::default();
    let mut features = vec![level.features[0].clone()];
    for block in &network.level(0).blocks {
        let mut out = Matrix::zeros(level.edges.rows(), block.conv.outputs());
        let (input, skip) = (&features[block.input], block.skip.map(|skip| &features[skip]));
        let row = |i| level.edges.read(i, input.row(i), skip.map(|skip| skip.row(i)));
        let rows: Vec<_> = (0..out.rows()).map(row).collect();
        block.conv.rows(Isa::best(), input, &rows, &mut scratch, out.lanes_mut());
        features.push(out);
    }
    features
}

/// The window for a peer. Indices are f32 as well: below 2^24 they are exact.
fn safetensors(window: &Recording, network: &Network, trace: &Trace, weights: &Weights) -> Result<Vec<u8>> {
    let level = &trace.levels[0];
    let blocks = network.level(0).blocks.len();
    let near = (0..WINDOW).flat_map(|row| level.edges.row(row).iter().map(|n| n.row as f32)).collect();
    let attributes = (0..WINDOW).flat_map(|row| level.edges.row(row).iter().flat_map(|n| n.u)).collect();
    let positions = level.positions.iter().flatten().map(|&p| p as f32).collect();
    let last = &level.features[blocks];
    let rows =
        |matrix: &Matrix| (0..matrix.rows()).flat_map(|row| matrix.values(row).collect::<Vec<_>>()).collect();
    let tensors: [(&str, Vec<usize>, Vec<f32>); 6] = [
        ("window.near", vec![WINDOW, K], near),
        ("window.attributes", vec![WINDOW, K, 3], attributes),
        ("window.positions", vec![WINDOW, 3], positions),
        ("window.polarity", vec![WINDOW, 1], rows(&level.features[0])),
        ("window.conv5", vec![WINDOW, last.columns()], rows(last)),
        ("window.prediction", vec![trace.prediction.len()], trace.prediction.clone()),
    ];
    let mut all = Vec::new();
    for (name, shape, values) in tensors {
        all.push((name.to_owned(), Tensor::new(shape, values).ok_or("a shape that fits")?));
    }
    all.extend(weights.iter().map(|(name, tensor)| (name.to_owned(), tensor.clone())));
    let about = [
        ("window", window.name.clone()),
        ("span_us", SPAN_US.to_string()),
        ("scale", network.level(0).scale.to_string()),
        ("pooled_scale", network.level(1).scale.to_string()),
    ];
    let about: BTreeMap<String, String> = about.map(|(key, value)| (key.to_owned(), value)).into();
    Ok(Weights::new(all).to_safetensors(&about))
}
