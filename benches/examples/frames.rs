//! Times a frame network on given weights and an input, for `benches/peers/frames.py`.
//!
//! `cargo run --release -p meissner-benches --example frames -- NETWORK FILE [--runs N]
//! [--recording FILE]...`
//!
//! FILE holds weights, an input x and the answer y, which is compared to 1e-4 of its largest
//! magnitude. Prints JSON: the instruction set, and for each method the median milliseconds of the
//! whole input and the largest relative error.
//!
//! An image network is also timed with exact skipping while a rectangle, a tenth of the image,
//! moves; with --recording, on signed frames of 150 ms, 10 ms apart: milliseconds a frame, and the
//! predictions compared in bits.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use meissner_benches::Result;
use meissner_benches::timing::{median_ms, relative_error};
use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions, FrameShape, Skip};
use meissner_engine::representations::{Crop, SignedRule, SlidingSigned};
use meissner_kernels::random::Random;
use meissner_kernels::{Isa, WinogradTile};
use meissner_models::{FrameDescription, Weights};
use meissner_verify::bits;

const MAX_ERROR: f64 = 1e-4;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let usage = "usage: frames NETWORK FILE [--runs N] [--recording FILE]...";
    let [name, file, rest @ ..] = &arguments[..] else { return Err(usage.into()) };
    let (mut runs, mut recordings) = (15, Vec::new());
    for pair in rest.chunks(2) {
        match pair {
            [flag, n] if flag == "--runs" => runs = n.parse::<usize>()?.max(1),
            [flag, path] if flag == "--recording" => recordings.push(path),
            _ => return Err(usage.into()),
        }
    }
    let description = FrameDescription::shipped(name).ok_or("no shipped frame network of that name")?;
    let weights = Weights::load(file)?;
    let case = Case::new(&description, &weights)?;
    let (mut ms, mut error) = (BTreeMap::new(), BTreeMap::new());
    if recordings.is_empty() {
        let mut methods = vec![("direct", Convolution::Direct, false)];
        let one_image = case.steps == 1 && matches!(description.input(), FrameShape::Image { .. });
        if one_image {
            methods.push(("winograd 2x2", Convolution::Winograd(WinogradTile::Two), false));
            methods.push(("winograd 4x4", Convolution::Winograd(WinogradTile::Four), false));
            methods.push(("direct, two threads", Convolution::Direct, true));
        }
        for (method, convolution, two_threads) in methods {
            let options = FrameOptions::new().with_skip(Skip::Nothing).with_two_threads(two_threads);
            let (median, worst) = case.whole(case.engine(convolution, options)?, runs)?;
            ms.insert(method.to_owned(), median);
            error.insert(method.to_owned(), worst);
        }
        if one_image {
            let frames = moving_rectangle(case.x, description.input(), runs + 1);
            let skipping = case.sequence(&frames, FrameOptions::default())?;
            ms.insert("direct, a tenth changes".to_owned(), skipping);
        }
    }
    for path in recordings {
        let frames = signed_frames(Path::new(path), description.input())?;
        let options = FrameOptions::new().with_sparse(true);
        let name = Path::new(path).file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let name = name.unwrap_or_default();
        ms.insert(format!("direct, {name}"), case.sequence(&frames, options)?);
    }
    println!("{}", serde_json::json!({ "isa": Isa::best().name(), "ms": ms, "error": error }));
    Ok(())
}

/// A network with weights, an input and the answer.
struct Case<'a> {
    description: &'a FrameDescription,
    weights: &'a Weights,
    x: &'a [f32],
    y: &'a [f32],
    steps: usize,
}

impl<'a> Case<'a> {
    fn new(description: &'a FrameDescription, weights: &'a Weights) -> Result<Self> {
        let values = |tensor| weights.get(tensor).and_then(|t| t.values()).ok_or("the file holds no x and y");
        let (x, y) = (values("x")?, values("y")?);
        Ok(Self { description, weights, x, y, steps: x.len() / description.input().values() })
    }

    fn engine(&self, convolution: Convolution, options: FrameOptions) -> Result<FrameEngine> {
        let network = FrameNetwork::new(self.description.network_parts(self.weights)?, convolution)?;
        Ok(FrameEngine::with_options(network, options)?)
    }

