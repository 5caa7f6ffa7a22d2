//! A description file of a frame network as it is written: values are typed and in range, references are not resolved.
//!
//! Enters: a [`Document`]. Leaves: a [`File`], with `None` for whatever was reported as a problem.

use std::ops::RangeInclusive;

use meissner_kernels::Activation;
use toml::de::DeValue;

use super::input::{self, Input};
use super::layer::{CHANNELS, FRAME, FrameKind, SIDES};
use crate::description::document::{Document, INPUT, LAYER, NAME, Output, name};
use crate::description::layer::activation_word;
use crate::description::problem::Problems;
use crate::description::table::{Given, Table, integer};

/// Values that a dense layer writes.
const OUTPUTS: RangeInclusive<i64> = 1..=1 << 16;
/// Numbers of stacked LSTM layers.
const STACKED: RangeInclusive<i64> = 0..=1023;
/// Frames of a delay.
const FRAMES: RangeInclusive<i64> = 1..=1 << 16;

/// Kinds of layers; the readers of their keys are in the same order in [`kind`].
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

/// A file's tables.
#[derive(Debug)]
pub(super) struct File {
    pub(super) name: String,
    pub(super) input: Option<Input>,
    pub(super) layers: Vec<FileLayer>,
    pub(super) output: Output,
}

/// A `[[layer]]` table, or a `[[head]]` table of a network over events.
#[derive(Debug)]
pub(in crate::description) struct FileLayer {
    pub(in crate::description) name: String,
    pub(in crate::description) line: usize,
    /// Its input; `None` is the layer before it.
    pub(in crate::description) from: Option<Given<String>>,
    /// Its second input.
    pub(in crate::description) with: Option<Given<String>>,
    /// Prefix of its tensors.
    pub(in crate::description) weights: String,
    /// Its computation; `None` where a problem of it was reported.
    pub(in crate::description) kind: Option<FrameKind>,
}

/// Reads `document`; whatever is wrong goes to `problems`.
pub(super) fn read(document: &Document<'_>, problems: &mut Problems) -> File {
    let [network, input, output] = document.tables(
        [
            ("network", "a table with the network's name"),
            (INPUT, "a table with a frame's shape and source"),
            ("output", "a table with the prediction's names and unit"),
        ],
        &[],
        problems,
    );
    let mut network_name = None;
    if let Some(table) = network {
        let mut table = document.open(table, problems);
        network_name = table.required("name", NAME, name);
        table.finish();
    }
    let input = input.map(|table| input::read(document.open(table, problems)));
    let output = document.output(output, problems);
    let mut layers = Vec::new();
    for table in document.layers(LAYER, problems) {
        let (layer, name) = document.layer(table, FRAME, problems);
        layers.push(read_layer(layer, name, table.line(), "\"frame\""));
    }
    let name = network_name.map(|given| given.value).unwrap_or_default();
    File { name, input, layers, output }
}

/// Reads a layer's table. `input` is the name of the network's input in messages.
pub(in crate::description) fn read_layer(
    mut table: Table<'_, '_>,
    layer_name: String,
    line: usize,
    input: &str,
) -> FileLayer {
    let reference = format!("the name of a layer, or {input}");
    let choices: [(&str, &str); KINDS.len()] = KINDS.map(|word| (word, word));
    let word = table.choice("kind", &choices, None);
    let from = table.optional("from", &reference, name);
    let mut with = None;
    let kind = word.and_then(|word| kind(word, &reference, &mut table, &mut with));
    let trained = matches!(word, Some("conv" | "upconv" | "squeeze_excite" | "conv_lstm" | "lstm" | "dense"));
    let weights =
        trained.then(|| table.optional("weights", "the prefix of the layer's tensor names", name)).flatten();
    // The keys of an unknown kind are unknown.
    if word.is_some() {
        table.finish();
    }
    let weights = weights.map_or_else(|| layer_name.clone(), |given| given.value);
    FileLayer { name: layer_name, line, from, with, weights, kind }
}

/// Reads the keys of a kind. All keys are read before one that is missing ends it, so every problem is reported.
fn kind(
    word: &str,
    reference: &str,
    table: &mut Table<'_, '_>,
    with: &mut Option<Given<String>>,
) -> Option<FrameKind> {
    Some(match word {
        "conv" => {
            let channels = table.size("channels", CHANNELS, None);
            let kernel = kernel(table);
            let (bias, norm) = (table.boolean("bias", true), norm(table));
            let activation = activation(table, &[Activation::Identity, Activation::Relu]);
            FrameKind::Conv { channels: channels?, kernel: kernel?, bias, norm, activation: activation? }
        }
        "upconv" => {
            let channels = table.size("channels", CHANNELS, None);
            let bias = table.boolean("bias", true);
            FrameKind::UpConv { channels: channels?, bias }
        }
        "max_pool" => FrameKind::MaxPool,
        "average_pool" => FrameKind::AveragePool { size: table.size("size", SIDES, None)? },
        "global_average" => FrameKind::GlobalAverage,
        "sum" => FrameKind::Sum,
        "concat" => {
            *with = table.required("with", reference, name);
            FrameKind::Concat { with: with.as_ref()?.value.clone() }
        }
        "squeeze_excite" => {
            FrameKind::SqueezeExcite { reduction: table.size("reduction", CHANNELS, Some(16))? }
        }
        "conv_lstm" => {
            let hidden = table.size("hidden", CHANNELS, None);
            let peepholes = table.boolean("peepholes", false);
            let activation = activation(table, &[Activation::Tanh, Activation::Sigmoid]);
            FrameKind::ConvLstm { hidden: hidden?, peepholes, activation: activation? }
        }
        "lstm" => {
            let hidden = table.size("hidden", CHANNELS, None);
            let layer = table.size("layer", STACKED, Some(0));
            FrameKind::Lstm { hidden: hidden?, layer: layer? }
        }
        "delay" => FrameKind::Delay { frames: table.size("frames", FRAMES, None)? },
        "flatten" => FrameKind::Flatten,
        _ => {
            let outputs = table.size("outputs", OUTPUTS, None);
            let (bias, norm) = (table.boolean("bias", true), norm(table));
            let activation = activation(table, &[Activation::Identity, Activation::Relu, Activation::Elu]);
            FrameKind::Dense { outputs: outputs?, bias, norm, activation: activation? }
        }
    })
}

/// The prefix of batch norm's tensors, where there is any.
fn norm(table: &mut Table<'_, '_>) -> Option<String> {
    table.optional("norm", "the prefix of batch norm's tensor names", name).map(|given| given.value)
}

/// One of `activations`, by default the first.
fn activation<const N: usize>(
    table: &mut Table<'_, '_>,
    activations: &[Activation; N],
) -> Option<Activation> {
    let choices = activations.map(|activation| (activation_word(activation), activation));
    table.choice("activation", &choices, Some(activations[0]))
}

fn kernel(table: &mut Table<'_, '_>) -> Option<usize> {
    let read = |value: &DeValue<'_>| integer(value).filter(|v| [1, 3].contains(v)).map(|v| v as usize);
    table.required("kernel", "1 or 3", read).map(|given| given.value)
}
