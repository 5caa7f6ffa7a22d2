//! Run time against numerical error of approximated frame networks: Winograd's convolutions, and tolerances on pictures
//! with the noise of a camera. The exact and the approximated network take turns, picture by picture.
//! `cargo run --release -p meissner-benches --example frame_approximations`.
//!
//! Weights are drawn and pictures are synthetic: the errors are numerical, and say nothing about contact.

use std::time::Instant;

use meissner_benches::answers::Deviation;
use meissner_benches::report::{Column, Digits, print_table};
use meissner_benches::timing::median;
use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions, Skip};
use meissner_kernels::WinogradTile;
use meissner_models::random::Random;
use meissner_models::{FrameDescription, Weights};
use serde_json::{Value, json};

const NETWORKS: [&str; 2] = ["canf-plain", "canf"];
const WIDTH: usize = 320;
const HEIGHT: usize = 240;
const PICTURES: usize = 12;
/// Largest deviation of a pixel by noise, in levels of 255; each of four terms is uniform in a quarter of it.
const NOISE: f32 = 2.5;

const COLUMNS: [Column; 6] = [
    ("network", "network", Digits::Fixed(0)),
    ("approximation", "approximation", Digits::Fixed(0)),
    ("ms", "ms a picture", Digits::Fixed(1)),
    ("times", "times as fast", Digits::Fixed(2)),
    ("rms", "RMS error", Digits::Exponent),
    ("largest", "largest, of the exact map's RMS", Digits::Exponent),
];

fn main() {
    let pictures = pictures();
    let exact = (Convolution::Direct, Skip::Exact);
    let tile = |tile| (Convolution::Winograd(tile), Skip::Exact);
    let mut methods = vec![
        ("exact".to_owned(), exact),
        ("Winograd 2 x 2".to_owned(), tile(WinogradTile::Two)),
        ("Winograd 4 x 4".to_owned(), tile(WinogradTile::Four)),
    ];
    for tolerance in [0.003, 0.01, 0.03, 0.1] {
        methods.push((format!("tolerance {tolerance}"), (Convolution::Direct, Skip::Tolerance(tolerance))));
    }
    let mut rows = Vec::new();
    for name in NETWORKS {
        for (label, method) in &methods {
            rows.push(compare(name, label, [exact, *method], &pictures));
        }
    }
    print_table(&COLUMNS, &rows);
}

/// Runs the exact network and the approximated one picture by picture: medians, and the distance of their maps.
fn compare(name: &str, label: &str, methods: [(Convolution, Skip); 2], pictures: &[Vec<f32>]) -> Value {
    let mut engines = methods.map(|(convolution, skip)| engine(name, convolution, skip));
    let (mut times, mut maps) = ([vec![], vec![]], [vec![], vec![]]);
    for (i, picture) in pictures.iter().enumerate() {
        for turn in 0..2 {
            let which = (turn + i) % 2;
            let start = Instant::now();
            engines[which].push(picture).expect("finite pixels");
            maps[which].extend_from_slice(engines[which].predict().expect("numbers").values);
            // Both compute the first picture whole.
            if i > 0 {
                times[which].push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    let [exact_ms, ms] = times.map(median);
    let deviation = Deviation::between(&maps[0], &maps[1]);
    json!({
        "network": name, "approximation": label, "ms": ms, "times": exact_ms / ms,
        "rms": deviation.rms, "largest": deviation.max_by_rms,
    })
}

fn engine(name: &str, convolution: Convolution, skip: Skip) -> FrameEngine {
    let weights = Weights::shipped(name).expect("shipped");
    let parts = FrameDescription::shipped(name).expect("shipped").network_parts(&weights).expect("they fit");
    let network = FrameNetwork::new(parts, convolution).expect("consistent");
    FrameEngine::with_options(network, FrameOptions::new().with_skip(skip)).expect("an engine")
}

/// A gel with a gradient of light, a contact that moves by four pixels a picture, and noise; in levels of 255, then in units
/// of 1, channels first.
fn pictures() -> Vec<Vec<f32>> {
    let mut random = Random::new(1);
    let mut picture = |n: usize| {
        let level = |i: usize| {
            let (channel, y, x) = (i / (WIDTH * HEIGHT), i / WIDTH % HEIGHT, i % WIDTH);
            let light = 80.0 + 0.2 * x as f32 + 0.15 * y as f32 + 12.0 * channel as f32;
            let (dx, dy) = (x as f32 - 160.0 - 4.0 * n as f32, y as f32 - 120.0);
            let contact = 40.0 / (1.0 + (dx * dx + dy * dy) / 200.0);
            let contact = if contact < 1.0 { 0.0 } else { contact };
            let noise: f32 = random.values(4, NOISE / 4.0).iter().sum();
            (light + contact + noise).round() / 255.0
        };
        (0..3 * WIDTH * HEIGHT).map(level).collect()
    };
    (0..PICTURES).map(&mut picture).collect()
}
