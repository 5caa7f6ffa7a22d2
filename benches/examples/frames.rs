//! Times a frame network on given weights and an input, for `benches/peers/frames.py`.
//!
//!     cargo run --release -p meissner-benches --example frames -- NETWORK FILE [--runs N]
//!
//! FILE holds the network's weights, an input x and the answer y. The answer is compared before anything is timed, to 1e-4
//! of its largest magnitude. Prints one JSON object: the instruction set, and by way of computing the median milliseconds
//! of the whole input with nothing skipped, and the largest error relative to the largest magnitude.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions, FrameShape, Skip};
use meissner_kernels::{Isa, WinogradTile};
use meissner_models::{FrameDescription, Weights};

const LARGEST_ERROR: f32 = 1e-4;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, file, rest @ ..] = &arguments[..] else {
        return Err("usage: frames NETWORK FILE [--runs N]".into());
    };
    let runs = match rest {
        [flag, runs] if flag == "--runs" => runs.parse::<usize>()?.max(1),
        _ => 15,
    };
    let description = FrameDescription::shipped(name).ok_or("no shipped frame network of that name")?;
    let weights = Weights::load(file)?;
    let values = |tensor| weights.get(tensor).and_then(|t| t.values()).ok_or("the file holds no x and y");
    let (x, y) = (values("x")?, values("y")?);
    let steps = x.len() / description.input().values();
    let images = matches!(description.input(), FrameShape::Image { .. });
    let mut ways = vec![("direct", Convolution::Direct, false)];
    if images && steps == 1 {
        ways.push(("winograd 2x2", Convolution::Winograd(WinogradTile::Two), false));
        ways.push(("winograd 4x4", Convolution::Winograd(WinogradTile::Four), false));
        ways.push(("direct, two threads", Convolution::Direct, true));
    }
    let (mut ms, mut error) = (BTreeMap::new(), BTreeMap::new());
    if let Ok(only) = std::env::var("ONLY") {
        ways.retain(|(way, ..)| *way == only);
    }
    for (way, convolution, two_threads) in ways {
        let network = FrameNetwork::new(description.network_parts(&weights)?, convolution)?;
        let options = FrameOptions { skip: Skip::Nothing, two_threads, ..FrameOptions::default() };
        let mut engine = FrameEngine::new(Arc::new(network), options)?;
        let mut answer = Vec::new();
        let mut forward = |answer: &mut Vec<f32>| -> Result<(), Box<dyn std::error::Error>> {
            answer.clear();
            engine.reset();
            for frame in x.chunks_exact(x.len() / steps) {
                engine.push(frame)?;
                // Where there is an answer for each frame.
                if y.len() == steps {
                    answer.extend_from_slice(engine.predict()?.values);
                }
            }
            if y.len() != steps {
                answer.extend_from_slice(engine.predict()?.values);
            }
            Ok(())
        };
        forward(&mut answer)?;
        let largest = y.iter().fold(0.0f32, |m, v| m.max(v.abs()));
        let worst = answer.iter().zip(y).fold(0.0f32, |m, (a, b)| m.max((a - b).abs())) / largest;
        if answer.len() != y.len() || worst > LARGEST_ERROR {
            return Err(format!("{name}, {way}: error {worst:e}, expected at most {LARGEST_ERROR:e}").into());
        }
        let mut times = Vec::with_capacity(runs);
        for _ in 0..runs {
            let start = Instant::now();
            forward(&mut answer)?;
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        times.sort_by(f64::total_cmp);
        ms.insert(way, times[runs / 2]);
        error.insert(way, worst);
    }
    println!("{}", serde_json::json!({ "isa": Isa::best().name(), "ms": ms, "error": error }));
    Ok(())
}
