//! The shipped, trained networks for contact force give what `PyTorch` gives with the same weights.
//!
//! `golden/force.json` has `PyTorch`'s forces (`models/train/force/golden.py`) for the streams of `golden/angles.json`: of frame networks at the
//! end of each frame, of the event graph at the end of each stream.

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_engine::representations::{Completed, Consecutive, ConsecutiveFrames};
use meissner_engine::{Engine, Event, Sensor};
use meissner_models::{FrameDescription, FrameSource, Weights};
use serde_json::Value;

use crate::trained_digits::{Golden, network, read};

/// In newtons.
const MAX: f64 = 2e-4;
const NETWORKS: [&str; 5] = ["force-cnnlstm", "force-convlstm", "force-graph", "force-lstm", "force-tdnn"];

/// Forces at the end of each frame, the open one too.
fn of_frames(description: &FrameDescription, sensor: Sensor, events: &[Event]) -> Vec<f64> {
    let weights = Weights::shipped(description.name()).expect("shipped weights");
    let parts = description.network_parts(&weights).expect("the weights fit");
    let network = FrameNetwork::new(parts, Convolution::Direct).expect("the layers fit");
    let mut engine = FrameEngine::new(network).expect("an engine");
    let &FrameSource::EventCounts { period_us, place, maximum } = description.source() else {
        panic!("counts of events")
    };
    let options = Consecutive { crop: place.crop(115, 115, sensor), period_us, start_us: None };
    let mut frames = ConsecutiveFrames::counts(sensor, options, maximum).expect("frames");
    let mut forces = Vec::new();
    let mut force = |values: &[f32]| {
        engine.push(values).expect("finite values");
        forces.push(f64::from(engine.predict().expect("numbers").values[0]));
    };
    for &event in events {
        frames.push(event, |completed| match completed {
            Completed::Frame(frame) => force(frame.values),
            Completed::Empty(run) => (0..run.count).for_each(|_| force(&vec![0.0; 2 * 115 * 115])),
        });
    }
    force(frames.open().expect("there are events").values);
    forces
}

#[test]
fn trained_networks_agree_with_pytorch_in_every_force() {
    let Golden { sensor, streams, .. } = read(include_str!("../golden/angles.json"));
    let golden: Value = serde_json::from_str(include_str!("../golden/force.json")).expect("JSON");
    let golden = golden["forces"].as_object().expect("networks");
    let mut names: Vec<&str> = golden.keys().map(String::as_str).collect();
    names.sort_unstable();
    assert_eq!(names, NETWORKS);
    for (name, expected) in golden {
        for (events, expected) in streams.iter().zip(expected.as_array().expect("streams")) {
            let found = if let Some(description) = FrameDescription::shipped(name) {
                of_frames(&description, sensor, events)
            } else {
                let mut engine = Engine::new(network(name), sensor).expect("an engine");
                engine.push_slice(events);
                engine.predict().expect("numbers").values.iter().copied().map(f64::from).collect()
            };
            let expected: Vec<f64> =
                expected.as_array().expect("forces").iter().filter_map(Value::as_f64).collect();
            assert_eq!(found.len(), expected.len(), "{name}");
            let close = |(a, b): (&f64, &f64)| (a - b).abs() < MAX * b.abs().max(1.0);
            assert!(found.iter().zip(&expected).all(close), "{name}: {found:?}, {expected:?}");
        }
    }
}
