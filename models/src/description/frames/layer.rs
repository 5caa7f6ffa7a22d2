//! A checked layer of a frame network: what it computes, its shapes, what it costs.

use meissner_engine::frames::FrameShape;
use meissner_kernels::Activation;
use serde::{Serialize, Serializer};

use super::super::layer::{activation_word, serialize_activation};

/// A layer of a checked description of a frame network.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FrameLayer {
    /// Name, unique in the description.
    pub name: String,
    /// Line of the file, counted from 1.
    pub line: usize,
    /// What it computes.
    #[serde(flatten)]
    pub kind: FrameKind,
    /// What it reads: a layer's name or "frame"; for the first layers of a head the readout's name.
    pub from: String,
    /// Shape of what it reads.
    #[serde(serialize_with = "serialize_shape")]
    pub input: FrameShape,
    /// Shape of what it writes.
    #[serde(serialize_with = "serialize_shape")]
    pub output: FrameShape,
    /// Values that it keeps from frame to frame.
    pub state: usize,
    /// Trained parameters: weights, biases, batch norm's two, without the running statistics.
    pub parameters: usize,
    /// Products of weights with values, each with the sum that it enters, for one frame; in a head, for one prediction.
    pub multiply_adds: usize,
    /// Prefix of its tensors' names.
    #[serde(skip)]
    pub(crate) weights: String,
    /// What it reads: 0 is the frame, i + 1 is layer i.
    #[serde(skip)]
    pub(crate) reads: usize,
    /// The other image or vector that it joins to what it reads.
    #[serde(skip)]
    pub(crate) joins: Option<usize>,
    /// About the mean square of the values that it reads, where weights are drawn.
    #[serde(skip)]
    pub(crate) square: f64,
}

/// What a layer of a frame network computes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum FrameKind {
    /// Convolution that keeps the size of the image.
    Conv {
        /// Channels written.
        channels: usize,
        /// 1 or 3 pixels on each axis.
        kernel: usize,
        /// Whether there is a bias.
        bias: bool,
        /// Prefix of the tensors of batch norm, where there is any.
        norm: Option<String>,
        /// What follows: nothing or max(x, 0).
        #[serde(serialize_with = "serialize_activation")]
        activation: Activation,
    },
    /// Transposed convolution, 2 x 2 with stride 2.
    #[serde(rename = "upconv")]
    UpConv {
        /// Channels written.
        channels: usize,
        /// Whether there is a bias.
        bias: bool,
    },
    /// Maximum over 2 x 2 pixels; an odd last row or column is left out.
    MaxPool,
    /// Mean over squares of pixels; what does not fill a square is left out.
    AveragePool {
        /// Pixels on each axis.
        size: usize,
    },
    /// Mean of each channel.
    GlobalAverage,
    /// Sum of each channel.
    Sum,
    /// The channels of what it reads, then those of another image; or the values of two vectors.
    Concat {
        /// The other one: a layer's name or "frame".
        with: String,
    },
    /// Squeeze-and-excitation.
    SqueezeExcite {
        /// Channels per value between its two products.
        reduction: usize,
    },
    /// Convolutional LSTM with a 3 x 3 kernel.
    ConvLstm {
        /// Channels of the hidden state.
        hidden: usize,
        /// Whether the gates look at the cell.
        peepholes: bool,
        /// Of the candidate, and of the cell on its way out: tanh or sigmoid.
        #[serde(serialize_with = "serialize_activation")]
        activation: Activation,
    },
    /// LSTM.
    Lstm {
        /// Values of the hidden state.
        hidden: usize,
        /// Number in the names of its tensors.
        layer: usize,
    },
    /// The last vectors, value after value, each from the oldest to the newest.
    Delay {
        /// How many.
        frames: usize,
    },
    /// An image as a vector.
    Flatten,
    /// Dense layer.
    Dense {
        /// Values written.
        outputs: usize,
        /// Whether there is a bias.
        bias: bool,
        /// Prefix of the tensors of batch norm, where there is any.
        norm: Option<String>,
        /// What follows the sum.
        #[serde(serialize_with = "serialize_activation")]
        activation: Activation,
    },
}

impl FrameLayer {
    /// The other image or vector that it joins to what it reads: a layer's name or "frame".
    pub fn with(&self) -> Option<&str> {
        match &self.kind {
            FrameKind::Concat { with } => Some(with),
            _ => None,
        }
    }
}

impl FrameKind {
    /// The word a file has for it.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Conv { .. } => "conv",
            Self::UpConv { .. } => "upconv",
            Self::MaxPool => "max_pool",
            Self::AveragePool { .. } => "average_pool",
            Self::GlobalAverage => "global_average",
            Self::Sum => "sum",
            Self::Concat { .. } => "concat",
            Self::SqueezeExcite { .. } => "squeeze_excite",
            Self::ConvLstm { .. } => "conv_lstm",
            Self::Lstm { .. } => "lstm",
            Self::Delay { .. } => "delay",
            Self::Flatten => "flatten",
            Self::Dense { .. } => "dense",
        }
    }
}

impl std::fmt::Display for FrameKind {
    /// Its word with its options, short.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.word())?;
        let (norm, activation) = match self {
            Self::Conv { kernel, norm, activation, .. } => {
                write!(f, " {kernel}x{kernel}")?;
                (norm, *activation)
            }
            Self::Dense { norm, activation, .. } => (norm, *activation),
            Self::AveragePool { size } => return write!(f, " {size}x{size}"),
            Self::SqueezeExcite { reduction } => return write!(f, " 1/{reduction}"),
            Self::ConvLstm { peepholes, activation, .. } => {
                write!(f, " {}", activation_word(*activation))?;
                return f.write_str(if *peepholes { " peepholes" } else { "" });
            }
            Self::Delay { frames } => return write!(f, " {frames} frames"),
            _ => return Ok(()),
        };
        f.write_str(if norm.is_some() { " norm" } else { "" })?;
        match activation {
            Activation::Identity => Ok(()),
            activation => write!(f, " {}", activation_word(activation)),
        }
    }
}

/// A vector as [values], an image as [channels, height, width].
pub(crate) fn serialize_shape<S: Serializer>(shape: &FrameShape, s: S) -> Result<S::Ok, S::Error> {
    match *shape {
        FrameShape::Vector(values) => [values].serialize(s),
        FrameShape::Image { channels, height, width } => [channels, height, width].serialize(s),
    }
}
