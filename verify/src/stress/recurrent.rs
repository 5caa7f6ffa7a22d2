//! Gates that are saturated, open or closed, over very many frames.

use meissner_engine::frames::{Convolution, FrameLayerKind, FrameNetworkParts, FrameShape};
use meissner_kernels::Activation;
use meissner_kernels::random::Random;

use super::Prepared;
use super::frames::{FrameRun, Frames, layer};
use super::result::{Expect, Size, WITHIN};

/// Columns and rows of an image.
const SIDES: [usize; 2] = [4, 3];
/// Values of a vector.
const INPUTS: usize = 4;

/// A kind of recurrent layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub(super) name: &'static str,
    /// Whether it is a convolutional LSTM over planes; otherwise an LSTM over vectors.
    convolutional: bool,
    /// Whether its gates see the cells.
    peepholes: bool,
}

/// All kinds.
pub(super) const CELLS: [Cell; 3] = [
    Cell { name: "lstm", convolutional: false, peepholes: false },
    Cell { name: "convlstm", convolutional: true, peepholes: false },
    Cell { name: "convlstm with peepholes", convolutional: true, peepholes: true },
];

/// Weights and frames.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gates {
    pub(super) name: &'static str,
    /// Of i, f, g and o.
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

const ORDINARY: Gates = Gates {
    name: "ordinary",
    bias: [0.0; 4],
    weights: [0.6, 0.3],
    peepholes: 0.3,
    frames: noise,
    within: WITHIN,
};

/// All of them.
pub(super) const GATES: &[Gates] = &[
    ORDINARY,
    Gates { name: "forget gate at 1", bias: [0.0, 40.0, 0.0, 0.0], within: 1e-1, ..ORDINARY },
    // Nothing leaves, everything enters: the cell is a sum over all frames, which f32 rounds at each.
    Gates {
        name: "all gates at 1",
        bias: [40.0, 40.0, 0.0, 40.0],
        weights: [0.6, 0.0],
        peepholes: 0.0,
        within: 1e-1,
        ..ORDINARY
    },
    Gates { name: "all gates at 0", bias: [-200.0, -200.0, 0.0, -200.0], ..ORDINARY },
    Gates { name: "gates in the denormal range", bias: [-95.0, 0.0, 0.0, 0.0], ..ORDINARY },
    Gates { name: "gates that alternate", weights: [1e4, 0.3], frames: alternating, ..ORDINARY },
    // Gates are steps there. If the sum of a gate is nearer to 0 than its rounding, about once in ten million times,
    // f32 and f64 stand on different sides of the step, and the error is all that the gate lets through.
    Gates {
        name: "frames of 1e30",
        within: 1.0,
        frames: |step, random, frame| {
            noise(step, random, frame);
            frame.iter_mut().for_each(|v| *v *= 1e30);
        },
        ..ORDINARY
    },
];

/// `gates` in `cell`.
pub(super) fn prepare(cell: &Cell, gates: &Gates, size: Size) -> Prepared {
    Prepared {
        run: Box::new(run(cell, gates, size)),
        expect: Expect::Finite,
        within: gates.within,
        ordinary: Box::new(run(cell, &ORDINARY, size)),
    }
}

fn run(cell: &Cell, gates: &Gates, size: Size) -> FrameRun {
    let mut random = Random::new(7);
    let [width, height] = SIDES;
    let hidden = if cell.convolutional { 2 } else { 8 };
    let bias = gates.bias.iter().flat_map(|&bias| vec![bias; hidden]).collect();
    let [on_frame, on_state] = gates.weights;
    let (input, mut layers, outputs) = if cell.convolutional {
        // For each output, one channel of the frame and then those of the state.
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
        let weight_ih = random.values(4 * hidden * INPUTS, on_frame);
        let weight_hh = random.values(4 * hidden * hidden, on_state);
        let kind = FrameLayerKind::Lstm { hidden, weight_ih, weight_hh, bias };
        (FrameShape::Vector(INPUTS), vec![layer("cell", 0, kind)], hidden)
    };
    let (weight, bias) = (random.values(2 * outputs, 0.5), Some(random.values(2, 0.5)));
    let dense = FrameLayerKind::Dense { outputs: 2, weight, bias, activation: Activation::Identity };
    layers.push(layer("fc", layers.len(), dense));
    let parts = FrameNetworkParts { name: cell.name.to_owned(), input, layers };
    FrameRun { parts, convolution: Convolution::Direct, frames: gates.frames, steps: size.frames }
}
