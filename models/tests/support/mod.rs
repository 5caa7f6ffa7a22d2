//! Common code of the tests: the recorded references, and a writer of `torch.save` files.
#![allow(dead_code, reason = "every test file uses a part of it")]

pub(crate) mod network_text;
#[path = "../../../tests/shared_files.rs"]
mod shared_files;
pub(crate) mod torch;

use meissner_engine::Network;
use meissner_models::{Description, DescriptionError, Problem, Weights};

pub(crate) use shared_files::shared;

/// The problems of `error`, which it prints one per line.
pub(crate) fn listed(error: &DescriptionError) -> Vec<Problem> {
    let printed = error.to_string();
    assert_eq!(printed.lines().count(), error.problems().len(), "one line a problem:\n{printed}");
    error.problems().to_vec()
}

/// The only one of `problems`, as printed.
#[track_caller]
pub(crate) fn only_of(problems: &[Problem]) -> String {
    assert_eq!(problems.len(), 1, "{problems:#?}");
    problems[0].to_string()
}

/// A small consistent description with one layer of each kind.
pub(crate) const SMALL: &str = r#"[network]
name = "small"

[graph]
kind = "knn"
k = 4
candidates = "all"
scale = 0.5

[[layer]]
name = "conv1"
kind = "spline"
channels = 3
kernel = 2

[[layer]]
name = "pool1"
kind = "pool"
cell = ["1/8", "1/6"]
scale = 0.4

[[layer]]
name = "conv2"
kind = "spline"
channels = 3
kernel = [2, 3]
skip = "pool1"
root = true
bias = true

[[layer]]
name = "grid"
kind = "readout"
grid = [2, 2]

[[layer]]
name = "fc"
kind = "dense"
outputs = 1

[output]
names = ["roll"]
unit = "rad"
"#;

/// [`SMALL`] with the first `old` replaced, which must exist.
pub(crate) fn changed(old: &str, new: &str) -> String {
    assert!(SMALL.contains(old), "{old:?} must be in the description");
    SMALL.replacen(old, new, 1)
}

/// [`SMALL`] with a head instead of its dense layer, from line 36 on.
pub(crate) fn with_head() -> String {
    let head = r#"[[head]]
name = "image"
kind = "conv"
channels = 2
kernel = 3
norm = "norm1"
activation = "relu"

[[head]]
name = "halved"
kind = "max_pool"

[[head]]
name = "flat"
kind = "flatten"

[[head]]
name = "fc"
kind = "dense"
outputs = 1
"#;
    changed("[[layer]]\nname = \"fc\"\nkind = \"dense\"\noutputs = 1\n", head)
}

/// [`with_head`] with the first `old` replaced, which must exist.
pub(crate) fn changed_head(old: &str, new: &str) -> String {
    let text = with_head();
    assert!(text.contains(old), "{old:?} must be in the description");
    text.replacen(old, new, 1)
}

/// A small consistent description of a frame network.
pub(crate) const SMALL_FRAMES: &str = r#"[network]
name = "small"

[input]
kind = "image"
channels = 1
height = 12
width = 11
frames = "tactile-image"
steps = 5
scaling = "image"

[[layer]]
name = "conv1"
kind = "conv"
channels = 3
kernel = 3
activation = "relu"

[[layer]]
name = "cell"
kind = "conv_lstm"
hidden = 2

[[layer]]
name = "join"
kind = "concat"
with = "conv1"

[[layer]]
name = "flat"
kind = "flatten"

[[layer]]
name = "fc"
kind = "dense"
outputs = 2

[output]
names = ["left", "right"]
unit = "logit"
"#;

/// [`SMALL_FRAMES`] with the first `old` replaced, which must exist.
pub(crate) fn changed_frames(old: &str, new: &str) -> String {
    assert!(SMALL_FRAMES.contains(old), "{old:?} must be in the description");
    SMALL_FRAMES.replacen(old, new, 1)
}

pub(crate) fn bytes_of(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// `weights` as `torch.save` would write them.
pub(crate) fn to_pth(weights: &Weights) -> Vec<u8> {
    let sizes: Vec<(Vec<i64>, Vec<i64>)> = weights
        .iter()
        .map(|(_, tensor)| {
            let shape: Vec<i64> = tensor.shape().iter().map(|&d| d as i64).collect();
            let mut strides = vec![1; shape.len()];
            for i in (1..shape.len()).rev() {
                strides[i - 1] = strides[i] * shape[i];
            }
            (shape, strides)
        })
        .collect();
    let data: Vec<Vec<u8>> = weights.iter().map(|(_, t)| bytes_of(t.values().expect("floats"))).collect();
    let keys: Vec<String> = (0..data.len()).map(|i| i.to_string()).collect();
    let view = |i: usize| {
        let (shape, strides) = &sizes[i];
        let values = data[i].len() as i64 / 4;
        torch::View { storage: "FloatStorage", key: &keys[i], values, offset: 0, shape, strides }
    };
    let views: Vec<(&str, torch::View<'_>)> =
        weights.names().enumerate().map(|(i, name)| (name, view(i))).collect();
    let storages: Vec<(&str, &[u8])> =
        keys.iter().zip(&data).map(|(key, data)| (key.as_str(), data.as_slice())).collect();
    torch::file(&torch::state_dict(&views), &storages)
}

/// The network of this name, with its weights.
pub(crate) fn shipped(name: &str) -> (Description, Network) {
    let description = Description::shipped(name).expect("a shipped description");
    let weights = Weights::shipped(name).expect("shipped weights");
    let network = description.network(&weights).expect("weights of this network");
    (description, network)
}
