//! A checked layer of a frame network: its computation, shapes, tensors and cost.

use std::ops::RangeInclusive;

use meissner_engine::frames::FrameShape;
use meissner_kernels::Activation;
use serde::{Serialize, Serializer};

use crate::description::layer::{activation_word, serialize_activation};
use crate::description::tensors::{Listing, Needed};

/// The name by which layers refer to the input of a network.
pub(crate) const FRAME: &str = "frame";
pub(super) const MAX_SIDE: usize = 4096;
pub(super) const MAX_CHANNELS: usize = 4096;
pub(super) const SIDES: RangeInclusive<i64> = 1..=MAX_SIDE as i64;
pub(super) const CHANNELS: RangeInclusive<i64> = 1..=MAX_CHANNELS as i64;

/// A layer of a checked description of a frame network.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FrameLayer {
    /// Name, unique in the description.
    pub name: String,
    /// Line of the file, counted from 1.
    pub line: usize,
    /// Its computation.
    #[serde(flatten)]
    pub kind: FrameKind,
    /// Its input: the name of a layer or "frame"; in a head the name of a layer or of the readout.
    pub from: String,
    /// Shape of its input.
    #[serde(serialize_with = "serialize_shape")]
    pub input: FrameShape,
    /// Shape of its output.
    #[serde(serialize_with = "serialize_shape")]
    pub output: FrameShape,
    /// Number of values that it keeps from frame to frame.
    pub state: usize,
    /// Number of trained parameters: weights, biases, the two of batch norm, without the running
    /// statistics.
    pub parameters: usize,
    /// Multiply-adds for one frame; in a head, for one prediction.
    pub multiply_adds: usize,
    /// Prefix of its tensors' names.
    #[serde(skip)]
    pub(crate) weights: String,
    /// Its input: 0 is the frame, i + 1 is layer i.
    #[serde(skip)]
    pub(crate) reads: usize,
    /// Its second input, an image or a vector.
    #[serde(skip)]
    pub(crate) joins: Option<usize>,
    /// Approximate mean square of the values that it reads, for drawn weights.
    #[serde(skip)]
    pub(crate) square: f64,
}

/// The computation of a layer of a frame network.
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
        /// Prefix of the tensors of batch norm, if there is any.
        norm: Option<String>,
        /// Activation: identity or max(x, 0).
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
    /// Mean over squares of pixels; pixels that do not fill a square are left out.
    AveragePool {
        /// Pixels on each axis.
        size: usize,
    },
    /// Mean of each channel.
    GlobalAverage,
    /// Sum of each channel.
    Sum,
    /// The channels of two images, or the values of two vectors, one after the other.
    Concat {
        /// The second input: the name of a layer or "frame".
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
        /// Whether the gates read the cell.
        peepholes: bool,
        /// Activation of the candidate and of the cell's output: tanh or sigmoid.
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
        /// Number of vectors.
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
        /// Prefix of the tensors of batch norm, if there is any.
        norm: Option<String>,
        /// Activation after the sum.
        #[serde(serialize_with = "serialize_activation")]
        activation: Activation,
    },
}

impl FrameKind {
    /// Its word in a file.
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
    /// Its word with its options, in short form.
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

/// Channels of an image, or values of a vector; and rows and columns.
fn extents(shape: FrameShape) -> (usize, [usize; 2]) {
    match shape {
        FrameShape::Vector(values) => (values, [1, 1]),
        FrameShape::Image { channels, height, width } => (channels, [height, width]),
    }
}

impl FrameLayer {
    /// Its second input, an image or a vector: the name of a layer or "frame".
    pub fn with(&self) -> Option<&str> {
        match &self.kind {
            FrameKind::Concat { with } => Some(with),
            _ => None,
        }
    }

    pub(crate) fn tensor(&self, part: &str) -> String {
        format!("{}.{part}", self.weights)
    }

