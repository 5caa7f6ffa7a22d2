//! All shapes, then the recording.

use std::sync::Arc;

use meissner_benches::{networks, streams};
use meissner_engine::{Batch, Network, Search, Stream};
use meissner_models::Weights;
use pulp::x86::V4;

use crate::problem::{Error, Problem};
use crate::{report, wave};

/// Channels read, channels written, in-edges.
const SHAPES: [[usize; 3]; 8] = [
    [8, 16, 8],
    [8, 16, 16],
    [16, 16, 8],
    [16, 16, 16],
    [16, 32, 8],
    [16, 32, 16],
    [32, 32, 8],
    [32, 32, 16],
];
/// Places in the recording, and events looked at from each.
const PLACES: usize = 6;
const EVENTS: usize = 50;

/// Everything that the processor can run.
pub(crate) fn run() {
    let Some(v) = V4::try_new() else {
        println!("skipped: the integer rows need AVX-512 (F, VL, DQ, BW)");
        return;
    };
    let vnni =
        if cfg!(target_feature = "avx512vnni") { "one instruction (VNNI)" } else { "two instructions" };
    let network = network();
    let window = streams::window();
    let batch =
        Batch::new(network.clone(), window.sensor).expect("the sensor has pixels").with_search(Search::Grid);
    let trace = batch.forward(Stream::new(&window.events)).expect("finite");
    println!("integer products are added in {vnni}\n");
    println!(
        "| shape, in-edges | row | ns | ratio | multiply-adds | weights, KiB | error, max | error, RMS |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for shape in SHAPES {
        let problem = Problem::new(&trace, shape);
        match shape {
            [8, ..] => report::shape::<8, 1>(v, &problem),
            [16, 16, _] => report::shape::<16, 1>(v, &problem),
            [16, ..] => report::shape::<16, 2>(v, &problem),
            _ => report::shape::<32, 2>(v, &problem),
        }
    }
    waves(&network);
}

/// `graphres`, as published where that is there.
fn network() -> Arc<Network> {
    let published = streams::shared("data/checkpoints/contact_angle_graphres.safetensors");
    let weights = published.map(|path| Weights::load(path).expect("readable weights"));
    weights.map_or_else(|| networks::shipped("graphres"), |w| networks::with_weights("graphres", &w))
}

/// Prints what events change, layer by layer.
fn waves(network: &Arc<Network>) {
    let recording =
        streams::Recording::load("tactile_dots").unwrap_or_else(|| streams::Recording::synthetic(20_000));
    let places: Vec<usize> = (1..=PLACES).map(|i| recording.events.len() * i / (PLACES + 1)).collect();
    let waves = wave::waves(network, &recording, &places, EVENTS);
    let events = (PLACES * EVENTS) as f64;
    println!("\n{}, {events} events at {PLACES} places, a prediction after each\n", recording.name);
    println!(
        "| layer | activations | dirty rows an event | in-edges | changed | changed, % | few changed, % of rows | unchanged, % of rows |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let names: Vec<&str> = network.layers().into_iter().filter(|name| !name.starts_with("pool")).collect();
    for (layer, name) in names.iter().enumerate() {
        for (width, waves) in ["f32", "i16", "i8"].iter().zip(&waves) {
            let w = waves.layers[layer];
            let [stayed, edges, changed] = [w.stayed, w.edges, w.changed].map(|n| n as f64);
            println!(
                "| {name} | {width} | {:.1} | {:.1} | {:.1} | {:.0} | {:.0} | {:.1} |",
                w.dirty as f64 / events,
                edges / stayed,
                changed / stayed,
                100.0 * changed / edges,
                100.0 * w.few as f64 / stayed,
                100.0 * w.unchanged as f64 / stayed,
            );
        }
    }
    for (width, waves) in ["i16", "i8"].iter().zip(&waves[1..]) {
        let most = |of: fn(&Error) -> f64| waves.errors.iter().map(of).fold(0.0, f64::max);
        let (max, rms) = (most(|e| e.max), most(|e| e.rms));
        println!(
            "\n{width} x: error of the last layer at the worst of the places, max {max:.1e}, RMS {rms:.1e}"
        );
    }
}
