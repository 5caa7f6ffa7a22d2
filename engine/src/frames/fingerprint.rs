//! What tells two frame networks apart: everything that their predictions depend on, and names.

use meissner_kernels::{Activation, WinogradTile};

use super::compile::{Convolution, FrameNetwork};
use super::network::{FrameLayer, FrameLayerKind as Kind, FrameShape};
use crate::fingerprint::Fingerprint;

impl FrameNetwork {
    /// What tells this network from others: of structure, names and the bits of all parameters. Equal networks have equal
    /// ones; others collide by chance alone, though not for someone who wants them to.
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }
}

/// The fingerprint of a network's parts. O(parameters).
pub(super) fn of(name: &str, input: FrameShape, layers: &[FrameLayer], convolution: Convolution) -> u64 {
    let mut to = Fingerprint::new();
    to.text(name);
    match input {
        FrameShape::Vector(values) => [0, values, 0, 0],
        FrameShape::Image { channels, height, width } => [1, channels, height, width],
    }
    .into_iter()
    .for_each(|size| to.size(size));
    to.word(match convolution {
        Convolution::Direct => 0,
        Convolution::Winograd(WinogradTile::Two) => 2,
        Convolution::Winograd(WinogradTile::Four) => 4,
    });
    to.size(layers.len());
    for FrameLayer { name, from, kind: of_layer } in layers {
        to.text(name);
        to.size(*from);
        kind(&mut to, of_layer);
    }
    to.finish()
}

fn kind(to: &mut Fingerprint, kind: &Kind) {
    match kind {
        Kind::Conv { kernel, channels, weight, bias, relu } => {
            sizes(to, 1, &[*kernel, *channels, usize::from(*relu)]);
            values(to, &[Some(weight), bias.as_ref()]);
        }
        Kind::UpConv { channels, weight, bias } => {
            sizes(to, 2, &[*channels]);
            values(to, &[Some(weight), bias.as_ref()]);
        }
        Kind::MaxPool => sizes(to, 3, &[]),
        Kind::AveragePool { size } => sizes(to, 4, &[*size]),
        Kind::GlobalAverage => sizes(to, 5, &[]),
        Kind::Sum => sizes(to, 6, &[]),
        Kind::Concat { with } => sizes(to, 7, &[*with]),
        Kind::SqueezeExcite { reduced, down, up } => {
            sizes(to, 8, &[*reduced]);
            values(to, &[Some(down), Some(up)]);
        }
        Kind::ConvLstm { hidden, weight, bias, peepholes, activation } => {
            sizes(to, 9, &[*hidden, code(*activation)]);
            values(to, &[Some(weight), Some(bias), peepholes.as_ref()]);
        }
        Kind::Lstm { hidden, weight_ih, weight_hh, bias } => {
            sizes(to, 10, &[*hidden]);
            values(to, &[Some(weight_ih), Some(weight_hh), Some(bias)]);
        }
        Kind::Delay { frames } => sizes(to, 11, &[*frames]),
        Kind::Flatten => sizes(to, 12, &[]),
        Kind::Dense { outputs, weight, bias, activation } => {
            sizes(to, 13, &[*outputs, code(*activation)]);
            values(to, &[Some(weight), bias.as_ref()]);
        }
    }
}

/// The kind of a layer, and its sizes.
fn sizes(to: &mut Fingerprint, kind: u64, sizes: &[usize]) {
    to.word(kind);
    sizes.iter().for_each(|&size| to.size(size));
}

fn values(to: &mut Fingerprint, tensors: &[Option<&Vec<f32>>]) {
    for tensor in tensors {
        to.word(tensor.is_some().into());
        tensor.iter().for_each(|values| to.values(values));
    }
}

fn code(activation: Activation) -> usize {
    match activation {
        Activation::Identity => 0,
        Activation::Relu => 1,
        Activation::Elu => 2,
        Activation::Sigmoid => 3,
        Activation::Tanh => 4,
    }
}
