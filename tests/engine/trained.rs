//! The shipped, trained networks give the values of `PyTorch`, and at any time the values of a
//! batch.
//!
//! `golden/{digits,angles,touch,force,slip}.json` hold streams or readings made by a formula, and
//! `PyTorch`'s values (`models/train/*/golden.py`). Those for force use the streams of the angles.

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_engine::representations::{Completed, Consecutive, ConsecutiveFrames, Crop, SlidingSigned};
use meissner_engine::{Batch, Engine, EngineError, Event, Network, Search, Sensor, Stream};
use meissner_io::datasets::{EventDataset, NeutouchSet, Split};
use meissner_models::description::frames::SignedTiming;
use meissner_models::systems::slip::SlipWindows;
use meissner_models::systems::touch::SENSOR;
use meissner_models::{Description, FrameDescription, FrameSource, Weights};
use meissner_tests::shared::shared;
use meissner_verify::bits;
use serde_json::Value;

/// Maximum difference, relative to the largest magnitude of a stream's values, at least 1.
const MAX: f64 = 1e-4;
/// Maximum difference in newtons, and relative to larger forces.
const MAX_FORCE: f64 = 2e-4;
/// Event graphs for angles and forces.
const ANGLE_GRAPHS: [&str; 8] = [
    "force-graph",
    "graphres",
    "tactigraph",
    "tactigraph-frozen",
    "tactigraph-past",
    "tactip",
    "tactip-past",
    "tactip-shear",
];

/// These, one that is only computed from scratch, and a baseline over frames.
const ANGLES: [&str; 9] = [
    "graphres",
    "graphres-published",
    "tactigraph",
    "tactigraph-frozen",
    "tactigraph-past",
    "tactip",
    "tactip-frames",
    "tactip-past",
    "tactip-shear",
];

const TOUCH: [&str; 3] = ["touch-containers", "touch-letters", "touch-objects"];
const FORCES: [&str; 5] = ["force-cnnlstm", "force-convlstm", "force-graph", "force-lstm", "force-tdnn"];
/// Number of readings of a window of slip.
const STEPS: usize = 5;

