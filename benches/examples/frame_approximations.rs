//! Run time against numerical error of frame networks, by turns with the exact one: Winograd's convolutions, and tolerances
//! on pictures with the noise of a camera. `cargo run --release -p meissner-benches --example frame_approximations`.
//!
//! Weights are drawn and pictures made, so that errors are of numbers, and mean nothing about contact.

use std::time::Instant;

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions, Skip};
use meissner_kernels::WinogradTile;
use meissner_models::random::Random;
use meissner_models::{FrameDescription, Weights};

const NETWORKS: [&str; 2] = ["canf-plain", "canf"];
const WIDTH: usize = 320;
const HEIGHT: usize = 240;
const PICTURES: usize = 12;
/// Largest deviation of a pixel by noise, in levels of 255; each of four terms is uniform in a quarter of it.
const NOISE: f32 = 2.5;

fn main() {
    let pictures = pictures();
    println!(
        "network     approximation    ms a picture  times as fast  RMS error  largest, of the exact map's RMS"
    );
    for name in NETWORKS {
        let exact = (Convolution::Direct, Skip::Exact);
        let tile = |tile| (Convolution::Winograd(tile), Skip::Exact);
        let mut ways = vec![
            ("exact".to_owned(), exact),
            ("Winograd 2 x 2".to_owned(), tile(WinogradTile::Two)),
            ("Winograd 4 x 4".to_owned(), tile(WinogradTile::Four)),
        ];
        for tolerance in [0.003, 0.01, 0.03, 0.1] {
            ways.push((format!("tolerance {tolerance}"), (Convolution::Direct, Skip::Tolerance(tolerance))));
        }
        for (label, way) in ways {
            compare(name, &label, [exact, way], &pictures);
        }
    }
}

/// Runs the exact network and `way` picture by picture, and prints medians and how far the maps are from each other.
fn compare(name: &str, label: &str, ways: [(Convolution, Skip); 2], pictures: &[Vec<f32>]) {
    let mut engines = ways.map(|(convolution, skip)| engine(name, convolution, skip));
    let mut times = [vec![], vec![]];
    let (mut squares, mut exact_squares, mut largest) = (0.0, 0.0, 0.0f64);
    for (i, picture) in pictures.iter().enumerate() {
        let mut maps = [vec![], vec![]];
        for turn in 0..2 {
            let way = (turn + i) % 2;
            let start = Instant::now();
            engines[way].push(picture).expect("finite pixels");
            maps[way] = engines[way].predict().expect("numbers").values.to_vec();
            // The first picture is computed whole by either.
            if i > 0 {
                times[way].push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
        for (&exact, &found) in maps[0].iter().zip(&maps[1]) {
            let difference = f64::from(found) - f64::from(exact);
            squares += difference * difference;
            exact_squares += f64::from(exact) * f64::from(exact);
            largest = largest.max(difference.abs());
        }
    }
    let [exact_ms, ms] = times.map(median);
    let rms = exact_squares.sqrt();
    let pixels = (pictures.len() * WIDTH * HEIGHT) as f64;
    println!(
        "{name:<11} {label:<16} {ms:>12.1} {:>14.2} {:>10.1e} {:>10.1e}",
        exact_ms / ms,
        squares.sqrt() / rms,
        largest * pixels.sqrt() / rms,
    );
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

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
