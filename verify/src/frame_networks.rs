//! Random frame networks and sequences of frames that change little.

use meissner_engine::frames::{FrameLayer, FrameLayerKind, FrameNetworkParts, FrameShape};
use meissner_kernels::Activation;

use meissner_models::random::Random;

use crate::random_frames::next_frame;

/// The kind of a network, without sizes and weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Convolutions and poolings, then dense layers.
    Classifier,
    /// Down, up, and concatenated; with or without squeeze-and-excitation.
    UNet {
        /// Which of the two.
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
    /// Sums, their recent past, and dense layers.
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
    shapes: Vec<FrameShape>,
    layers: Vec<FrameLayer>,
}

impl Builder {
    fn last(&self) -> usize {
        self.layers.len()
    }

    fn image(&self, value: usize) -> [usize; 3] {
        match self.shapes[value] {
            FrameShape::Image { channels, height, width } => [channels, height, width],
            FrameShape::Vector(values) => [values, 1, 1],
        }
    }

    /// Weights that keep activations of about the same size.
    fn weights(&mut self, count: usize, inputs: usize) -> Vec<f32> {
        self.random.values(count, (3.0 / inputs as f32).sqrt())
    }

    fn push(&mut self, from: usize, kind: FrameLayerKind, shape: FrameShape) -> usize {
        let name = format!("layer{}", self.layers.len());
        self.layers.push(FrameLayer { name, from, kind });
        self.shapes.push(shape);
        self.last()
    }

    fn conv(&mut self, from: usize, channels: usize, kernel: usize, relu: bool) -> usize {
        let [read, height, width] = self.image(from);
        let weight = self.weights(channels * read * kernel * kernel, read * kernel * kernel);
        let bias = Some(self.random.values(channels, 0.1));
        let kind = FrameLayerKind::Conv { kernel, channels, weight, bias, relu };
        self.push(from, kind, FrameShape::Image { channels, height, width })
    }

    fn pool(&mut self, from: usize) -> usize {
        let [channels, height, width] = self.image(from);
        let shape = FrameShape::Image { channels, height: height / 2, width: width / 2 };
        self.push(from, FrameLayerKind::MaxPool, shape)
    }

    fn squeeze(&mut self, from: usize) -> usize {
        let [channels, ..] = self.image(from);
        let (down, up) = (self.weights(2 * channels, channels), self.weights(2 * channels, 2));
        let shape = self.shapes[from];
        self.push(from, FrameLayerKind::SqueezeExcite { reduced: 2, down, up }, shape)
    }

    fn conv_lstm(&mut self, from: usize, hidden: usize, peepholes: bool) -> usize {
        let [read, height, width] = self.image(from);
        let weight = self.weights(4 * hidden * (read + hidden) * 9, (read + hidden) * 9);
        let bias = self.random.values(4 * hidden, 0.1);
        let peepholes = peepholes.then(|| self.random.values(3 * hidden * height * width, 0.5));
        let activation = if self.random.below(2) == 0 { Activation::Tanh } else { Activation::Sigmoid };
        let kind = FrameLayerKind::ConvLstm { hidden, weight, bias, peepholes, activation };
        self.push(from, kind, FrameShape::Image { channels: hidden, height, width })
    }

    fn lstm(&mut self, from: usize, hidden: usize) -> usize {
        let inputs = self.shapes[from].values();
        let weight_ih = self.weights(4 * hidden * inputs, inputs);
        let weight_hh = self.weights(4 * hidden * hidden, hidden);
        let bias = self.random.values(4 * hidden, 0.1);
        let kind = FrameLayerKind::Lstm { hidden, weight_ih, weight_hh, bias };
        self.push(from, kind, FrameShape::Vector(hidden))
    }

    fn delay(&mut self, from: usize, frames: usize) -> usize {
        let values = self.shapes[from].values();
        self.push(from, FrameLayerKind::Delay { frames }, FrameShape::Vector(frames * values))
    }

    fn append(&mut self, from: usize, with: usize) -> usize {
        let values = self.shapes[from].values() + self.shapes[with].values();
        self.push(from, FrameLayerKind::Concat { with }, FrameShape::Vector(values))
    }

    /// Appends vectors to each other and puts layers on them. The last layer reads the last three.
    fn committee(&mut self, read: usize) {
        let delay = self.delay(read, 3);
        let mut members = vec![
            read,
            delay,
            self.lstm(read, 5),
            self.dense(read, 4, Activation::Identity),
            self.dense(delay, 7, Activation::Relu),
        ];
        for _ in 0..6 {
            let [a, b] = [(); 2].map(|()| members[self.random.below(members.len() as u64) as usize]);
            let both = self.append(a, b);
            members.push(match self.random.below(4) {
                0 => self.lstm(both, 3),
                _ if self.shapes[both].values() > 4096 => self.dense(both, 6, Activation::Relu),
                1 => self.delay(both, 2),
                2 => self.dense(both, 6, Activation::Relu),
                _ => both,
            });
        }
        let [.., a, b, c] = members[..] else { return };
        let last = self.append(b, c);
        let last = self.append(last, a);
        self.dense(last, 2, Activation::Identity);
    }

