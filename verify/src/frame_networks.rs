//! Random frame networks and sequences of frames that change little.

use meissner_engine::frames::{
    FrameFeatures, FrameLayer, FrameLayerKind, FrameNetworkParts, FrameShape, FrameStatistics,
    TrainingFrames, output_shape,
};
use meissner_kernels::Activation;

use meissner_kernels::random::Random;

/// The kind of a network, without sizes and weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Convolutions and poolings, then dense layers.
    Classifier,
    /// Down, up, and concatenated.
    UNet {
        /// Whether it has squeeze-and-excitation.
        squeeze: bool,
    },
    /// Convolutions of few channels, then an LSTM.
    ConvolutionsThenLstm,
    /// Two convolutional LSTMs of so many channels, then a dense layer.
    ConvLstm {
        /// Channels of the state.
        hidden: usize,
        /// Whether the gates see the cells.
        peepholes: bool,
    },
    /// Sums, their recent history, and dense layers.
    Delays,
    /// LSTMs, delays and dense layers over one vector, appended to each other in a random order.
    Committee {
        /// Whether the frame is that vector, with as many values as the image would have.
        vector: bool,
    },
}

/// A network under construction.
struct Builder {
    random: Random,
    input: FrameShape,
    /// Shapes of the frame and of each layer.
    shapes: Vec<FrameShape>,
    layers: Vec<FrameLayer>,
}

impl Builder {
    fn new(input: FrameShape, seed: u64) -> Self {
        Self { random: Random::new(seed), input, shapes: vec![input], layers: Vec::new() }
    }

    fn parts(self, name: String) -> FrameNetworkParts {
        FrameNetworkParts { name, input: self.input, layers: self.layers, training: None }
    }

    fn image(&self, value: usize) -> [usize; 3] {
        match self.shapes[value] {
            FrameShape::Image { channels, height, width } => [channels, height, width],
            FrameShape::Vector(values) => [values, 1, 1],
        }
    }

    /// Weights that keep the size of activations about constant.
    fn weights(&mut self, count: usize, inputs: usize) -> Vec<f32> {
        self.random.values(count, (3.0 / inputs as f32).sqrt())
    }

    fn push(&mut self, from: usize, kind: FrameLayerKind) -> usize {
        let layer = FrameLayer { name: format!("layer{}", self.layers.len()), from, kind };
        self.shapes.push(output_shape(&layer, &self.shapes).expect("layers that fit"));
        self.layers.push(layer);
        self.layers.len()
    }

    fn conv(&mut self, from: usize, channels: usize, kernel: usize, relu: bool) -> usize {
        let [read, ..] = self.image(from);
        let weight = self.weights(channels * read * kernel * kernel, read * kernel * kernel);
        let bias = Some(self.random.values(channels, 0.1));
        self.push(from, FrameLayerKind::Conv { kernel, channels, weight, bias, relu })
    }

    fn squeeze(&mut self, from: usize) -> usize {
        let [channels, ..] = self.image(from);
        let (down, up) = (self.weights(2 * channels, channels), self.weights(2 * channels, 2));
        self.push(from, FrameLayerKind::SqueezeExcite { reduced: 2, down, up })
    }

    fn conv_lstm(&mut self, from: usize, hidden: usize, peepholes: bool) -> usize {
        let [read, height, width] = self.image(from);
        let weight = self.weights(4 * hidden * (read + hidden) * 9, (read + hidden) * 9);
        let bias = self.random.values(4 * hidden, 0.1);
        let peepholes = peepholes.then(|| self.random.values(3 * hidden * height * width, 0.5));
        let activation = if self.random.below(2) == 0 { Activation::Tanh } else { Activation::Sigmoid };
        self.push(from, FrameLayerKind::ConvLstm { hidden, weight, bias, peepholes, activation })
    }

    fn lstm(&mut self, from: usize, hidden: usize) -> usize {
        let inputs = self.shapes[from].values();
        let weight_ih = self.weights(4 * hidden * inputs, inputs);
        let weight_hh = self.weights(4 * hidden * hidden, hidden);
        let bias = self.random.values(4 * hidden, 0.1);
        self.push(from, FrameLayerKind::Lstm { hidden, weight_ih, weight_hh, bias })
    }

    fn dense(&mut self, from: usize, outputs: usize, activation: Activation) -> usize {
        let inputs = self.shapes[from].values();
        let weight = self.weights(outputs * inputs, inputs);
        let bias = Some(self.random.values(outputs, 0.1));
        self.push(from, FrameLayerKind::Dense { outputs, weight, bias, activation })
    }

    /// Appends vectors to each other and puts layers on them. The last layer reads the last three.
    fn committee(&mut self, read: usize) {
        let delay = self.push(read, FrameLayerKind::Delay { frames: 3 });
        let mut members = vec![
            read,
            delay,
            self.lstm(read, 5),
            self.dense(read, 4, Activation::Identity),
            self.dense(delay, 7, Activation::Relu),
        ];
        for _ in 0..6 {
            let [a, b] = [(); 2].map(|()| members[self.random.below(members.len() as u64) as usize]);
            let both = self.push(a, FrameLayerKind::Concat { with: b });
            members.push(match self.random.below(4) {
                0 => self.lstm(both, 3),
                _ if self.shapes[both].values() > 4096 => self.dense(both, 6, Activation::Relu),
                1 => self.push(both, FrameLayerKind::Delay { frames: 2 }),
                2 => self.dense(both, 6, Activation::Relu),
                _ => both,
            });
        }
        let [.., a, b, c] = members[..] else { return };
        let last = self.push(b, FrameLayerKind::Concat { with: c });
        let last = self.push(last, FrameLayerKind::Concat { with: a });
        self.dense(last, 2, Activation::Identity);
    }
}

