//! Our side of the comparison with other people's software: the window of 7,006 events through `graphres`, on one
//! thread; `cargo run --release -p meissner-benches --example window -- [--export FILE] [--runs N]`.
//!
//! Prints one JSON object. `--export` also writes everything that a peer needs (positions, polarities, neighbours,
//! weights) and what it must find (the fifth block's rows, the prediction) to a safetensors file.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Instant;

use meissner_benches::streams::{self, Recording, SPAN_US, WINDOW};
use meissner_benches::{check, networks, timing, tree};
use meissner_engine::{Batch, Candidates, Engine, Network, Search, Stream, Trace};
use meissner_kernels::{Isa, Matrix, SplineRow, SplineScratch};
use meissner_models::{Tensor, Weights};
use serde_json::json;

const K: usize = 16;

fn main() -> Result<(), Box<dyn std::error::Error>> {
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
    let (source, weights) = match streams::shared("data/checkpoints/contact_angle_graphres.safetensors") {
        Some(path) => ("published checkpoint", Weights::load(path)?),
        None => ("shipped (drawn from a seed)", Weights::shipped("graphres").ok_or("shipped weights")?),
    };
    let network = networks::with_weights("graphres", &weights);
    let batch = Batch::new(network.clone(), window.sensor)?.with_search(Search::Grid);
    let graph =
        Batch::new(networks::graph_only(K, Candidates::All), window.sensor)?.with_search(Search::Grid);
    let stream = Stream::new(&window.events);
    let trace = batch.forward(stream)?;
    check(&network, &window, &trace)?;
    if let Some(path) = export {
        std::fs::write(path, safetensors(&window, &network, &trace, &weights)?)?;
    }
    let isa = Isa::best();
    let graph_ms = milliseconds(runs, || _ = black_box(graph.forward(stream)));
    let layers_ms = milliseconds(runs, || _ = black_box(event_layers(&network, &trace, isa)));
    let forward_ms = milliseconds(runs, || _ = black_box(batch.forward(stream)));
    let report = json!({
        "window": window.name,
        "weights": source,
        "isa": isa.name(),
        "runs": runs,
        "graph_ms": graph_ms,
        "event_layers_ms": layers_ms,
        "forward_ms": forward_ms,
    });
    println!("{report}");
    Ok(())
}

/// Median time of `call` after one call to warm up.
fn milliseconds(runs: usize, mut call: impl FnMut()) -> f64 {
    call();
    let time = |_| {
        let start = Instant::now();
        call();
        start.elapsed().as_secs_f64() * 1e3
    };
    timing::median((0..runs).map(time).collect())
}

/// The graph is a k-d tree's, the layers alone are the whole pass's, and the engine agrees.
fn check(
    network: &std::sync::Arc<Network>,
    window: &Recording,
    trace: &Trace,
) -> Result<(), Box<dyn std::error::Error>> {
    let edges = &trace.levels[0].edges;
    for (row, expected) in tree::neighbourhoods(window, K).iter().enumerate() {
        assert!(edges.row(row).iter().map(|n| n.row).eq(expected.iter().copied()), "neighbours of {row}");
    }
    let features = event_layers(network, trace, Isa::best());
    for (alone, whole) in features.iter().zip(&trace.levels[0].features[1..]) {
        assert_eq!(alone.lanes(), whole.lanes(), "a layer alone");
    }
    let mut engine = Engine::new(network.clone(), window.sensor)?;
    engine.push_slice(&window.events);
    check::engine_equals_batch(&mut engine, &window.events);
    Ok(())
}

/// The blocks of the event level, given its graph.
fn event_layers(network: &Network, trace: &Trace, isa: Isa) -> Vec<Matrix> {
    let level = &trace.levels[0];
    let mut scratch = SplineScratch::default();
    let mut written: Vec<Matrix> = Vec::new();
    for block in &network.level(0).blocks {
        let mut out = Matrix::zeros(level.edges.rows(), block.conv.outputs());
        let feature = |index: usize| if index == 0 { &level.features[0] } else { &written[index - 1] };
        let (features, skip) = (feature(block.input), block.skip.map(feature));
        let skip = |row| skip.map(|skip: &Matrix| skip.row(row));
        let row =
            |i| SplineRow { neighbours: level.edges.row(i), basis: &[], own: features.row(i), skip: skip(i) };
        let rows: Vec<_> = (0..out.rows()).map(row).collect();
        block.conv.rows(isa, features, &rows, &mut scratch, out.lanes_mut());
        written.push(out);
    }
    written
}

/// The window for a peer. Indices are f32 as well: below 2^24 they are exact.
fn safetensors(
    window: &Recording,
    network: &Network,
    trace: &Trace,
    weights: &Weights,
) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
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
