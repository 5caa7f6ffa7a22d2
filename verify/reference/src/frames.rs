//! A frame network in f64: every layer is computed completely for every frame.
//!
//! Input: frames, (channels, height, width) for an image. Output: the values of every layer, in the same layout.
//! Recurrent layers keep their state between frames.

mod image;
mod recurrent;

use meissner_engine::EngineError;
use meissner_engine::frames::{Convolution, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameShape};

use crate::activation::{activated, sigmoid};
use image::Image;

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

    /// Takes the next frame and computes every layer; returns the output of the last one. O(multiply-adds).
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

    /// The output of the last layer, (channels, height, width) for an image; empty before the first frame.
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
            image::conv(input, *kernel, *channels, weight, bias.as_deref(), *relu)
        }
        Kind::UpConv { channels, weight, bias } => image::up_conv(input, *channels, weight, bias.as_deref()),
        Kind::MaxPool => image::pooled(input, 2, |window| window.fold(f64::NEG_INFINITY, f64::max)),
        Kind::AveragePool { size } => {
            let pixels = (size * size) as f64;
            image::pooled(input, *size, |window| window.sum::<f64>() / pixels)
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
            recurrent::conv_lstm(input, *hidden, (weight, bias, peepholes), *activation, memory)
        }
        Kind::Lstm { hidden, weight_ih, weight_hh, bias } => {
            Image::vector(recurrent::lstm(&input.values, *hidden, [weight_ih, weight_hh, bias], memory))
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
