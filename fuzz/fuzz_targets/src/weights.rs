//! Bytes as weights: a typed error, or tensors that a network runs or refuses.

use std::sync::{Arc, LazyLock};

use meissner_engine::{Engine, EngineError, Event, Sensor};
use meissner_models::{Description, Weights};

use crate::Verdict;
use torch::{Deviation, archive};

#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../../../models/tests/support/torch.rs"]
mod torch;

/// The network that gets all readable weights.
pub const NETWORK: &str = r#"
[network]
name = "small"
span_us = 1000
capacity = 16
[graph]
kind = "knn"
k = 4
candidates = "all"
scale = 0.5
[[layer]]
name = "conv"
kind = "spline"
channels = 2
kernel = 2
[[layer]]
name = "grid"
kind = "readout"
grid = [1, 1]
[[layer]]
name = "fc"
kind = "dense"
outputs = 1
[output]
names = ["angle"]
unit = "rad"
"#;

static DESCRIPTION: LazyLock<Description> =
    LazyLock::new(|| Description::parse(NETWORK).expect("the description above is consistent"));

/// safetensors and state dicts of `PyTorch`.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn weights(bytes: &[u8]) -> Verdict {
    let weights = match Weights::from_bytes(bytes) {
        Ok(weights) => weights,
        Err(error) => {
            let message = error.to_string();
            assert!(message.contains("expected"), "{message}");
            return Verdict::Refused;
        }
    };
    let mut total = 0;
    for (name, tensor) in weights.iter() {
        if let Some(values) = tensor.values() {
            let count = tensor.shape().iter().product::<usize>();
            assert_eq!(values.len(), count, "{name}");
            total += count;
        }
    }
    assert!(total <= 2 * bytes.len(), "{total} values of {} bytes", bytes.len());
    let written = weights.to_safetensors(weights.metadata());
    let again = Weights::from_bytes(&written).expect("what was written can be read");
    assert_eq!(again.to_safetensors(again.metadata()), written);
    run(&weights);
    Verdict::Accepted
}

/// A state dict's pickle in an archive with right checksums, beside one storage of zeros.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn pickle(bytes: &[u8]) -> Verdict {
    weights(&archive(&[("data.pkl", bytes), ("data/0", &[0; 64])], Deviation::default()))
}

/// Either the network refuses the weights by name, or it predicts.
fn run(weights: &Weights) {
    let network = match DESCRIPTION.network(weights) {
        Ok(network) => Arc::new(network),
        Err(error) => {
            assert!(error.to_string().contains("expected"), "{error}");
            return;
        }
    };
    let mut engine = Engine::new(network, Sensor::new(8, 8)).expect("a small network");
    for i in 0..12 {
        engine.push(Event::new(i64::from(i) * 90, i % 8, i * 3 % 8, i % 2 == 0));
    }
    match engine.predict() {
        Ok(prediction) => assert!(prediction.values.iter().all(|value| !value.is_nan())),
        Err(error) => assert!(matches!(error, EngineError::NotANumber { .. }), "{error}"),
    }
}
