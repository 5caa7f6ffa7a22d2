//! Bytes as descriptions: problems with lines, or a description to show, draw and run.

use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_engine::{Engine, EngineError, Event, Options, Sensor};
use meissner_models::{AnyDescription, Description, FrameDescription, draw};

use crate::Verdict;

/// Maximum parameters of networks that are built.
const PARAMETERS: usize = 1 << 16;
/// Maximum values of a frame, and maximum multiply-adds, of frame networks that are run.
const FRAME_VALUES: usize = 1 << 14;
const MULTIPLY_ADDS: usize = 1 << 22;
/// Maximum bytes of state of networks that are run: an engine must refuse more.
const STATE_BYTES: u128 = 1 << 24;

/// Descriptions of networks over events and over frames.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn description(bytes: &[u8]) -> Verdict {
    let Ok(text) = str::from_utf8(bytes) else { return Verdict::Refused };
    let description = match AnyDescription::parse(text) {
        Ok(description) => description,
        Err(error) => {
            let lines = text.lines().count() + 1;
            assert!(!error.problems().is_empty());
            for problem in error.problems() {
                assert!((1..=lines).contains(&problem.line), "{problem} of {lines} lines");
            }
            return Verdict::Refused;
        }
    };
    assert!(!description.to_table().is_empty());
    let _ = description.summary();
    match description {
        AnyDescription::Events(description) => events(&description),
        AnyDescription::Frames(description) => frames(&description),
    }
    Verdict::Accepted
}

fn events(description: &Description) {
    if description.parameters() > PARAMETERS {
        return;
    }
    let network = description.network(&draw(description, 1));
    let network = Arc::new(network.unwrap_or_else(|e| panic!("a checked description: {e}")));
    let options = Options::new().with_memory_limit(STATE_BYTES);
    match Engine::with_options(network, Sensor::new(24, 16), options) {
        Ok(mut engine) => {
            for i in 0..8 {
                engine.push(Event::new(i64::from(i) * 90, i * 5 % 24, i * 3 % 16, i % 2 == 0));
            }
            let prediction = engine.predict();
            assert!(matches!(prediction, Ok(_) | Err(EngineError::NotANumber { .. })), "{prediction:?}");
        }
        Err(error) => assert!(
            matches!(error, EngineError::Memory { .. } | EngineError::NotIncremental(_)),
            "a checked description: {error}"
        ),
    }
}

fn frames(description: &FrameDescription) {
    let values = description.input().values();
    if description.parameters() > PARAMETERS
        || values > FRAME_VALUES
        || description.multiply_adds() > MULTIPLY_ADDS
    {
        return;
    }
    let parts = description.network_parts(&draw(description, 1));
    let parts = parts.unwrap_or_else(|e| panic!("a checked description: {e}"));
    let network = FrameNetwork::new(parts, Convolution::Direct)
        .unwrap_or_else(|e| panic!("a checked description: {e}"));
    let mut engine = FrameEngine::new(network).unwrap_or_else(|e| panic!("a checked description: {e}"));
    engine.push(&vec![0.5; values]).expect("a frame that fits");
    let prediction = engine.predict();
    assert!(matches!(prediction, Ok(_) | Err(EngineError::NotANumber { .. })), "{prediction:?}");
}
