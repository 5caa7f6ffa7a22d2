//! A frame network's file as written: values typed and in range, references not resolved.
//!
//! Enters: tables. Leaves: layers whose kind is `None` where a problem of it was reported.

use std::ops::RangeInclusive;

use meissner_kernels::Activation;

use super::layer::{CHANNELS, FRAME, FrameKind, SIDES};
use crate::description::document::{LAYER, ParsedLayer, layers};
use crate::description::layer::activations;
use crate::description::table::{Table, integer, name};

/// Values that a dense layer writes.
const OUTPUTS: RangeInclusive<i64> = 1..=1 << 16;
/// Numbers of stacked LSTM layers.
const STACKED: RangeInclusive<i64> = 0..=1023;
/// Frames of a delay.
const FRAMES: RangeInclusive<i64> = 1..=1 << 16;

/// Kinds of layers; [`kind`] reads the keys of each.
const KINDS: [&str; 13] = [
    "conv",
    "upconv",
    "max_pool",
    "average_pool",
    "global_average",
    "sum",
    "concat",
    "squeeze_excite",
    "conv_lstm",
    "lstm",
    "delay",
    "flatten",
    "dense",
];

/// Reads the tables `[[layer]]` of a frame network.
pub(super) fn read_layers(root: &mut Table<'_, '_>) -> Vec<ParsedLayer<FrameKind>> {
    let reference = "the name of a layer, or \"frame\"";
    layers(root, LAYER, FRAME, reference, &KINDS, |word, table, layer| keys(word, reference, table, layer))
}

/// Reads the tables `list` of a head, in which no layer may have the name `input`.
pub(in crate::description) fn read_head(
    root: &mut Table<'_, '_>,
    list: &'static str,
    input: &str,
) -> Vec<ParsedLayer<FrameKind>> {
    let reference = "the name of a layer, or the readout";
    layers(root, list, input, reference, &KINDS, |word, table, layer| keys(word, reference, table, layer))
}

/// Reads the keys of the kind `word`.
fn keys(word: &str, reference: &str, mut table: Table<'_, '_>, layer: &mut ParsedLayer<FrameKind>) {
    if word == "concat" {
        layer.second = table.required("with", reference, name);
        let with = layer.second.as_ref().map(|given| given.value.clone());
        layer.kind = with.map(|with| FrameKind::Concat { with });
    } else {
        layer.kind = table.known(|table| kind(word, table));
    }
    if matches!(word, "conv" | "upconv" | "squeeze_excite" | "conv_lstm" | "lstm" | "dense") {
        layer.read_weights(&mut table);
    }
    table.finish();
}

/// Reads the keys of a kind without references.
fn kind(word: &str, table: &mut Table<'_, '_>) -> FrameKind {
    match word {
        "conv" => FrameKind::Conv {
            channels: table.size("channels", CHANNELS, None),
            kernel: table.value("kernel", "1 or 3", None, |value| {
                integer(value).filter(|side| [1, 3].contains(side)).map(|side| side as usize)
            }),
            bias: table.boolean("bias", true),
            norm: norm(table),
            activation: activation(table, [Activation::Identity, Activation::Relu]),
        },
        "upconv" => FrameKind::UpConv {
            channels: table.size("channels", CHANNELS, None),
            bias: table.boolean("bias", true),
        },
        "max_pool" => FrameKind::MaxPool,
        "average_pool" => FrameKind::AveragePool { size: table.size("size", SIDES, None) },
        "global_average" => FrameKind::GlobalAverage,
        "sum" => FrameKind::Sum,
        "squeeze_excite" => {
            FrameKind::SqueezeExcite { reduction: table.size("reduction", CHANNELS, Some(16)) }
        }
        "conv_lstm" => FrameKind::ConvLstm {
            hidden: table.size("hidden", CHANNELS, None),
            peepholes: table.boolean("peepholes", false),
            activation: activation(table, [Activation::Tanh, Activation::Sigmoid]),
        },
        "lstm" => FrameKind::Lstm {
            hidden: table.size("hidden", CHANNELS, None),
            layer: table.size("layer", STACKED, Some(0)),
        },
        "delay" => FrameKind::Delay { frames: table.size("frames", FRAMES, None) },
        "flatten" => FrameKind::Flatten,
        _ => FrameKind::Dense {
            outputs: table.size("outputs", OUTPUTS, None),
            bias: table.boolean("bias", true),
            norm: norm(table),
            activation: activation(table, [Activation::Identity, Activation::Relu, Activation::Elu]),
        },
    }
}

/// The prefix of batch norm's tensors, where there is any.
fn norm(table: &mut Table<'_, '_>) -> Option<String> {
    table.text("norm", "the prefix of batch norm's tensor names")
}

/// One of `kinds`, by default the first.
fn activation<const N: usize>(table: &mut Table<'_, '_>, kinds: [Activation; N]) -> Activation {
    table.option("activation", &activations(kinds))
}