    fn flatten(&mut self, from: usize) -> usize {
        let values = self.shapes[from].values();
        self.push(from, FrameLayerKind::Flatten, FrameShape::Vector(values))
    }

    fn dense(&mut self, from: usize, outputs: usize, activation: Activation) -> usize {
        let inputs = self.shapes[from].values();
        let weight = self.weights(outputs * inputs, inputs);
        let bias = Some(self.random.values(outputs, 0.1));
        let kind = FrameLayerKind::Dense { outputs, weight, bias, activation };
        self.push(from, kind, FrameShape::Vector(outputs))
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
    let mut net = Builder { random: Random::new(seed), shapes: vec![input], layers: Vec::new() };
    let wide = width_of_layers;
    match style {
        Style::Classifier => {
            let a = net.conv(0, wide, 3, true);
            let b = net.pool(a);
            let c = net.conv(b, 2 * wide, 3, true);
            let d = net.conv(c, wide, 1, false);
            let e = net.flatten(d);
            let f = net.dense(e, 9, Activation::Relu);
            net.dense(f, 3, Activation::Identity);
        }
        Style::UNet { squeeze } => {
            let mut encoder = net.conv(0, wide, 3, true);
            if squeeze {
                encoder = net.squeeze(encoder);
            }
            let low = net.pool(encoder);
            let low = net.conv(low, 2 * wide, 3, true);
            let [read, h, w] = net.image(low);
            let weight = net.weights(read * wide * 4, read);
            let bias = Some(net.random.values(wide, 0.1));
            let up = FrameLayerKind::UpConv { channels: wide, weight, bias };
            let up = net.push(low, up, FrameShape::Image { channels: wide, height: 2 * h, width: 2 * w });
            let shape = FrameShape::Image { channels: 2 * wide, height: 2 * h, width: 2 * w };
            let both = net.push(up, FrameLayerKind::Concat { with: encoder }, shape);
            let high = net.conv(both, wide, 3, true);
            net.conv(high, 1, 1, false);
        }
        Style::ConvolutionsThenLstm => {
            let a = net.conv(0, 3, 3, true);
            let b = net.pool(a);
            let c = net.conv(b, 3, 3, true);
            let d = net.flatten(c);
            let e = net.lstm(d, 6);
            net.dense(e, 1, Activation::Identity);
        }
        Style::ConvLstm { hidden, peepholes } => {
            let a = net.conv_lstm(0, hidden, peepholes);
            let b = net.conv_lstm(a, hidden, peepholes);
            let c = net.flatten(b);
            net.dense(c, 2, Activation::Identity);
        }
        Style::Delays => {
            let a = net.push(0, FrameLayerKind::Sum, FrameShape::Vector(channels));
            let b = net.delay(a, 3);
            let c = net.dense(b, 5, Activation::Relu);
            net.dense(c, 1, Activation::Identity);
        }
        Style::Committee { vector: true } => net.committee(0),
        Style::Committee { vector: false } => {
            let a = net.conv(0, 3, 3, true);
            let b = net.pool(a);
            let c = net.flatten(b);
            net.committee(c);
        }
    }
    FrameNetworkParts { name: format!("{style:?}"), input, layers: net.layers }
}

/// A network without state, for images of `image` (channels, rows, columns): a convolution of `channels`, a pooling where
/// the image can be halved, a dense layer of `outputs`.
pub fn head(image: [usize; 3], channels: usize, outputs: usize, seed: u64) -> FrameNetworkParts {
    let [read, height, width] = image;
    let input = FrameShape::Image { channels: read, height, width };
    let mut net = Builder { random: Random::new(seed), shapes: vec![input], layers: Vec::new() };
    let mut last = net.conv(0, channels, 3, true);
    if height.is_multiple_of(2) && width.is_multiple_of(2) && !seed.is_multiple_of(3) {
        last = net.pool(last);
    }
    let flat = net.flatten(last);
    net.dense(flat, outputs, Activation::Identity);
    FrameNetworkParts { name: "head".to_owned(), input, layers: net.layers }
}

/// Frames of `channels` x `height` x `width`: mostly zero, each the one before but for a few pixels, sometimes all of them,
/// sometimes none.
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
