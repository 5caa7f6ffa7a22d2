//! The shipped, trained networks for the direction of slip give what `PyTorch` gives with the same weights.
//!
//! `golden/slip.json` holds readings made by a formula, and `PyTorch`'s logits for their windows (`models/train/slip/golden.py`).

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_models::systems::slip::SlipWindows;
use meissner_models::{FrameDescription, Weights};
use serde_json::Value;

/// Relative to the largest magnitude of a window's logits, at least 1.
const MAX: f64 = 1e-4;
const STEPS: usize = 5;

fn rows<const N: usize>(value: &Value) -> Vec<[f64; N]> {
    let row = |row: &Value| {
        let values: Vec<f64> = row.as_array().expect("a row").iter().filter_map(Value::as_f64).collect();
        values.try_into().expect("as many values as there are columns")
    };
    value.as_array().expect("rows").iter().map(row).collect()
}

fn largest<const N: usize>(values: &[f64; N]) -> usize {
    (0..N).fold(0, |best, i| if values[i] > values[best] { i } else { best })
}

/// The logits of every window of `readings`.
fn logits(network: &str, readings: &[[f32; 24]]) -> Vec<[f64; 7]> {
    let description = FrameDescription::shipped(network).expect("a shipped network");
    let weights = Weights::shipped(network).expect("its weights");
    let parts = description.network_parts(&weights).expect("they fit");
    let built = FrameNetwork::new(parts, Convolution::Direct).expect("a network");
    let mut engine = FrameEngine::new(built).expect("an engine");
    let mut windows = SlipWindows::new(&description).expect("over readings");
    let mut frames = Vec::new();
    windows.cut(readings, &mut frames).expect("finite readings");
    let window = frames.chunks_exact(STEPS * windows.frame_len()).map(|window| {
        engine.reset();
        for frame in window.chunks_exact(windows.frame_len()) {
            engine.push(frame).expect("a frame");
        }
        let values = engine.predict().expect("a prediction").values;
        std::array::from_fn(|i| f64::from(values[i]))
    });
    window.collect()
}

#[test]
fn trained_networks_agree_with_pytorch_in_class_and_logits() {
    let golden: Value = serde_json::from_str(include_str!("../golden/slip.json")).expect("JSON");
    let readings: Vec<[f32; 24]> =
        rows::<24>(&golden["readings"]).iter().map(|row| row.map(|v| v as f32)).collect();
    let networks = golden["logits"].as_object().expect("networks");
    let shipped = FrameDescription::shipped_names().iter().filter(|name| name.starts_with("slip-"));
    assert_eq!(networks.len(), shipped.count(), "every shipped network is in the golden file");
    for (network, expected) in networks {
        let (expected, found) = (rows::<7>(expected), logits(network, &readings));
        assert_eq!(found.len(), readings.len() / STEPS);
        assert_eq!(found.len(), expected.len());
        for (window, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!(largest(found), largest(expected), "{network}, window {window}");
            let scale = expected.iter().fold(1f64, |scale, v| scale.max(v.abs()));
            for (found, expected) in found.iter().zip(expected) {
                let difference = (found - expected).abs() / scale;
                assert!(difference <= MAX, "{network}, window {window}: {found} against {expected}");
            }
        }
    }
}
