//! `draw`, and what `inspect --json` says for whoever writes weights.

use std::fs;
use std::path::Path;

use meissner_models::Weights;

use crate::support::{argument, default_recording, file, lines, meissner, message, object, text};

/// A description that nobody has weights for.
const OWN: &str = r#"[network]
name = "own"

[graph]
kind = "knn"
k = 4
candidates = "past"
lifetime = "frozen"
scale = 0.5

[[layer]]
name = "conv1"
kind = "spline"
channels = 8
kernel = 2

[[layer]]
name = "pool1"
kind = "pool"
cell = ["1/8", "1/6"]
scale = 0.25

[[layer]]
name = "conv2"
kind = "spline"
channels = 8
kernel = [2, 3]

[[layer]]
name = "grid"
kind = "readout"
grid = [2, 2]

[[layer]]
name = "fc"
kind = "dense"
outputs = 1

[output]
names = ["tilt"]
unit = "rad"
"#;

fn draw(network: &str, seed: &str, out: &Path) {
    let output = meissner(&["draw", network, "--seed", seed, "--out", argument(out)]);
    assert!(output.status.success(), "{}", message(&output));
    assert!(message(&output).contains("nothing trained them"), "{}", message(&output));
}

#[test]
fn a_new_description_runs_with_drawn_weights_that_say_that_nothing_trained_them() {
    let (folder, network) = file("own.toml", OWN);
    let out = folder.path().join("own.safetensors");
    draw(argument(&network), "3", &out);
    let weights = Weights::load(&out).expect("a weights file");
    assert_eq!(weights.metadata()["about"], "drawn, untrained, seed 3");
    let again = folder.path().join("again.safetensors");
    draw(argument(&network), "3", &again);
    assert!(fs::read(&out).expect("written") == fs::read(&again).expect("written"), "a seed gives its bytes");
    let recording = default_recording();
    let run = ["run", argument(&recording), "--network", argument(&network), "--weights", argument(&out)];
    let (_, summary) =
        lines(&meissner(&[&run[..], &["--limit", "2000", "--every", "end", "--json"]].concat()));
    assert!(summary.to_string().contains("2000"), "{summary}");
    let shown = meissner(&[&run[..], &["--limit", "2000", "--every", "end"]].concat());
    assert!(text(&shown).contains("drawn, untrained, seed 3"), "{}", text(&shown));
}

#[test]
fn weights_are_drawn_for_a_frame_network_too() {
    let (folder, _) = file("none", "");
    let out = folder.path().join("tdnn.safetensors");
    draw("force-tdnn", "1", &out);
    assert_eq!(Weights::load(&out).expect("a weights file").metadata()["network"], "force-tdnn");
}

#[test]
fn drawn_weights_replace_no_file_without_force() {
    let (_folder, trained) = file("trained.safetensors", "hours of training");
    let output = meissner(&["draw", "force-tdnn", "--out", argument(&trained)]);
    assert_eq!(output.status.code(), Some(2));
    assert!(message(&output).contains("--force replaces it"), "{}", message(&output));
    assert_eq!(fs::read_to_string(&trained).expect("it is still there"), "hours of training");
}

#[test]
fn a_description_file_without_weights_is_told_how_to_draw_some() {
    let (_folder, network) = file("own.toml", OWN);
    let output = meissner(&["run", "--network", argument(&network)]);
    assert_eq!(output.status.code(), Some(2));
    assert!(message(&output).contains("meissner draw"), "{}", message(&output));
}

#[test]
fn inspect_lists_every_tensor_with_layer_shape_type_meaning_and_slot_order() {
    let (_folder, network) = file("own.toml", OWN);
    let output = meissner(&["inspect", argument(&network), "--json"]);
    let summary = object(&output);
    let kernel = &summary["tensors"][5];
    assert_eq!(kernel["name"], "conv2.conv.weight");
    assert_eq!(kernel["layer"], "conv2");
    assert_eq!(kernel["shape"], serde_json::json!([6, 8, 8]));
    assert_eq!(kernel["dtype"], "F32");
    assert_eq!(kernel["meaning"], "spline kernel: (slot, input channel, output channel)");
    assert_eq!(kernel["slot_strides"], serde_json::json!([1, 2, 6]));
    assert_eq!(
        summary["edge_attributes"]["levels"],
        serde_json::json!([
            {"level": 0, "rows": "events", "scale": 0.5},
            {"level": 1, "rows": "pool1", "scale": 0.25},
        ])
    );
    let tensors = summary["tensors"].as_array().expect("a list");
    assert_eq!(tensors.len(), 12, "kernel and batch norm of two blocks, weight and bias of a dense layer");
}
