//! Bytes as weights: a typed error, or tensors that are what their shapes say, and a network that runs or refuses them.

use std::sync::{Arc, LazyLock};

use meissner_engine::{Engine, EngineError, Event, Sensor};
use meissner_models::{Description, Weights};

use crate::target::Verdict;

/// The network that is offered all weights that can be read.
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

/// The instructions of a state dict's pickle, in an archive whose checksums are right, beside one storage of zeros.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn pickle(bytes: &[u8]) -> Verdict {
    weights(&archive(&[("a/data.pkl", bytes), ("a/data/0", &[0; 64])]))
}

/// Either the network refuses the weights by name, or it predicts what the engine can tell from NaN.
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

/// A zip archive of stored `entries`, a name and a content each, with right checksums, so that readers reach the contents.
fn archive(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, content) in entries {
        let at = bytes.len() as u32;
        let length = content.len() as u32;
        // Version, flags, method, time, date, checksum, sizes, lengths of name and extra field.
        let mut common = vec![0; 10];
        common.extend(crc32(content).to_le_bytes());
        common.extend([length, length].iter().flat_map(|size| size.to_le_bytes()));
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0; 2]);
        bytes.extend(b"PK\x03\x04");
        bytes.extend(&common);
        bytes.extend(name.as_bytes());
        bytes.extend(*content);
        directory.extend(b"PK\x01\x02\0\0");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend(at.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (start, size, count) = (bytes.len() as u32, directory.len() as u32, entries.len() as u16);
    bytes.extend(directory);
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend([count, count].iter().flat_map(|count| count.to_le_bytes()));
    bytes.extend([size, start].iter().flat_map(|word| word.to_le_bytes()));
    bytes.extend([0; 2]);
    bytes
}

/// CRC-32 as zip has it (reflected polynomial 0xedb88320).
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}
