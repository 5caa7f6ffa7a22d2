//! A frame network in f64: every layer is computed completely for every frame.
//!
//! Input: frames, (channels, height, width) for an image. Output: the values of every layer.

use meissner_engine::EngineError;
use meissner_engine::frames::{Convolution, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameShape};
use meissner_kernels::{Activation, Elementary};

/// A frame network and its state.
#[derive(Clone, Debug)]
pub struct FrameReference {
    parts: FrameNetworkParts,
    /// The frame, then the output of each layer.
    values: Vec<Image>,
    /// Memory of each layer; empty if it has none or before the first frame.
    memories: Vec<Vec<f64>>,
}

impl FrameReference {
    /// A network of `parts` before its first frame.
    ///
    /// # Errors
    /// As [`FrameNetwork::new`], which checks the parts.
    pub fn new(parts: FrameNetworkParts) -> Result<Self, EngineError> {
        FrameNetwork::new(parts.clone(), Convolution::Direct)?;
        let layers = parts.layers.len();
        Ok(Self { parts, values: Vec::new(), memories: vec![Vec::new(); layers] })
    }

    /// Takes a frame and computes every layer; returns the output of the last. O(multiply-adds).
    ///
    /// # Panics
    /// If the number of values is not the network's input size.
    pub fn push(&mut self, frame: &[f64]) -> &[f64] {
        assert_eq!(frame.len(), self.parts.input.values(), "the frame must have the network's size");
        let size = match self.parts.input {
            FrameShape::Image { channels, height, width } => [channels, height, width],
            FrameShape::Vector(values) => [values, 1, 1],
        };
        self.values.clear();
        self.values.push(Image::new(size, frame.to_vec()));
        for (layer, memory) in self.parts.layers.iter().zip(&mut self.memories) {
            let value = compute(&layer.kind, &self.values[layer.from], &self.values, memory);
            self.values.push(value);
        }
        self.prediction()
    }

    /// The output of the last layer; empty before the first frame.
    pub fn prediction(&self) -> &[f64] {
        self.values.last().map_or(&[], |value| &value.values)
    }

    /// Values of layer `layer` after the last frame.
    ///
    /// # Panics
    /// Before the first frame, and if there is no such layer.
    pub fn layer(&self, layer: usize) -> &[f64] {
        &self.values[layer + 1].values
    }

    /// Returns to the state before the first frame.
    pub fn reset(&mut self) {
        self.values.clear();
        self.memories.iter_mut().for_each(Vec::clear);
    }
}

/// Output of a layer for `input`.
fn compute(kind: &FrameLayerKind, input: &Image, values: &[Image], memory: &mut Vec<f64>) -> Image {
    use FrameLayerKind as Kind;
    match kind {
        Kind::Conv { kernel, channels, weight, bias, relu } => {
            conv(input, *kernel, *channels, weight, bias.as_deref(), *relu)
        }
        Kind::UpConv { channels, weight, bias } => up_conv(input, *channels, weight, bias.as_deref()),
        Kind::MaxPool => pooled(input, 2, |window| window.fold(f64::NEG_INFINITY, f64::max)),
        Kind::AveragePool { size } => {
            let pixels = (size * size) as f64;
            pooled(input, *size, |window| window.sum::<f64>() / pixels)
        }
        Kind::Sum => Image::vector(input.planes().map(|plane| plane.iter().sum()).collect()),
        Kind::GlobalAverage => Image::vector(means(input)),
        Kind::Concat { with } => input.beside(&values[*with]),
        Kind::SqueezeExcite { reduced, down, up } => {
            let squeezed = dense(&means(input), *reduced, down, None);
            let squeezed: Vec<f64> = squeezed.into_iter().map(|v| v.max(0.0)).collect();
            let scales = dense(&squeezed, input.size[0], up, None).into_iter().map(sigmoid);
            let planes = input.planes().zip(scales);
            Image::new(input.size, planes.flat_map(|(p, s)| p.iter().map(move |v| v * s)).collect())
        }
        Kind::ConvLstm { hidden, weight, bias, peepholes, activation } => {
            let peepholes = peepholes.as_deref();
            conv_lstm(input, *hidden, (weight, bias, peepholes), *activation, memory)
        }
        Kind::Lstm { hidden, weight_ih, weight_hh, bias } => {
            Image::vector(lstm(&input.values, *hidden, [weight_ih, weight_hh, bias], memory))
        }
        Kind::Delay { frames } => {
            memory.resize(frames * input.values.len(), 0.0);
            for (past, &value) in memory.chunks_exact_mut(*frames).zip(&input.values) {
                past.rotate_left(1);
                past[frames - 1] = value;
            }
            Image::vector(memory.clone())
        }
        Kind::Flatten => Image::vector(input.values.clone()),
        Kind::Dense { outputs, weight, bias, activation } => {
            let sums = dense(&input.values, *outputs, weight, bias.as_deref());
            Image::vector(sums.into_iter().map(|sum| activated(*activation, sum)).collect())
        }
    }
}

