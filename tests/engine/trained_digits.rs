//! The shipped, trained networks for digits give what `PyTorch` gives with the same weights, and as `all`, `past` with
//! `window` and `past` with `frozen` differ in nothing but the graph.
//!
//! `golden/digits.json` holds streams of events made by a formula, and `PyTorch`'s logits at their ends
//! (`models/train/digits/golden.py`).

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_engine::representations::{Crop, SlidingSigned};
use meissner_engine::{Batch, Engine, EngineError, Event, Search, Sensor, Stream};
use meissner_models::description::frames::SignedTiming;
use meissner_models::{Description, FrameDescription, FrameSource, Weights};
use meissner_verify::bits;
use serde_json::Value;

/// Relative to the largest magnitude of a stream's logits, at least 1.
const MAX: f64 = 1e-4;

/// Streams of events, and what `PyTorch` says at their ends.
pub(crate) struct Golden {
    pub(crate) sensor: Sensor,
    pub(crate) streams: Vec<Vec<Event>>,
    /// Of each network, of each stream.
    pub(crate) logits: Vec<(String, Vec<Vec<f64>>)>,
}

fn golden() -> Golden {
    read(include_str!("../golden/digits.json"))
}

/// The content of a golden file.
pub(crate) fn read(text: &str) -> Golden {
    let golden: Value = serde_json::from_str(text).expect("JSON");
    let list = |value: &Value| value.as_array().expect("a list").clone();
    let row = |row: &Value| -> Vec<f64> { list(row).iter().filter_map(Value::as_f64).collect() };
    let event = |value: &Value| {
        let [t, x, y, on] = row(value)[..] else { panic!("an event has four columns") };
        Event::new(t as i64, x as u16, y as u16, on == 1.0)
    };
    let [width, height] = row(&golden["sensor"])[..] else { panic!("a sensor has two sides") };
    let logits = golden["logits"].as_object().expect("networks");
    Golden {
        sensor: Sensor::new(width as u16, height as u16),
        streams: list(&golden["streams"]).iter().map(|s| list(s).iter().map(event).collect()).collect(),
        logits: logits
            .iter()
            .map(|(name, values)| (name.clone(), list(values).iter().map(row).collect()))
            .collect(),
    }
}

/// A shipped network.
pub(crate) fn network(name: &str) -> meissner_engine::Network {
    let weights = Weights::shipped(name).expect("shipped weights");
    Description::shipped(name).expect("a shipped network").network(&weights).expect("the weights fit")
}

fn largest(values: &[f64]) -> usize {
    (0..values.len()).fold(0, |best, i| if values[i] > values[best] { i } else { best })
}

/// Values at the end of `events`, which are what a batch has of them.
fn logits(name: &str, sensor: Sensor, events: &[Event]) -> Vec<f32> {
    if let Some(description) = FrameDescription::shipped(name) {
        return of_frames(&description, sensor, events);
    }
    let batch = Batch::new(network(name), sensor).expect("the sensor has pixels");
    let batch = batch.with_search(Search::Proposed(meissner_reference::PROPOSE));
    let batch = batch.forward(Stream::new(events)).expect("numbers").prediction;
    match Engine::new(network(name), sensor) {
        Ok(mut engine) => {
            engine.push_slice(events);
            let incremental = engine.predict().expect("numbers").values;
            assert_eq!(bits(incremental), bits(&batch), "{name}");
        }
        Err(error) => assert!(matches!(error, EngineError::NotIncremental(_)), "{name}: {error}"),
    }
    batch
}

/// Values of a frame network over a sliding window of signed frames.
fn of_frames(description: &FrameDescription, sensor: Sensor, events: &[Event]) -> Vec<f32> {
    let weights = Weights::shipped(description.name()).expect("shipped weights");
    let parts = description.network_parts(&weights).expect("the weights fit");
    let network = FrameNetwork::new(parts, Convolution::Direct).expect("the layers fit");
    let FrameSource::Signed { timing: SignedTiming::Sliding { span_us }, rule, .. } = *description.source()
    else {
        panic!("signed frames of a sliding window")
    };
    let crop = Crop::whole(sensor);
    let window = SlidingSigned::new(sensor, crop, rule, span_us, SlidingSigned::DEFAULT_CAPACITY);
    let mut window = window.expect("a window");
    for &event in events {
        window.push(event);
    }
    let mut engine = FrameEngine::new(network).expect("an engine");
    engine.push(window.frame().values).expect("finite values");
    engine.predict().expect("numbers").values.to_vec()
}

#[test]
fn trained_networks_agree_with_pytorch_in_digit_and_logits() {
    let golden = golden();
    assert_eq!(golden.logits.len(), 2, "digits-frozen has the weights of digits-past");
    agree(&golden);
}

/// Class and logits of the engine are those of `golden`.
pub(crate) fn agree(golden: &Golden) {
    let Golden { sensor, streams, logits: expected } = golden;
    for (name, expected) in expected {
        assert_eq!(expected.len(), streams.len());
        for (i, (events, expected)) in streams.iter().zip(expected).enumerate() {
            let found: Vec<f64> = logits(name, *sensor, events).into_iter().map(f64::from).collect();
            assert_eq!(found.len(), expected.len());
            assert_eq!(largest(&found), largest(expected), "{name}, stream {i}");
            let scale = expected.iter().fold(1f64, |scale, v| scale.max(v.abs()));
            for (found, expected) in found.iter().zip(expected) {
                let difference = (found - expected).abs() / scale;
                assert!(difference <= MAX, "{name}, stream {i}: {found} against {expected}");
            }
        }
    }
}

#[test]
fn frozen_and_past_are_the_same_network_until_an_event_leaves() {
    let Golden { sensor, streams, .. } = golden();
    let (mut same, mut other) = (0, 0);
    for events in &streams {
        let length_us = events[events.len() - 1].t_us - events[0].t_us;
        let [past, frozen] = ["digits-past", "digits-frozen"].map(|name| logits(name, sensor, events));
        if length_us < network("digits-past").parts().span_us {
            assert_eq!(bits(&past), bits(&frozen));
            same += 1;
        } else {
            other += usize::from(bits(&past) != bits(&frozen));
        }
    }
    assert!(same > 0 && other > 0, "streams shorter and longer than a window");
}

#[test]
fn the_three_differ_in_nothing_but_the_graph() {
    let of = |text: &str| -> Vec<String> {
        let says = |line: &&str| {
            !["#", "name = \"digits-", "candidates = ", "lifetime = "]
                .iter()
                .any(|start| line.starts_with(start))
        };
        text.lines().filter(says).map(str::to_owned).collect()
    };
    let all = of(include_str!("../../models/networks/digits-all.toml"));
    assert!(all.len() > 60);
    assert_eq!(all, of(include_str!("../../models/networks/digits-past.toml")));
    assert_eq!(all, of(include_str!("../../models/networks/digits-frozen.toml")));
    let graphs = ["digits-all", "digits-past", "digits-frozen"].map(|name| network(name).parts().graph);
    assert!(graphs[0] != graphs[1] && graphs[1] != graphs[2] && graphs[0] != graphs[2]);
}