/// Streams of events, and the predictions of `PyTorch` at their ends.
pub(crate) struct Golden {
    pub(crate) sensor: Sensor,
    pub(crate) streams: Vec<Vec<Event>>,
    /// Values of each network for each stream.
    pub(crate) logits: Vec<(String, Vec<Vec<f64>>)>,
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

fn list(value: &Value) -> &[Value] {
    value.as_array().expect("a list")
}

fn row(row: &Value) -> Vec<f64> {
    list(row).iter().filter_map(Value::as_f64).collect()
}

fn rows(value: &Value) -> Vec<Vec<f64>> {
    list(value).iter().map(row).collect()
}

/// The content of a golden file.
fn read(text: &str) -> Golden {
    let golden = json(text);
    let event = |value: &Value| {
        let [t, x, y, on] = row(value)[..] else { panic!("an event has four columns") };
        Event::new(t as i64, x as u16, y as u16, on == 1.0)
    };
    let [width, height] = row(&golden["sensor"])[..] else { panic!("a sensor has two sides") };
    let logits = golden["logits"].as_object().expect("networks");
    Golden {
        sensor: Sensor::new(width as u16, height as u16),
        streams: list(&golden["streams"]).iter().map(|s| list(s).iter().map(event).collect()).collect(),
        logits: logits.iter().map(|(name, values)| (name.clone(), rows(values))).collect(),
    }
}

fn digits() -> Golden {
    read(include_str!("../golden/digits.json"))
}

fn angles() -> Golden {
    read(include_str!("../golden/angles.json"))
}

fn touch() -> Golden {
    read(include_str!("../golden/touch.json"))
}

/// A shipped network.
fn network(name: &str) -> Network {
    let weights = Weights::shipped(name).expect("shipped weights");
    Description::shipped(name).expect("a shipped network").network(&weights).expect("the weights fit")
}

/// An engine of a shipped frame network.
fn frame_engine(description: &FrameDescription) -> FrameEngine {
    let weights = Weights::shipped(description.name()).expect("shipped weights");
    let parts = description.network_parts(&weights).expect("the weights fit");
    let network = FrameNetwork::new(parts, Convolution::Direct).expect("the layers fit");
    FrameEngine::new(network).expect("an engine")
}

fn largest(values: &[f64]) -> usize {
    (0..values.len()).fold(0, |best, i| if values[i] > values[best] { i } else { best })
}

/// Values at the end of `events`; asserts that a batch gives the same.
fn logits(name: &str, sensor: Sensor, events: &[Event]) -> Vec<f32> {
    if let Some(description) = FrameDescription::shipped(name) {
        return of_sliding_frames(&description, sensor, events);
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
fn of_sliding_frames(description: &FrameDescription, sensor: Sensor, events: &[Event]) -> Vec<f32> {
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
    let mut engine = frame_engine(description);
    engine.push(window.frame().values).expect("finite values");
    engine.predict().expect("numbers").values.to_vec()
}

/// Asserts that class and values of `found` are the expected ones.
fn assert_values(of: &str, found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{of}");
    assert_eq!(largest(found), largest(expected), "{of}");
    let scale = expected.iter().fold(1f64, |scale, v| scale.max(v.abs()));
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() / scale <= MAX, "{of}: {found} against {expected}");
    }
}

/// Asserts that class and values of the engines are those of `golden`.
fn agree(golden: &Golden) {
    let Golden { sensor, streams, logits: expected } = golden;
    for (name, expected) in expected {
        assert_eq!(expected.len(), streams.len());
        for (i, (events, expected)) in streams.iter().zip(expected).enumerate() {
            let found: Vec<f64> = logits(name, *sensor, events).into_iter().map(f64::from).collect();
            assert_values(&format!("{name}, stream {i}"), &found, expected);
        }
    }
}

/// Asserts that incremental equals batch `later_us` after each `every`-th event of `events`, and
/// after the last.
fn equals_batch(name: &str, sensor: Sensor, events: &[Event], every: usize, later_us: &[i64]) {
    let batch = Batch::new(network(name), sensor).expect("the sensor has pixels");
    let batch = batch.with_search(Search::Proposed(meissner_reference::PROPOSE));
    let mut engine = Engine::new(network(name), sensor).expect("an engine");
    for (i, &event) in events.iter().enumerate() {
        engine.push(event);
        if i % every != 0 && i + 1 != events.len() {
            continue;
        }
        for &later_us in later_us {
            let mut engine = engine.clone();
            engine.advance(event.t_us + later_us);
            let window = Stream { now_us: event.t_us + later_us, ..Stream::new(&events[..=i]) };
            let expected = batch.forward(window).expect("numbers").prediction;
            let found = engine.predict().expect("numbers").values;
            assert_eq!(bits(found), bits(&expected), "{name}, event {i}, {later_us} us later");
        }
    }
}

#[test]
fn trained_networks_for_digits_agree_with_pytorch_in_class_and_logits() {
    let golden = digits();
    assert_eq!(golden.logits.len(), 2, "digits-frozen has the weights of digits-past");
    agree(&golden);
}

#[test]
fn trained_networks_for_angles_agree_with_pytorch_in_every_value() {
    let golden = angles();
    assert!(golden.logits.iter().map(|(name, _)| name.as_str()).eq(ANGLES));
    agree(&golden);
}

#[test]
fn trained_networks_for_touch_agree_with_pytorch_in_class_and_logits() {
    let golden = touch();
    assert!(golden.logits.iter().map(|(name, _)| name.as_str()).eq(TOUCH));
    agree(&golden);
}

#[test]
fn places_ages_and_heads_equal_batch_while_events_enter_and_leave() {
    let Golden { sensor, streams, .. } = angles();
    for name in ANGLE_GRAPHS {
        // Within a cell in time, in the next one, and after most or all of the events have left.
        equals_batch(name, sensor, &streams[1], 83, &[0, 51_000, 120_000, 230_000, 400_000]);
    }
}

#[test]
fn incremental_equals_batch_at_any_time_also_when_spikes_have_left() {
    let Golden { sensor, streams, .. } = touch();
    for (name, events) in TOUCH.iter().flat_map(|name| streams.iter().map(move |events| (name, events))) {
        equals_batch(name, sensor, events, 97, &[0, 30_000, 4_000_000]);
    }
    assert!(streams.iter().any(|events| events[events.len() - 1].t_us > 5_000_000));
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_shipped_networks_name_most_of_the_shared_test_recordings() {
    for (name, set, least) in [(TOUCH[0], NeutouchSet::Containers, 10), (TOUCH[2], NeutouchSet::Objects, 13)]
    {
        let found = EventDataset::neutouch(shared("data/neutouch"), set).expect("the data set");
        let test = found.recordings.iter().filter(|recording| recording.split == Split::Test);
        let mut engine = Engine::new(network(name), SENSOR).expect("an engine");
        let mut answers_right = |events: &[Event], class: usize| {
            engine.reset();
            engine.push_slice(events);
            let values = engine.predict().expect("numbers").values;
            (0..values.len()).all(|other| values[other] <= values[class])
        };
        let chosen: Vec<_> = test.step_by(set.classes() / 5).take(15).collect();
        let right =
            chosen.iter().filter(|recording| answers_right(&recording.events, recording.class)).count();
        assert!(right >= least, "{name}: {right} of {}", chosen.len());
    }
}

#[test]
fn frozen_and_past_are_the_same_network_until_an_event_leaves() {
    let Golden { sensor, streams, .. } = digits();
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

/// Forces at the end of each frame, including the open one.
fn forces(description: &FrameDescription, sensor: Sensor, events: &[Event]) -> Vec<f64> {
    let mut engine = frame_engine(description);
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
fn trained_networks_for_force_agree_with_pytorch_in_every_force() {
    let Golden { sensor, streams, .. } = angles();
    let golden = json(include_str!("../golden/force.json"));
    let golden = golden["forces"].as_object().expect("networks");
    let mut names: Vec<&str> = golden.keys().map(String::as_str).collect();
    names.sort_unstable();
    assert_eq!(names, FORCES);
    for (name, expected) in golden {
        for (events, expected) in streams.iter().zip(rows(expected)) {
            let found = if let Some(description) = FrameDescription::shipped(name) {
                forces(&description, sensor, events)
            } else {
                let mut engine = Engine::new(network(name), sensor).expect("an engine");
                engine.push_slice(events);
                engine.predict().expect("numbers").values.iter().copied().map(f64::from).collect()
            };
            assert_eq!(found.len(), expected.len(), "{name}");
            let close = |(a, b): (&f64, &f64)| (a - b).abs() < MAX_FORCE * b.abs().max(1.0);
            assert!(found.iter().zip(&expected).all(close), "{name}: {found:?}, {expected:?}");
        }
    }
}

/// The logits of every window of `readings`.
fn slips(network: &str, readings: &[[f32; 24]]) -> Vec<Vec<f64>> {
    let description = FrameDescription::shipped(network).expect("a shipped network");
    let mut engine = frame_engine(&description);
    let mut windows = SlipWindows::new(&description).expect("over readings");
    let mut frames = Vec::new();
    windows.cut(readings, &mut frames).expect("finite readings");
    let window = frames.chunks_exact(STEPS * windows.frame_len()).map(|window| {
        engine.reset();
        for frame in window.chunks_exact(windows.frame_len()) {
            engine.push(frame).expect("a frame");
        }
        engine.predict().expect("a prediction").values.iter().copied().map(f64::from).collect()
    });
    window.collect()
}

#[test]
fn trained_networks_for_slip_agree_with_pytorch_in_class_and_logits() {
    let golden = json(include_str!("../golden/slip.json"));
    let reading = |row: Vec<f64>| std::array::from_fn(|i| row[i] as f32);
    let readings: Vec<[f32; 24]> = rows(&golden["readings"]).into_iter().map(reading).collect();
    let networks = golden["logits"].as_object().expect("networks");
    let shipped = FrameDescription::shipped_names().iter().filter(|name| name.starts_with("slip-"));
    assert_eq!(networks.len(), shipped.count(), "every shipped network is in the golden file");
    for (network, expected) in networks {
        let (expected, found) = (rows(expected), slips(network, &readings));
        assert_eq!([found.len(), expected.len()], [readings.len() / STEPS; 2]);
        for (window, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_values(&format!("{network}, window {window}"), found, expected);
        }
    }
}
