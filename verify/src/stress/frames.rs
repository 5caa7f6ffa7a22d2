//! Frame networks that strain the arithmetic: with skipping, completely, and in f64.

use std::sync::Arc;
use std::time::Instant;

use meissner_engine::EngineError;
use meissner_engine::frames::{
    Convolution, FrameEngine, FrameLayer, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameOptions,
    FrameShape, Skip,
};
use meissner_kernels::random::Random;
use meissner_kernels::{Activation, WinogradTile};
use meissner_reference::{Difference, FrameReference};

use super::{CaseResult, Errors, Expect, Prepared, Run, Size, WITHIN};
use crate::error::VerifyError;

/// The frame of a step.
type Frames = fn(step: u64, &mut Random, frame: &mut [f32]);

/// A network and its frames.
#[derive(Clone, Debug)]
struct FrameRun {
    parts: FrameNetworkParts,
    convolution: Convolution,
    frames: Frames,
    steps: u64,
}

/// Maximum number of timed frames.
const TIMED: u64 = 20_000;
/// Frames from one reading of all layers to the next.
const LAYERS_EVERY: u64 = 997;

/// A layer that reads the one before.
fn layer(name: &str, from: usize, kind: FrameLayerKind) -> FrameLayer {
    FrameLayer { name: name.to_owned(), from, kind }
}

impl FrameRun {
    fn engine(&self, skip: Skip) -> Result<FrameEngine, EngineError> {
        let network = Arc::new(FrameNetwork::new(self.parts.clone(), self.convolution)?);
        FrameEngine::with_options(network, FrameOptions::new().with_skip(skip))
    }

    /// Passes the first `steps` frames, in order, to `take`.
    fn each(
        &self,
        steps: u64,
        mut take: impl FnMut(u64, &[f32]) -> Result<(), EngineError>,
    ) -> Result<(), EngineError> {
        let (mut random, mut frame) = (Random::new(1), vec![0.0; self.parts.input.values()]);
        (0..steps).try_for_each(|step| {
            (self.frames)(step, &mut random, &mut frame);
            take(step, &frame)
        })
    }
}

impl Run for FrameRun {
    fn network(&self) -> String {
        match self.convolution {
            Convolution::Direct => format!("{}, directly", self.parts.name),
            Convolution::Winograd(tile) => format!("{}, F({1} x {1})", self.parts.name, tile.size()),
            Convolution::Kn2row => format!("{}, kn2row", self.parts.name),
        }
    }

    fn compare(&self, result: &mut CaseResult) -> Result<(), VerifyError> {
        let mut skipping = self.engine(Skip::Exact)?;
        let mut whole = self.engine(Skip::Nothing)?;
        let mut reference = FrameReference::new(self.parts.clone())?;
        let mut wide = Vec::with_capacity(self.parts.input.values());
        let mut errors = Difference::default();
        self.each(self.steps, |step, frame| {
            skipping.push(frame)?;
            whole.push(frame)?;
            wide.clear();
            wide.extend(frame.iter().map(|&v| f64::from(v)));
            let want = reference.push(&wide);
            let got = skipping.predict().map(|prediction| prediction.values.to_vec());
            if let Ok(got) = &got {
                errors.add_all(got, want);
            }
            result.compare(&got, &whole.predict().map(|prediction| prediction.values.to_vec()));
            if step % LAYERS_EVERY == 0 || step + 1 == self.steps {
                let layers = (0..self.parts.layers.len()).flat_map(|layer| reference.layer(layer));
                result.largest_activation = layers.fold(result.largest_activation, |m, v| m.max(v.abs()));
            }
            Ok(())
        })?;
        result.steps = self.steps;
        result.prediction = (errors.values > 0).then(|| Errors::from(&errors));
        Ok(())
    }

    fn time_us(&self) -> Result<f64, EngineError> {
        let mut engine = self.engine(Skip::Nothing)?;
        let steps = self.steps.min(TIMED);
        // Making the frames is not timed.
        let mut frames = Vec::with_capacity(self.parts.input.values() * steps as usize);
        self.each(steps, |_, frame| {
            frames.extend_from_slice(frame);
            Ok(())
        })?;
        let start = Instant::now();
        for frame in frames.chunks_exact(self.parts.input.values()) {
            engine.push(frame)?;
            // A refused prediction is timed, too.
            let _ = engine.predict();
        }
        Ok(start.elapsed().as_secs_f64() * 1e6 / steps as f64)
    }
}

/// A kind of recurrent layer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell {
    pub(crate) name: &'static str,
    /// Whether it is a convolutional LSTM over planes; otherwise an LSTM over vectors.
    convolutional: bool,
    /// Whether its gates see the cells.
    peepholes: bool,
}

pub(crate) const CELLS: [Cell; 3] = [
    Cell { name: "lstm", convolutional: false, peepholes: false },
    Cell { name: "convlstm", convolutional: true, peepholes: false },
    Cell { name: "convlstm with peepholes", convolutional: true, peepholes: true },
];