/// A network of `style` over frames of `channels` x `height` x `width`.
pub fn network(
    style: Style,
    [channels, height, width]: [usize; 3],
    width_of_layers: usize,
    seed: u64,
) -> FrameNetworkParts {
    let input = match style {
        Style::Committee { vector: true } => FrameShape::Vector(channels * height * width),
        _ => FrameShape::Image { channels, height, width },
    };
    let mut net = Builder::new(input, seed);
    let wide = width_of_layers;
    match style {
        Style::Classifier => {
            let a = net.conv(0, wide, 3, true);
            let b = net.push(a, FrameLayerKind::MaxPool);
            let c = net.conv(b, 2 * wide, 3, true);
            let d = net.conv(c, wide, 1, false);
            let e = net.push(d, FrameLayerKind::Flatten);
            let f = net.dense(e, 9, Activation::Relu);
            net.dense(f, 3, Activation::Identity);
        }
        Style::UNet { squeeze } => {
            let mut encoder = net.conv(0, wide, 3, true);
            if squeeze {
                encoder = net.squeeze(encoder);
            }
            let low = net.push(encoder, FrameLayerKind::MaxPool);
            let low = net.conv(low, 2 * wide, 3, true);
            let [read, ..] = net.image(low);
            let weight = net.weights(read * wide * 4, read);
            let bias = Some(net.random.values(wide, 0.1));
            let up = net.push(low, FrameLayerKind::UpConv { channels: wide, weight, bias });
            let both = net.push(up, FrameLayerKind::Concat { with: encoder });
            let high = net.conv(both, wide, 3, true);
            net.conv(high, 1, 1, false);
        }
        Style::ConvolutionsThenLstm => {
            let a = net.conv(0, 3, 3, true);
            let b = net.push(a, FrameLayerKind::MaxPool);
            let c = net.conv(b, 3, 3, true);
            let d = net.push(c, FrameLayerKind::Flatten);
            let e = net.lstm(d, 6);
            net.dense(e, 1, Activation::Identity);
        }
        Style::ConvLstm { hidden, peepholes } => {
            let a = net.conv_lstm(0, hidden, peepholes);
            let b = net.conv_lstm(a, hidden, peepholes);
            let c = net.push(b, FrameLayerKind::Flatten);
            net.dense(c, 2, Activation::Identity);
        }
        Style::Delays => {
            let a = net.push(0, FrameLayerKind::Sum);
            let b = net.push(a, FrameLayerKind::Delay { frames: 3 });
            let c = net.dense(b, 5, Activation::Relu);
            net.dense(c, 1, Activation::Identity);
        }
        Style::Committee { vector: true } => net.committee(0),
        Style::Committee { vector: false } => {
            let a = net.conv(0, 3, 3, true);
            let b = net.push(a, FrameLayerKind::MaxPool);
            let c = net.push(b, FrameLayerKind::Flatten);
            net.committee(c);
        }
    }
    FrameNetworkParts { training: training(input), ..net.parts(format!("{style:?}")) }
}

/// Statistics of the frames of a made-up training.
fn training(input: FrameShape) -> Option<TrainingFrames> {
    let of = match input {
        FrameShape::Image { .. } => FrameFeatures::Image,
        FrameShape::Vector(values) => FrameFeatures::Values((0..values.min(8)).collect()),
    };
    let features = FrameStatistics::new(&of, input, false)?.features().len();
    TrainingFrames::from_parts(of, &vec![0.5; features], (1..=features).map(|i| vec![1.0; i]).collect())
}

/// A network without state for images of `image` (channels, rows, columns): a convolution, a
/// pooling if the image can be halved, a dense layer of `outputs`.
pub fn head(image: [usize; 3], channels: usize, outputs: usize, seed: u64) -> FrameNetworkParts {
    let [read, height, width] = image;
    let input = FrameShape::Image { channels: read, height, width };
    let mut net = Builder::new(input, seed);
    let mut last = net.conv(0, channels, 3, true);
    if height.is_multiple_of(2) && width.is_multiple_of(2) && !seed.is_multiple_of(3) {
        last = net.push(last, FrameLayerKind::MaxPool);
    }
    let flat = net.push(last, FrameLayerKind::Flatten);
    net.dense(flat, outputs, Activation::Identity);
    net.parts("head".to_owned())
}

/// Frames of `channels` x `height` x `width`, mostly zero and often equal to the one before.
pub fn sequence(count: usize, [channels, height, width]: [usize; 3], seed: u64) -> Vec<Vec<f32>> {
    let mut random = Random::new(seed);
    let mut frame = vec![0.0; channels * height * width];
    (0..count)
        .map(|_| {
            next_frame(&mut frame, &mut random);
            frame.clone()
        })
        .collect()
}

/// Turns `frame` into the next one.
pub(crate) fn next_frame(frame: &mut Vec<f32>, random: &mut Random) {
    match random.below(8) {
        0 => frame.fill(0.0),
        1 => *frame = random.values(frame.len(), 1.0),
        2 => {}
        changes => {
            for _ in 0..changes {
                let at = random.below(frame.len() as u64) as usize;
                frame[at] = if random.below(3) == 0 { 0.0 } else { random.symmetric() };
            }
        }
    }
}