    /// Median milliseconds of the whole input, and the largest relative error.
    fn whole(&self, mut engine: FrameEngine, runs: usize) -> Result<(f64, f64)> {
        let Self { x, y, steps, .. } = *self;
        let mut answer = Vec::new();
        let mut forward = |answer: &mut Vec<f32>| -> Result<()> {
            answer.clear();
            engine.reset();
            for frame in x.chunks_exact(x.len() / steps) {
                engine.push(frame)?;
                // If there is an answer for each frame.
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
        let worst = relative_error(y, &answer);
        if answer.len() != y.len() || worst > MAX_ERROR {
            return Err(format!("error {worst:e}, expected at most {MAX_ERROR:e}").into());
        }
        Ok((median_ms(runs, || forward(&mut answer))?, worst))
    }

    /// Mean milliseconds a frame after the first; predictions have the bits of no skipping.
    fn sequence(&self, frames: &[Vec<f32>], options: FrameOptions) -> Result<f64> {
        let all = options.with_skip(Skip::Nothing).with_sparse(false);
        let mut whole = self.engine(Convolution::Direct, all)?;
        let mut engine = self.engine(Convolution::Direct, options)?;
        let mut seconds = 0.0;
        for (n, frame) in frames.iter().enumerate() {
            let start = Instant::now();
            engine.push(frame)?;
            let prediction = engine.predict()?.values;
            if n > 0 {
                seconds += start.elapsed().as_secs_f64();
            }
            // Every tenth: computing everything takes as long as ten frames.
            if n % 10 == 0 {
                whole.push(frame)?;
                let expected = whole.predict()?.values;
                if bits(prediction) != bits(expected) {
                    return Err(format!("frame {n}: skipping changed the prediction").into());
                }
            }
        }
        Ok(seconds * 1e3 / (frames.len().max(2) - 1) as f64)
    }
}

/// The image `x` with a rectangle, a tenth of it, replaced at a different position each time.
fn moving_rectangle(x: &[f32], shape: FrameShape, count: usize) -> Vec<Vec<f32>> {
    let FrameShape::Image { channels, height, width } = shape else { return Vec::new() };
    let (rows, columns) = (height * 316 / 1000, width * 316 / 1000);
    let mut random = Random::new(1);
    let mut frame = x.to_vec();
    (0..count)
        .map(|n| {
            let (y, x) = (n * 37 % (height - rows), n * 61 % (width - columns));
            for c in 0..channels {
                for row in y..y + rows {
                    let values = random.values(columns, 1.0);
                    frame[(c * height + row) * width + x..][..columns].copy_from_slice(&values);
                }
            }
            frame.clone()
        })
        .collect()
}

/// Up to 400 signed frames of 150 ms, 10 ms apart, in the upper left of `shape`.
fn signed_frames(path: &Path, shape: FrameShape) -> Result<Vec<Vec<f32>>> {
    let FrameShape::Image { channels: 1, height, width } = shape else {
        return Err("one channel is needed".into());
    };
    let recording = meissner_io::read(path)?;
    let sensor = recording.sensor.ok_or("the recording does not name its sensor")?;
    let crop = Crop::whole(sensor);
    let capacity = SlidingSigned::DEFAULT_CAPACITY;
    let mut window = SlidingSigned::new(sensor, crop, SignedRule::Sum, 150_000, capacity)?;
    let mut frames = Vec::new();
    let mut due: Option<i64> = None;
    for event in recording.events {
        let end = *due.get_or_insert(event.t_us + 10_000);
        if event.t_us >= end {
            window.advance(end);
            let mut frame = vec![0.0; height * width];
            let values = window.frame().values;
            for (to, from) in
                frame.chunks_exact_mut(width).zip(values.chunks_exact(usize::from(sensor.width)))
            {
                let columns = from.len().min(width);
                to[..columns].copy_from_slice(&from[..columns]);
            }
            frames.push(frame);
            due = Some(end + (event.t_us - end) / 10_000 * 10_000 + 10_000);
            if frames.len() == 400 {
                break;
            }
        }
        window.push(event);
    }
    Ok(frames)
}
