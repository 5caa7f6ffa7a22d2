//! Fingerprint of a frame network: a hash of all that predictions depend on, and of names.

use meissner_kernels::WinogradTile;

use super::network::{Convolution, FrameLayer, FrameLayerKind as Kind, FrameShape};
use crate::fingerprint::{Fingerprint, activation_code};

/// The fingerprint of a network's parts. O(parameters).
pub(super) fn of(name: &str, input: FrameShape, layers: &[FrameLayer], convolution: Convolution) -> u64 {
    let mut to = Fingerprint::new();
    to.text(name);
    to.sizes(match input {
        FrameShape::Vector(values) => [0, values, 0, 0],
        FrameShape::Image { channels, height, width } => [1, channels, height, width],
    });
    to.word(match convolution {
        Convolution::Direct => 0,
        Convolution::Kn2row => 1,
        Convolution::Winograd(WinogradTile::Two) => 2,
        Convolution::Winograd(WinogradTile::Four) => 4,
    });
    to.size(layers.len());
    for FrameLayer { name, from, kind } in layers {
        to.text(name);
        to.size(*from);
        let (code, sizes, tensors) = contents(kind);
        to.word(code);
        to.sizes(sizes);
        for tensor in tensors {
            to.word(tensor.is_some().into());
            tensor.iter().for_each(|values| to.values(values));
        }
    }
    to.finish()
}

/// Code, sizes and tensors of a layer.
fn contents(kind: &Kind) -> (u64, Vec<usize>, Vec<Option<&Vec<f32>>>) {
    match kind {
        Kind::Conv { kernel, channels, weight, bias, relu } => {
            (1, vec![*kernel, *channels, usize::from(*relu)], vec![Some(weight), bias.as_ref()])
        }
        Kind::UpConv { channels, weight, bias } => (2, vec![*channels], vec![Some(weight), bias.as_ref()]),
        Kind::MaxPool => (3, vec![], vec![]),
        Kind::AveragePool { size } => (4, vec![*size], vec![]),
        Kind::GlobalAverage => (5, vec![], vec![]),
        Kind::Sum => (6, vec![], vec![]),
        Kind::Concat { with } => (7, vec![*with], vec![]),
        Kind::SqueezeExcite { reduced, down, up } => (8, vec![*reduced], vec![Some(down), Some(up)]),
        Kind::ConvLstm { hidden, weight, bias, peepholes, activation } => {
            let tensors = vec![Some(weight), Some(bias), peepholes.as_ref()];
            (9, vec![*hidden, activation_code(*activation)], tensors)
        }
        Kind::Lstm { hidden, weight_ih, weight_hh, bias } => {
            (10, vec![*hidden], vec![Some(weight_ih), Some(weight_hh), Some(bias)])
        }
        Kind::Delay { frames } => (11, vec![*frames], vec![]),
        Kind::Flatten => (12, vec![], vec![]),
        Kind::Dense { outputs, weight, bias, activation } => {
            (13, vec![*outputs, activation_code(*activation)], vec![Some(weight), bias.as_ref()])
        }
    }
}