/// Gates that are saturated, open or closed, over many frames.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gates {
    pub(crate) name: &'static str,
    /// Biases of i, f, g and o.
    bias: [f32; 4],
    /// Largest weights on the frame and on the state.
    weights: [f32; 2],
    /// Largest weight of a peephole.
    peepholes: f32,
    frames: Frames,
    within: f64,
}

fn noise(_: u64, random: &mut Random, frame: &mut [f32]) {
    frame.iter_mut().for_each(|v| *v = random.symmetric());
}

fn alternating(step: u64, _: &mut Random, frame: &mut [f32]) {
    frame.fill(if step.is_multiple_of(2) { 1.0 } else { -1.0 });
}

const ORDINARY_GATES: Gates = Gates {
    name: "ordinary",
    bias: [0.0; 4],
    weights: [0.6, 0.3],
    peepholes: 0.3,
    frames: noise,
    within: WITHIN,
};

pub(crate) const GATES: &[Gates] = &[
    ORDINARY_GATES,
    Gates { name: "forget gate at 1", bias: [0.0, 40.0, 0.0, 0.0], within: 1e-1, ..ORDINARY_GATES },
    // The cell forgets nothing and takes everything: it is a sum over all frames.
    Gates {
        name: "all gates at 1",
        bias: [40.0, 40.0, 0.0, 40.0],
        weights: [0.6, 0.0],
        peepholes: 0.0,
        within: 1e-1,
        ..ORDINARY_GATES
    },
    Gates { name: "all gates at 0", bias: [-200.0, -200.0, 0.0, -200.0], ..ORDINARY_GATES },
    Gates { name: "gates in the denormal range", bias: [-95.0, 0.0, 0.0, 0.0], ..ORDINARY_GATES },
    Gates { name: "gates that alternate", weights: [1e4, 0.3], frames: alternating, ..ORDINARY_GATES },
    // Gates are steps there: if the sum of a gate is nearer to 0 than its rounding, f32 and f64 are
    // on different sides of the step.
    Gates {
        name: "frames of 1e30",
        within: 1.0,
        frames: |step, random, frame| {
            noise(step, random, frame);
            frame.iter_mut().for_each(|v| *v *= 1e30);
        },
        ..ORDINARY_GATES
    },
];

/// `gates` in `cell`.
pub(crate) fn recurrent(cell: &Cell, gates: &Gates, size: Size) -> Prepared {
    Prepared {
        run: Box::new(of_gates(cell, gates, size)),
        expect: Expect::Finite,
        within: gates.within,
        ordinary: Box::new(of_gates(cell, &ORDINARY_GATES, size)),
    }
}

fn of_gates(cell: &Cell, gates: &Gates, size: Size) -> FrameRun {
    let mut random = Random::new(7);
    let (width, height, inputs) = (4, 3, 4);
    let hidden = if cell.convolutional { 2 } else { 8 };
    let bias = gates.bias.iter().flat_map(|&bias| vec![bias; hidden]).collect();
    let [on_frame, on_state] = gates.weights;
    let (input, mut layers, outputs) = if cell.convolutional {
        // For each output, one channel of the frame and then the channels of the state.
        let weight = (0..4 * hidden).flat_map(|_| {
            let mut weights = random.values(9, on_frame);
            weights.extend(random.values(9 * hidden, on_state / 2.0));
            weights
        });
        let weight = weight.collect();
        let pixels = hidden * height * width;
        let peepholes = cell.peepholes.then(|| random.values(3 * pixels, gates.peepholes));
        let kind = FrameLayerKind::ConvLstm { hidden, weight, bias, peepholes, activation: Activation::Tanh };
        let layers = vec![layer("cell", 0, kind), layer("flat", 1, FrameLayerKind::Flatten)];
        (FrameShape::Image { channels: 1, height, width }, layers, pixels)
    } else {
        let weight_ih = random.values(4 * hidden * inputs, on_frame);
        let weight_hh = random.values(4 * hidden * hidden, on_state);
        let kind = FrameLayerKind::Lstm { hidden, weight_ih, weight_hh, bias };
        (FrameShape::Vector(inputs), vec![layer("cell", 0, kind)], hidden)
    };
    let (weight, bias) = (random.values(2 * outputs, 0.5), Some(random.values(2, 0.5)));
    let dense = FrameLayerKind::Dense { outputs: 2, weight, bias, activation: Activation::Identity };
    layers.push(layer("fc", layers.len(), dense));
    let parts = FrameNetworkParts { name: cell.name.to_owned(), input, layers, training: None };
    FrameRun { parts, convolution: Convolution::Direct, frames: gates.frames, steps: size.frames }
}

const CHANNELS: usize = 8;
const HEIGHT: usize = 14;
const WIDTH: usize = 18;
/// Frames of a case: each differs from the one before in some pixels, so that others are skipped.
const FRAMES: u64 = 12;

