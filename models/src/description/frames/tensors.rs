//! What a layer of a frame network needs of weights, and what it costs.

use meissner_engine::frames::FrameShape;
use meissner_kernels::Activation;

use super::super::tensors::{Needed, Reader, Role};
use super::layer::{FrameKind, FrameLayer};

/// Channels of an image, or values of a vector; and rows and columns.
fn extents(shape: FrameShape) -> (usize, [usize; 2]) {
    match shape {
        FrameShape::Vector(values) => (values, [1, 1]),
        FrameShape::Image { channels, height, width } => (channels, [height, width]),
    }
}

impl FrameLayer {
    /// Name of one of its tensors.
    pub(crate) fn tensor(&self, part: &str) -> String {
        format!("{}.{part}", self.weights)
    }

    /// The tensors it needs, in the order of their use.
    pub(crate) fn tensors(&self) -> Vec<Needed> {
        let (i, [rows, columns]) = extents(self.input);
        let needed = |part: &str, shape: &[usize], role, meaning| Needed {
            name: self.tensor(part),
            shape: shape.to_vec(),
            role,
            meaning,
        };
        let weight = |part: &str, shape: &[usize], inputs, meaning| {
            needed(part, shape, Role::Weight { inputs }, meaning)
        };
        let shift = |part: &str, shape: &[usize], meaning| needed(part, shape, Role::Shift, meaning);
        let biased = |bias: bool, o: usize| bias.then(|| shift("bias", &[o], "bias: (output channel)"));
        let norm = |norm: &Option<String>, o: usize| {
            norm.iter().flat_map(|prefix| Needed::norm(prefix, o, GAIN * self.square)).collect::<Vec<_>>()
        };
        let mut tensors = Vec::new();
        match self.kind {
            FrameKind::Conv { channels: o, kernel: k, bias, norm: ref prefix, .. } => {
                tensors.push(weight("weight", &[o, i, k, k], k * k * i, CONV));
                tensors.extend(biased(bias, o));
                tensors.extend(norm(prefix, o));
            }
            FrameKind::UpConv { channels: o, bias } => {
                tensors.push(weight("weight", &[i, o, 2, 2], i, UPCONV));
                tensors.extend(biased(bias, o));
            }
            FrameKind::SqueezeExcite { reduction } => {
                let reduced = i / reduction;
                tensors.push(weight("down.weight", &[reduced, i], i, "from means: (value, channel)"));
                tensors.push(weight("up.weight", &[i, reduced], reduced, "to factors: (channel, value)"));
            }
            FrameKind::ConvLstm { hidden: h, peepholes, .. } => {
                tensors.push(weight("gates.weight", &[4 * h, i + h, 3, 3], 9 * (i + h), GATES));
                tensors.push(shift("gates.bias", &[4 * h], GATE_BIAS));
                if peepholes {
                    tensors.push(shift("peephole", &[3, h, rows, columns], PEEPHOLE));
                }
            }
            FrameKind::Lstm { hidden: h, layer } => {
                tensors.push(weight(&format!("weight_ih_l{layer}"), &[4 * h, i], i, LSTM_INPUT));
                tensors.push(weight(&format!("weight_hh_l{layer}"), &[4 * h, h], h, LSTM_HIDDEN));
                tensors.push(shift(&format!("bias_ih_l{layer}"), &[4 * h], GATE_BIAS));
                tensors.push(shift(&format!("bias_hh_l{layer}"), &[4 * h], GATE_BIAS));
            }
            FrameKind::Dense { outputs: o, bias, norm: ref prefix, .. } => {
                tensors.push(weight("weight", &[o, i], i, "dense layer: (output, input)"));
                tensors.extend(biased(bias, o));
                tensors.extend(norm(prefix, o));
            }
            FrameKind::MaxPool
            | FrameKind::AveragePool { .. }
            | FrameKind::GlobalAverage
            | FrameKind::Sum
            | FrameKind::Concat { .. }
            | FrameKind::Delay { .. }
            | FrameKind::Flatten => {}
        }
        tensors
    }

    /// The tensors with who reads them.
    pub(in super::super) fn reader(&self) -> Reader<'_> {
        Reader { layer: &self.name, line: self.line, tensors: self.tensors() }
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

    /// About the mean square of the values that it writes, with drawn weights and values around 0 before each
    /// activation: running variances are drawn around it, as trained ones are around what they normalise.
    pub(super) fn mean_square(&self) -> f64 {
        match &self.kind {
            FrameKind::Conv { norm, activation, .. } | FrameKind::Dense { norm, activation, .. } => {
                let sum = if norm.is_some() { 1.0 } else { GAIN * self.square };
                if *activation == Activation::Relu { sum / 2.0 } else { sum }
            }
            FrameKind::UpConv { .. } => GAIN * self.square,
            // Of neighbours that are much alike.
            FrameKind::MaxPool => 1.5 * self.square,
            FrameKind::AveragePool { .. } | FrameKind::GlobalAverage => self.square / 2.0,
            // A sigmoid around 0 is about a half.
            FrameKind::SqueezeExcite { .. } => self.square / 4.0,
            // A half of the tangent of a small cell.
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