fn means(input: &Image) -> Vec<f64> {
    input.planes().map(|plane| plane.iter().sum::<f64>() / plane.len() as f64).collect()
}

/// W x + b with W (outputs, inputs).
fn dense(x: &[f64], outputs: usize, weight: &[f32], bias: Option<&[f32]>) -> Vec<f64> {
    let output = |o: usize| {
        let weights = &weight[o * x.len()..][..x.len()];
        let sum: f64 = x.iter().zip(weights).map(|(x, &w)| x * f64::from(w)).sum();
        sum + bias.map_or(0.0, |bias| f64::from(bias[o]))
    };
    (0..outputs).map(output).collect()
}

/// Values of an image; a vector has one value per channel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Image {
    /// Channels, rows, columns.
    pub(crate) size: [usize; 3],
    pub(crate) values: Vec<f64>,
}

impl Image {
    pub(crate) fn new(size: [usize; 3], values: Vec<f64>) -> Self {
        assert_eq!(values.len(), size.iter().product::<usize>(), "an image must have a value for each place");
        Self { size, values }
    }

    fn vector(values: Vec<f64>) -> Self {
        Self::new([values.len(), 1, 1], values)
    }

    /// The channels of this image, then those of `other`.
    fn beside(&self, other: &Self) -> Self {
        let [channels, height, width] = self.size;
        Self::new([channels + other.size[0], height, width], [&self.values[..], &other.values].concat())
    }

    /// The rows of each channel.
    fn planes(&self) -> impl Iterator<Item = &[f64]> {
        self.values.chunks_exact(self.size[1] * self.size[2])
    }

    /// Value at channel `c`, row `y`, column `x`; 0 beyond the image.
    fn at(&self, c: usize, y: isize, x: isize) -> f64 {
        let [_, height, width] = self.size;
        if (0..height as isize).contains(&y) && (0..width as isize).contains(&x) {
            self.values[(c * height + y as usize) * width + x as usize]
        } else {
            0.0
        }
    }

    /// An image of `size` whose values are `value(c, y, x)`.
    fn from_fn(size: [usize; 3], value: impl Fn(usize, usize, usize) -> f64) -> Self {
        let [channels, height, width] = size;
        let places =
            (0..channels * height * width).map(|i| (i / width / height, i / width % height, i % width));
        Self::new(size, places.map(|(c, y, x)| value(c, y, x)).collect())
    }
}

/// Convolution of `kernel` x `kernel` pixels; `weight` is (outputs, channels, kernel, kernel).
pub(crate) fn conv(
    input: &Image,
    kernel: usize,
    outputs: usize,
    weight: &[f32],
    bias: Option<&[f32]>,
    relu: bool,
) -> Image {
    let half = (kernel / 2) as isize;
    let [channels, height, width] = input.size;
    Image::from_fn([outputs, height, width], |o, y, x| {
        let mut sum = bias.map_or(0.0, |bias| f64::from(bias[o]));
        for i in 0..channels {
            for ky in 0..kernel {
                for kx in 0..kernel {
                    let w = weight[((o * channels + i) * kernel + ky) * kernel + kx];
                    sum += f64::from(w) * input.at(i, (y + ky) as isize - half, (x + kx) as isize - half);
                }
            }
        }
        if relu { sum.max(0.0) } else { sum }
    })
}

/// Transposed convolution of 2 x 2 pixels with stride 2; `weight` is (inputs, outputs, 2, 2).
pub(crate) fn up_conv(input: &Image, outputs: usize, weight: &[f32], bias: Option<&[f32]>) -> Image {
    let [channels, height, width] = input.size;
    Image::from_fn([outputs, 2 * height, 2 * width], |o, y, x| {
        let product = |i: usize| {
            let w = weight[((i * outputs + o) * 2 + y % 2) * 2 + x % 2];
            f64::from(w) * input.at(i, (y / 2) as isize, (x / 2) as isize)
        };
        bias.map_or(0.0, |bias| f64::from(bias[o])) + (0..channels).map(product).sum::<f64>()
    })
}