/// The algorithms.
pub(crate) const CONVOLUTIONS: [Convolution; 3] = [
    Convolution::Direct,
    Convolution::Winograd(WinogradTile::Two),
    Convolution::Winograd(WinogradTile::Four),
];

/// Images on which the transforms of Winograd's tiles lose the most precision, and weights of two
/// layers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Images {
    pub(crate) name: &'static str,
    frames: Frames,
    /// Largest weight of the first layer.
    weight: f32,
    /// Whether the weights of each of its kernels sum to 0, so that an even image becomes 0.
    edges: bool,
    /// Whether tiles of four overflow.
    overflows: bool,
    /// Largest relative error of each algorithm.
    within: [f64; 3],
}

/// Sets new values for a few pixels; for the whole image in the first frame.
fn some(step: u64, random: &mut Random, frame: &mut [f32], value: impl Fn(usize, &mut Random) -> f32) {
    if step == 0 {
        for (i, pixel) in frame.iter_mut().enumerate() {
            *pixel = value(i, random);
        }
    }
    for _ in 0..5 {
        let i = random.below(frame.len() as u64) as usize;
        frame[i] = value(i, random);
    }
}

/// 1 and -1 in turn, over rows and columns.
fn checkerboard(i: usize) -> f32 {
    if (i / WIDTH + i % WIDTH).is_multiple_of(2) { 1.0 } else { -1.0 }
}

const ORDINARY_IMAGES: Images = Images {
    name: "ordinary",
    frames: |step, random, frame| some(step, random, frame, |_, random| random.symmetric()),
    weight: 0.3,
    edges: false,
    overflows: false,
    within: [1e-5, 1e-5, 1e-4],
};

pub(crate) const IMAGES: &[Images] = &[
    ORDINARY_IMAGES,
    Images {
        name: "checkerboard of 1e4 over 1e-3",
        frames: |step, random, frame| {
            some(step, random, frame, |i, random| 1e4 * checkerboard(i) + 1e-3 * random.symmetric());
        },
        ..ORDINARY_IMAGES
    },
    Images {
        name: "even image of 1e4 under edge filters",
        frames: |step, random, frame| some(step, random, frame, |_, random| 1e4 + 1e-1 * random.symmetric()),
        edges: true,
        ..ORDINARY_IMAGES
    },
    Images {
        name: "1e-3 and 1e3 mixed",
        frames: |step, random, frame| {
            some(step, random, frame, |_, random| {
                random.symmetric() * if random.below(2) == 0 { 1e3 } else { 1e-3 }
            });
        },
        ..ORDINARY_IMAGES
    },
    Images {
        name: "one pixel of 1e30 among ones",
        frames: |step, random, frame| {
            some(step, random, frame, |i, random| if i == 700 { 1e30 } else { random.symmetric() });
        },
        ..ORDINARY_IMAGES
    },
    Images {
        name: "denormal pixels",
        frames: |step, random, frame| some(step, random, frame, |_, random| 1e-40 * random.symmetric()),
        within: [1e-3, 1e-3, 2e-2],
        ..ORDINARY_IMAGES
    },
    Images {
        name: "pixels of 3e37",
        frames: |step, random, frame| some(step, random, frame, |i, _| 3e37 * checkerboard(i)),
        weight: 0.02,
        overflows: true,
        ..ORDINARY_IMAGES
    },
];

/// `images`, convolved by the algorithm at `index` of [`CONVOLUTIONS`].
pub(crate) fn winograd(images: &Images, index: usize) -> Prepared {
    let overflows = images.overflows && index == 2;
    Prepared {
        run: Box::new(of_images(images, CONVOLUTIONS[index])),
        expect: if overflows { Expect::Overflow } else { Expect::Finite },
        within: images.within[index],
        ordinary: Box::new(of_images(&ORDINARY_IMAGES, CONVOLUTIONS[index])),
    }
}

fn of_images(images: &Images, convolution: Convolution) -> FrameRun {
    let mut random = Random::new(3);
    let mut conv = |inputs: usize, channels: usize, scale: f32, edges: bool| {
        let mut weight = random.values(channels * inputs * 9, scale);
        if edges {
            for kernel in weight.chunks_exact_mut(9) {
                // Minus the sum of the others, rounded to 2^-10, so that the sum of all is exactly
                // 0.
                kernel.iter_mut().for_each(|w| *w = (*w * 1024.0).round() / 1024.0);
                kernel[4] -= kernel.iter().sum::<f32>();
            }
        }
        FrameLayerKind::Conv { kernel: 3, channels, weight, bias: None, relu: false }
    };
    let layers = vec![
        layer("conv1", 0, conv(CHANNELS, CHANNELS, images.weight, images.edges)),
        layer("conv2", 1, conv(CHANNELS, 2, 0.2, false)),
    ];
    let input = FrameShape::Image { channels: CHANNELS, height: HEIGHT, width: WIDTH };
    let parts = FrameNetworkParts { name: "two convolutions".to_owned(), input, layers, training: None };
    FrameRun { parts, convolution, frames: images.frames, steps: FRAMES }
}
