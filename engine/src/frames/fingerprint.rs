//! Fingerprint of a frame network: a hash of everything that its predictions depend on, and of names.

use meissner_kernels::WinogradTile;

use super::network::{Convolution, FrameLayer, FrameLayerKind as Kind, FrameShape};
use crate::fingerprint::{Fingerprint, activation_code};

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
            sizes(to, 9, &[*hidden, activation_code(*activation)]);
            values(to, &[Some(weight), Some(bias), peepholes.as_ref()]);
        }
        Kind::Lstm { hidden, weight_ih, weight_hh, bias } => {
            sizes(to, 10, &[*hidden]);
            values(to, &[Some(weight_ih), Some(weight_hh), Some(bias)]);
        }
        Kind::Delay { frames } => sizes(to, 11, &[*frames]),
        Kind::Flatten => sizes(to, 12, &[]),
        Kind::Dense { outputs, weight, bias, activation } => {
            sizes(to, 13, &[*outputs, activation_code(*activation)]);
            values(to, &[Some(weight), bias.as_ref()]);
        }
    }
}

/// Adds the kind of a layer and its sizes.
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