    /// The tensors it needs, in the order of their use.
    pub(crate) fn tensors(&self) -> Vec<Needed> {
        let (i, [rows, columns]) = extents(self.input);
        let mut tensors = Listing::new(&self.weights);
        match self.kind {
            FrameKind::Conv { channels: o, kernel: k, .. } => {
                tensors.weight("weight", &[o, i, k, k], k * k * i, CONV);
            }
            FrameKind::UpConv { channels: o, .. } => tensors.weight("weight", &[i, o, 2, 2], i, UPCONV),
            FrameKind::SqueezeExcite { reduction } => {
                let reduced = i / reduction;
                tensors.weight("down.weight", &[reduced, i], i, "from means: (value, channel)");
                tensors.weight("up.weight", &[i, reduced], reduced, "to factors: (channel, value)");
            }
            FrameKind::ConvLstm { hidden: h, peepholes, .. } => {
                tensors.weight("gates.weight", &[4 * h, i + h, 3, 3], 9 * (i + h), GATES);
                tensors.shift("gates.bias", &[4 * h], GATE_BIAS);
                if peepholes {
                    tensors.shift("peephole", &[3, h, rows, columns], PEEPHOLE);
                }
            }
            FrameKind::Lstm { hidden: h, layer } => {
                tensors.weight(&format!("weight_ih_l{layer}"), &[4 * h, i], i, LSTM_INPUT);
                tensors.weight(&format!("weight_hh_l{layer}"), &[4 * h, h], h, LSTM_HIDDEN);
                tensors.shift(&format!("bias_ih_l{layer}"), &[4 * h], GATE_BIAS);
                tensors.shift(&format!("bias_hh_l{layer}"), &[4 * h], GATE_BIAS);
            }
            FrameKind::Dense { outputs: o, .. } => {
                tensors.weight("weight", &[o, i], i, "dense layer: (output, input)");
            }
            FrameKind::MaxPool
            | FrameKind::AveragePool { .. }
            | FrameKind::GlobalAverage
            | FrameKind::Sum
            | FrameKind::Concat { .. }
            | FrameKind::Delay { .. }
            | FrameKind::Flatten => {}
        }
        if let FrameKind::Conv { channels: o, bias: true, .. }
        | FrameKind::UpConv { channels: o, bias: true }
        | FrameKind::Dense { outputs: o, bias: true, .. } = self.kind
        {
            tensors.shift("bias", &[o], "bias: (output channel)");
        }
        if let FrameKind::Conv { channels: o, norm: Some(prefix), .. }
        | FrameKind::Dense { outputs: o, norm: Some(prefix), .. } = &self.kind
        {
            tensors.norm(prefix, *o, GAIN * self.square);
        }
        tensors.needed()
    }

    /// Its state, parameters and multiply-adds, from its kind and shapes.
    pub(super) fn counted(mut self) -> Self {
        let (i, [height, width]) = extents(self.input);
        let (o, pixels) = (self.output.values(), height * width);
        self.parameters = self.tensors().iter().map(Needed::parameters).sum();
        (self.state, self.multiply_adds) = match self.kind {
            FrameKind::Conv { kernel, .. } => (0, kernel * kernel * i * o),
            FrameKind::UpConv { .. } | FrameKind::Dense { .. } => (0, i * o),
            FrameKind::SqueezeExcite { reduction } => (0, 2 * i * (i / reduction)),
            FrameKind::ConvLstm { hidden, peepholes, .. } => {
                let looks = if peepholes { 3 } else { 0 };
                (2 * o, pixels * hidden * (4 * 9 * (i + hidden) + looks))
            }
            FrameKind::Lstm { hidden, .. } => (2 * hidden, 4 * hidden * (i + hidden)),
            FrameKind::Delay { .. } => (o, 0),
            FrameKind::MaxPool
            | FrameKind::AveragePool { .. }
            | FrameKind::GlobalAverage
            | FrameKind::Sum
            | FrameKind::Concat { .. }
            | FrameKind::Flatten => (0, 0),
        };
        self
    }

    /// Approximate mean square of its output, with drawn weights and values around 0 before each
    /// activation. Running variances are drawn around it, because trained ones lie near their
    /// input's variance.
    pub(super) fn mean_square(&self) -> f64 {
        match &self.kind {
            FrameKind::Conv { norm, activation, .. } | FrameKind::Dense { norm, activation, .. } => {
                let sum = if norm.is_some() { 1.0 } else { GAIN * self.square };
                if *activation == Activation::Relu { sum / 2.0 } else { sum }
            }
            FrameKind::UpConv { .. } => GAIN * self.square,
            // For neighbours that are similar.
            FrameKind::MaxPool => 1.5 * self.square,
            FrameKind::AveragePool { .. } | FrameKind::GlobalAverage => self.square / 2.0,
            // A sigmoid around 0 is about a half.
            FrameKind::SqueezeExcite { .. } => self.square / 4.0,
            // Half of the hyperbolic tangent of a small cell.
            FrameKind::ConvLstm { .. } | FrameKind::Lstm { .. } => 0.1,
            FrameKind::Sum | FrameKind::Concat { .. } | FrameKind::Delay { .. } | FrameKind::Flatten => {
                self.square
            }
        }
    }
}

const CONV: &str = "convolution: (output channel, input channel, row, column)";
const UPCONV: &str = "transposed convolution: (input channel, output channel, row, column)";
const GATES: &str =
    "convolution of the gates i, f, g, o: (gate and hidden channel, input then hidden channel, row, column)";
const GATE_BIAS: &str = "bias of the gates i, f, g, o: (gate and hidden channel)";
const PEEPHOLE: &str = "factors of the cell in the gates i, f, o: (gate, hidden channel, row, column)";
const LSTM_INPUT: &str = "from inputs to the gates i, f, g, o: (gate and hidden value, input)";
const LSTM_HIDDEN: &str = "from hidden values to the gates i, f, g, o: (gate and hidden value, hidden value)";

/// Variance of drawn weights times the values that enter a sum (He et al. 2015).
const GAIN: f64 = 2.0;
