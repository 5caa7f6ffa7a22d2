//! A frame network: layers over images and vectors, with their parameters, checked against each other.

use meissner_kernels::{Activation, WinogradTile};

/// Shape of what a layer reads or writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameShape {
    /// So many values.
    Vector(usize),
    /// Channels, then rows, then columns.
    Image {
        /// Channels.
        channels: usize,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
}

impl FrameShape {
    /// Number of values; [`usize::MAX`] for more, which no network has.
    pub fn values(self) -> usize {
        match self {
            Self::Vector(values) => values,
            Self::Image { channels, height, width } => channels.saturating_mul(height).saturating_mul(width),
        }
    }

    /// Number of channels of an image; 0 for a vector.
    pub(super) fn channels(self) -> usize {
        match self {
            Self::Vector(_) => 0,
            Self::Image { channels, .. } => channels,
        }
    }
}

impl std::fmt::Display for FrameShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Vector(values) => write!(f, "{values} values"),
            Self::Image { channels, height, width } => write!(f, "{channels} x {height} x {width}"),
        }
    }
}

/// What a network is made of.
#[derive(Clone, Debug)]
pub struct FrameNetworkParts {
    /// Its name.
    pub name: String,
    /// Shape of a frame.
    pub input: FrameShape,
    /// Layers in an order in which each reads what is there; the last one's values are the prediction.
    pub layers: Vec<FrameLayer>,
}

/// A layer.
#[derive(Clone, Debug)]
pub struct FrameLayer {
    /// Its name, for messages.
    pub name: String,
    /// What it reads: 0 is the frame, i + 1 is layer i, all of them before this one.
    pub from: usize,
    /// What it computes.
    pub kind: FrameLayerKind,
}

/// What a layer computes; tensors in `PyTorch`'s layouts. Batch norm is part of weight and bias.
#[derive(Clone, Debug)]
pub enum FrameLayerKind {
    /// Convolution with stride 1 that keeps the size of the image.
    Conv {
        /// 1 or 3 pixels on each axis; 3 with a padding of 1.
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
    /// Transposed convolution, 2 x 2 with stride 2: the image doubles.
    UpConv {
        /// O, channels written.
        channels: usize,
        /// (I, O, 2, 2).
        weight: Vec<f32>,
        /// (O).
        bias: Option<Vec<f32>>,
    },
    /// Maximum over 2 x 2 pixels with stride 2; an odd last row or column is left out.
    MaxPool,
    /// Mean over `size` x `size` pixels with that stride; what does not fill a cell is left out.
    AveragePool {
        /// Pixels on each axis.
        size: usize,
    },
    /// Mean of each channel: a vector.
    GlobalAverage,
    /// Sum of each channel: a vector.
    Sum,
    /// The channels of `from`, then those of `with`; of two vectors their values.
    Concat {
        /// As [`FrameLayer::from`].
        with: usize,
    },
    /// Scales each channel by sigmoid(up relu(down mean)) (squeeze-and-excitation, Hu et al. 2018, Eq. 2 to 4).
    SqueezeExcite {
        /// Values between `down` and `up`.
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
        /// (3, H, height, width) on i, f, o, each times the cell before the step.
        peepholes: Option<Vec<f32>>,
        /// Of the candidate and of the cell on its way out.
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
    /// The last `frames` vectors, value after value, each from the oldest to the newest; zeros before the first.
    Delay {
        /// How many.
        frames: usize,
    },
    /// An image as a vector: channel after channel, row after row.
    Flatten,
    /// Dense layer over a vector.
    Dense {
        /// O.
        outputs: usize,
        /// (O, I).
        weight: Vec<f32>,
        /// (O).
        bias: Option<Vec<f32>>,
        /// What follows the sum.
        activation: Activation,
    },
}

/// How 3 x 3 convolutions of maps with channels last are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Convolution {
    /// Product by product.
    #[default]
    Direct,
    /// By Winograd's minimal filtering: fewer products, another rounding: an approximation.
    Winograd(WinogradTile),
}
