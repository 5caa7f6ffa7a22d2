//! The description of a frame network: its layers, and its fingerprint, a hash of names and of
//! everything that predictions depend on.

use meissner_kernels::{Activation, WinogradTile};

use self::FrameLayerKind as Kind;
pub use super::shape::FrameShape;
use super::unlikeness::TrainingFrames;
use crate::fingerprint::{Fingerprint, activation_code};

/// Parts of a network.
#[derive(Clone, Debug)]
pub struct FrameNetworkParts {
    /// Its name.
    pub name: String,
    /// Shape of a frame.
    pub input: FrameShape,
    /// Layers in topological order; the output of the last one is the prediction.
    pub layers: Vec<FrameLayer>,
    /// Statistics of the frames of its training, if known. Predictions then tell how unlike their
    /// frames are; their values do not change.
    pub training: Option<TrainingFrames>,
}

/// A layer.
#[derive(Clone, Debug)]
pub struct FrameLayer {
    /// Its name, for messages.
    pub name: String,
    /// Index of its input: 0 is the frame, i + 1 is layer i, which must come before this one.
    pub from: usize,
    /// Its computation.
    pub kind: FrameLayerKind,
}

/// Computation of a layer; tensors in `PyTorch`'s layouts, with batch norm folded in.
#[derive(Clone, Debug)]
pub enum FrameLayerKind {
    /// Convolution with stride 1 that keeps the size of the image.
    Conv {
        /// Pixels on each axis: 1, or 3 with a padding of 1.
        kernel: usize,
        /// O, channels written.
        channels: usize,
        /// (O, I, kernel, kernel).
        weight: Vec<f32>,
        /// (O).
        bias: Option<Vec<f32>>,
        /// Whether max(x, 0) follows.
        relu: bool,
    },
    /// Transposed convolution, 2 x 2 with stride 2: it doubles height and width.
    UpConv {
        /// O, channels written.
        channels: usize,
        /// (I, O, 2, 2).
        weight: Vec<f32>,
        /// (O).
        bias: Option<Vec<f32>>,
    },
    /// Maximum over 2 x 2 pixels with stride 2; an odd last row or column is dropped.
    MaxPool,
    /// Mean of `size` x `size` pixels with that stride; pixels that do not fill a window are
    /// dropped.
    AveragePool {
        /// Pixels on each axis.
        size: usize,
    },
    /// Mean of each channel; the output is a vector.
    GlobalAverage,
    /// Sum of each channel; the output is a vector.
    Sum,
    /// The channels of `from`, then those of `with`; for vectors, the values.
    Concat {
        /// As [`FrameLayer::from`].
        with: usize,
    },
    /// Scales channels by sigmoid(up relu(down mean)) (Hu et al. 2018, Eq. 2 to 4).
    SqueezeExcite {
        /// Number of values between `down` and `up`.
        reduced: usize,
        /// (reduced, C).
        down: Vec<f32>,
        /// (C, reduced).
        up: Vec<f32>,
    },
    /// Convolutional LSTM, 3 x 3 with a padding of 1; gates in the order i, f, g, o.
    ConvLstm {
        /// H, channels of the hidden state.
        hidden: usize,
        /// (4 H, I + H, 3, 3).
        weight: Vec<f32>,
        /// (4 H).
        bias: Vec<f32>,
        /// (3, H, height, width) for i, f, o, each multiplied by the cell state before the step.
        peepholes: Option<Vec<f32>>,
        /// Activation of the candidate and of the output of the cell.
        activation: Activation,
    },
    /// LSTM; gates in the order i, f, g, o.
    Lstm {
        /// H, values of the hidden state.
        hidden: usize,
        /// (4 H, I).
        weight_ih: Vec<f32>,
        /// (4 H, H).
        weight_hh: Vec<f32>,
        /// (4 H), the sum of both biases.
        bias: Vec<f32>,
    },
    /// The last `frames` vectors, each value from oldest to newest; zeros before the first frame.
    Delay {
        /// Number of vectors.
        frames: usize,
    },
    /// Turns an image into a vector: channel after channel, row after row.
    Flatten,
    /// Dense layer over a vector.
    Dense {
        /// O, values written.
        outputs: usize,
        /// (O, I).
        weight: Vec<f32>,
        /// (O).
        bias: Option<Vec<f32>>,
        /// Activation applied to the sum.
        activation: Activation,
    },
}

/// Algorithm of 3 x 3 convolutions of maps with channels last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Convolution {
    /// Direct sum of all products.
    #[default]
    Direct,
    /// Winograd's minimal filtering: fewer products with different rounding, so an approximation.
    Winograd(WinogradTile),
    /// Keeps nine products of each input pixel, and adds them: as exact as [`Self::Direct`], in
    /// another order. Less work if few pixels change, but more memory. Layers with more channels
    /// than [`meissner_kernels::Kn2rowConv3x3::MAX_OUTPUTS`] are computed directly.
    Kn2row,
}

pub(super) fn fingerprint_of(
    name: &str,
    input: FrameShape,
    layers: &[FrameLayer],
    convolution: Convolution,
) -> u64 {
    let mut to = Fingerprint::new();
    to.text(name);
    to.sizes(match input {
        FrameShape::Vector(values) => [0, values, 0, 0],
        FrameShape::Image { channels, height, width } => [1, channels, height, width],
    });
    to.word(match convolution {
        Convolution::Direct => 0,
        Convolution::Kn2row => 1,
        Convolution::Winograd(WinogradTile::Two) => 2,
        Convolution::Winograd(WinogradTile::Four) => 4,
    });
    to.size(layers.len());
    for FrameLayer { name, from, kind } in layers {
        to.text(name);
        to.size(*from);
        let (code, sizes, tensors) = contents(kind);
        to.word(code);
        to.sizes(sizes);
        for tensor in tensors {
            to.word(tensor.is_some().into());
            tensor.iter().for_each(|values| to.values(values));
        }
    }
    to.finish()
}

/// Code, sizes and tensors of a layer.
fn contents(kind: &Kind) -> (u64, Vec<usize>, Vec<Option<&Vec<f32>>>) {
    match kind {
        Kind::Conv { kernel, channels, weight, bias, relu } => {
            (1, vec![*kernel, *channels, usize::from(*relu)], vec![Some(weight), bias.as_ref()])
        }
        Kind::UpConv { channels, weight, bias } => (2, vec![*channels], vec![Some(weight), bias.as_ref()]),
        Kind::MaxPool => (3, vec![], vec![]),
        Kind::AveragePool { size } => (4, vec![*size], vec![]),
        Kind::GlobalAverage => (5, vec![], vec![]),
        Kind::Sum => (6, vec![], vec![]),
        Kind::Concat { with } => (7, vec![*with], vec![]),
        Kind::SqueezeExcite { reduced, down, up } => (8, vec![*reduced], vec![Some(down), Some(up)]),
        Kind::ConvLstm { hidden, weight, bias, peepholes, activation } => {
            let tensors = vec![Some(weight), Some(bias), peepholes.as_ref()];
            (9, vec![*hidden, activation_code(*activation)], tensors)
        }
        Kind::Lstm { hidden, weight_ih, weight_hh, bias } => {
            (10, vec![*hidden], vec![Some(weight_ih), Some(weight_hh), Some(bias)])
        }
        Kind::Delay { frames } => (11, vec![*frames], vec![]),
        Kind::Flatten => (12, vec![], vec![]),
        Kind::Dense { outputs, weight, bias, activation } => {
            (13, vec![*outputs, activation_code(*activation)], vec![Some(weight), bias.as_ref()])
        }
    }
}