/// Applies `of` to each window of `size` x `size` pixels; incomplete windows are dropped.
pub(crate) fn pooled(input: &Image, size: usize, of: impl Fn(&mut dyn Iterator<Item = f64>) -> f64) -> Image {
    let [channels, height, width] = input.size;
    Image::from_fn([channels, height / size, width / size], |c, y, x| {
        let at = |i: usize| input.at(c, (y * size + i / size) as isize, (x * size + i % size) as isize);
        of(&mut (0..size * size).map(at))
    })
}

/// One step of recurrent cells (Hochreiter and Schmidhuber 1997; Shi et al. 2015). The quarters of
/// `gates` are i, f, g and o:
///
/// ```text
/// i = sigmoid(i + Vi c), f = sigmoid(f + Vf c), o = sigmoid(o + Vo c)      V: peepholes
/// c = f c + i act(g)
/// h = o act(c)
/// ```
///
/// Every peephole reads the cell before the step. A memory is the cells and then the outputs.
pub(crate) fn step(
    gates: &[f64],
    peepholes: Option<&[f32]>,
    activation: Activation,
    memory: &mut [f64],
) -> Vec<f64> {
    let count = gates.len() / 4;
    let (cells, shown) = memory.split_at_mut(count);
    for j in 0..count {
        let peep = |gate: usize| peepholes.map_or(0.0, |v| f64::from(v[gate * count + j]) * cells[j]);
        let (i, f) = (sigmoid(gates[j] + peep(0)), sigmoid(gates[count + j] + peep(1)));
        let o = sigmoid(gates[3 * count + j] + peep(2));
        cells[j] = f * cells[j] + i * activated(activation, gates[2 * count + j]);
        shown[j] = o * activated(activation, cells[j]);
    }
    shown.to_vec()
}

/// One step of an LSTM; weights (4 hidden, inputs), (4 hidden, hidden), (4 hidden).
pub(crate) fn lstm(
    x: &[f64],
    hidden: usize,
    [weight_ih, weight_hh, bias]: [&[f32]; 3],
    memory: &mut Vec<f64>,
) -> Vec<f64> {
    memory.resize(2 * hidden, 0.0);
    let from_x = dense(x, 4 * hidden, weight_ih, Some(bias));
    let from_h = dense(&memory[hidden..], 4 * hidden, weight_hh, None);
    let gates: Vec<f64> = from_x.iter().zip(&from_h).map(|(a, b)| a + b).collect();
    step(&gates, None, Activation::Tanh, memory)
}

/// One step of a convolutional LSTM; weight (4 hidden, inputs + hidden, 3, 3), bias (4 hidden),
/// peepholes (3, hidden, height, width).
fn conv_lstm(
    x: &Image,
    hidden: usize,
    (weight, bias, peepholes): (&[f32], &[f32], Option<&[f32]>),
    activation: Activation,
    memory: &mut Vec<f64>,
) -> Image {
    let [_, height, width] = x.size;
    let size = [hidden, height, width];
    let cells = hidden * height * width;
    memory.resize(2 * cells, 0.0);
    let shown = Image::new(size, memory[cells..].to_vec());
    let gates = conv(&x.beside(&shown), 3, 4 * hidden, weight, Some(bias), false);
    Image::new(size, step(&gates.values, peepholes, activation, memory))
}

/// x for x > 0, else e^x - 1.
pub(crate) fn elu(x: f64) -> f64 {
    if x > 0.0 { x } else { x.exp_m1() }
}

/// 1 / (1 + e^-x).
pub(crate) fn sigmoid(x: f64) -> f64 {
    // From e^x for x < 0: e^-x would overflow although the result is representable.
    if x < 0.0 { x.exp() / (1.0 + x.exp()) } else { 1.0 / (1.0 + (-x).exp()) }
}

/// Applies a layer's activation to its sum `x`.
pub(crate) fn activated(activation: Activation, x: f64) -> f64 {
    match activation {
        Activation::Identity => x,
        Activation::Relu => x.max(0.0),
        Activation::Elu => elu(x),
        Activation::Sigmoid => sigmoid(x),
        Activation::Tanh => x.tanh(),
    }
}

/// The exact function that `function` approximates.
pub fn elementary(function: Elementary, x: f64) -> f64 {
    match function {
        Elementary::Exp => x.exp(),
        Elementary::Expm1 => x.exp_m1(),
        Elementary::Elu => elu(x),
        Elementary::Sigmoid => sigmoid(x),
        Elementary::Tanh => x.tanh(),
    }
}
