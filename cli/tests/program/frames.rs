//! Frame networks: common behaviour, and frames of events.

use std::path::{Path, PathBuf};

use meissner_engine::Event;
use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_models::{FrameDescription, Weights, draw};
use tempfile::TempDir;

use crate::exit_status::fails;
use crate::support::{argument, bits, file, keys, lines, meissner, meissner_reading, text};

/// A description in a file with drawn weights beside it.
pub(crate) struct OwnNetwork {
    folder: TempDir,
    description: FrameDescription,
    weights: Weights,
}

impl OwnNetwork {
    pub(crate) fn new(description: &str) -> Self {
        let (folder, path) = file("own.toml", description);
        let description = FrameDescription::load(path).expect("consistent");
        let weights = draw(&description, 7);
        let bytes = weights.to_safetensors(&std::collections::BTreeMap::new());
        std::fs::write(folder.path().join("own.safetensors"), bytes).expect("it can be written");
        Self { folder, description, weights }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The arguments that run it on `input`, before `more`.
    pub(crate) fn arguments(&self, input: &Path, more: &[&str]) -> Vec<String> {
        let (network, weights) = (self.path("own.toml"), self.path("own.safetensors"));
        let own = ["run", argument(input), "--network", argument(&network), "--weights", argument(&weights)];
        own.iter().chain(more).map(|&argument| argument.to_owned()).collect()
    }

    /// An engine of it.
    pub(crate) fn engine(&self) -> FrameEngine {
        engine(&self.description, &self.weights)
    }
}

/// An engine of the network of `description`, with all defaults.
pub(crate) fn engine(description: &FrameDescription, weights: &Weights) -> FrameEngine {
    let parts = description.network_parts(weights).expect("the weights fit");
    let network = FrameNetwork::new(parts, Convolution::Direct).expect("the parts fit");
    FrameEngine::new(network).expect("options in range")
}

/// An engine of a shipped network.
pub(crate) fn shipped_engine(name: &str) -> FrameEngine {
    let description = FrameDescription::shipped(name).expect("it is shipped");
    engine(&description, &Weights::shipped(name).expect("with weights"))
}

/// Bits of an engine's prediction.
pub(crate) fn predicted(engine: &mut FrameEngine) -> Vec<u32> {
    engine.predict().expect("a prediction").values.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn an_option_that_does_not_fit_the_network_is_refused_by_name() {
    let event_graph = ["--no-skip", "--convolution=direct", "--overlay=o", "--hold=3"];
    let event_frames = [
        "--mode=batch",
        "--span=5us",
        "--capacity=5",
        "--overlay=o",
        "--reference=r.png",
        "--sampling=2",
        "--neighbours=3",
        "--activity-filter=5us",
        "--stale-time=5us",
    ];
    let electrodes = [
        "--mode=batch",
        "--span=5us",
        "--every=end",
        "--late=clamp",
        "--sensor=3x3",
        "--longest-silence=4",
        "--rate-limit=9",
    ];
    let pictures = [
        "--mode=batch",
        "--capacity=5",
        "--every=event",
        "--sensor=3x3",
        "--least-probability=1",
        "--refractory=5us",
        "--stride=2",
    ];
    for (network, options) in [
        ("graphres", &event_graph[..]),
        ("force-lstm", &event_frames),
        ("slip-lstm", &electrodes),
        ("canf-plain", &pictures),
    ] {
        for option in options {
            let name = option.split('=').next().expect("an option has a name");
            let output = meissner(&["run", "no/such/input", "--network", network, option]);
            fails(&output, 2, &[name, network, " is for a network over "]);
        }
    }
}

#[test]
fn options_of_frame_networks_that_make_no_sense_are_bad_usage() {
    for options in [
        &["--tolerance", "-1"][..],
        &["--tolerance", "NaN"],
        &["--tolerance", "0", "--no-skip"],
        &["--convolution", "winograd3"],
        &["--threads", "3"],
        &["--longest-silence", "-1"],
        &["--full-scale", "1"],
    ] {
        let arguments = [&["run", "x", "--network", "canf"], options].concat();
        fails(&meissner(&arguments), 2, &["error: "]);
    }
}

#[test]
fn a_network_without_its_input_says_what_it_needs() {
    fails(&meissner(&["run", "--network", "slip-lstm"]), 2, &["slip-lstm", "24 electrodes", "no INPUT"]);
    fails(&meissner(&["run", "--network", "canf"]), 2, &["canf", "a picture", "no INPUT"]);
    fails(&meissner(&["run", "-", "--network", "canf"]), 2, &["canf", "standard input"]);
}

#[test]
fn the_help_has_an_example_for_each_kind_of_network() {
    let help = text(&meissner(&["run", "--help"]));
    for network in ["event-frame-cnn", "force-lstm", "slip-regularised", "slip-lstm --hold", "canf --overlay"]
    {
        assert!(help.contains(&format!("--network {network}")), "{network}: {help}");
    }
}

/// Windows of the force networks.
const PERIOD_US: i64 = 10_000;
const SIDE: usize = 115;

/// Events on 120 x 120 pixels: bursts, and a gap of some windows; a few outside the middle 115 x
/// 115.
fn events() -> Vec<Event> {
    let mut events = Vec::new();
    for i in 0..600_i64 {
        let t_us = 777 + i * 150 + 70_000 * (i / 250);
        events.push(Event::new(t_us, (i * 37 % 120) as u16, (i * 11 % 120) as u16, i % 3 == 0));
    }
    events
}

fn csv(events: &[Event]) -> String {
    let lines = events.iter().map(|e| format!("{},{},{},{}\n", e.t_us, e.x, e.y, u8::from(e.on)));
    lines.collect::<Vec<_>>().concat()
}

/// The frames of counts over consecutive windows, one by one from their definition.
fn frames(events: &[Event]) -> Vec<Vec<f32>> {
    let epoch = events[0].t_us;
    let windows = (events[events.len() - 1].t_us - epoch) / PERIOD_US + 1;
    let mut frames = vec![vec![0.0; 2 * SIDE * SIDE]; windows as usize];
    for event in events {
        // The middle 115 of 120 begins at pixel 2.
        let place = |v: u16| usize::from(v).checked_sub(2).filter(|&v| v < SIDE);
        if let (Some(x), Some(y)) = (place(event.x), place(event.y)) {
            let frame = &mut frames[((event.t_us - epoch) / PERIOD_US) as usize];
            frame[(usize::from(event.on) * SIDE + y) * SIDE + x] += 1.0;
        }
    }
    frames.iter().map(|frame| frame.iter().map(|count| count / 8.0).collect()).collect()
}

fn push(engine: &mut FrameEngine, frame: &[f32]) -> Vec<u32> {
    engine.push(frame).expect("a frame that fits");
    predicted(engine)
}

#[test]
fn a_stream_of_events_gives_the_predictions_of_the_engine_on_its_frames() {
    let (events, frames) = (events(), frames(&events()));
    assert!(frames.iter().any(|frame| frame.iter().all(|&v| v == 0.0)), "there is a silence");
    for network in ["force-lstm", "force-tdnn"] {
        let mut engine = shipped_engine(network);
        let expected: Vec<Vec<u32>> = frames.iter().map(|frame| push(&mut engine, frame)).collect();
        let arguments = ["run", "-", "--sensor", "120x120", "--network", network, "--json"];
        for more in [&[][..], &["--no-skip"], &["--threads", "2"], &["--tolerance", "0"]] {
            let (predictions, summary) =
                lines(&meissner_reading(&[&arguments, more].concat(), &csv(&events)));
            let found: Vec<Vec<u32>> = predictions.iter().map(bits).collect();
            assert_eq!(found, expected, "{network} {more:?}");
            assert_eq!(summary["frames"], frames.len());
            for (i, line) in predictions.iter().enumerate() {
                assert_eq!(line["t_us"], 777 + PERIOD_US * (i as i64 + 1));
                assert_eq!(line["frames"], i + 1);
            }
        }
    }
}

#[test]
fn a_line_and_the_summary_have_the_documented_keys() {
    let (_folder, path) = file("events.csv", csv(&events()));
    let arguments = ["run", argument(&path), "--sensor", "120x120", "--network", "force-lstm", "--json"];
    let (predictions, summary) = lines(&meissner(&arguments));
    assert_eq!(keys(&predictions[0]), "events frames t_us unlike update_us value");
    assert!(predictions.iter().all(|line| line["update_us"].as_f64() > Some(0.0)));
    let expected = "accepted clamped dropped empty_frames empty_frames_left_out events evicted frames frames_per_s latency_us \
                    layers lines_refused outside_crop outside_training pixels predictions real_time resets restarts unlike_training warnings";
    assert_eq!(keys(&summary), expected);
    let input = &summary;
    assert_eq!(keys(&summary["latency_us"]), "predict prepare push");
    assert_eq!((&input["events"], &input["accepted"]), (&600.into(), &600.into()));
    let shown: u64 = predictions.iter().filter_map(|line| line["events"].as_u64()).sum();
    assert_eq!(input["outside_crop"].as_u64(), Some(600 - shown));
    let empty = predictions.iter().filter(|line| line["events"] == 0).count();
    assert!(empty > 0);
    assert_eq!(input["empty_frames"], empty);
    let layers = summary["layers"].as_array().expect("a list of layers");
    let sum = |count: &str| layers.iter().filter_map(|layer| layer[count].as_u64()).sum::<u64>();
    for count in ["computed", "skipped", "absorbed"] {
        assert_eq!(summary["pixels"][count], sum(count));
    }
}

#[test]
fn people_see_the_weights_and_a_table_of_pixels() {
    let (_folder, path) = file("events.csv", csv(&events()));
    let output = meissner(&["run", argument(&path), "--sensor", "120x120", "--network", "force-lstm"]);
    let text = text(&output);
    for expected in [
        "trained on grasps of simulated bolts",
        "force (N)",
        "layer (pixels)",
        "absorbed",
        "lstm1",
        "predict",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
}

#[test]
fn predictions_follow_every_frame_some_frames_or_the_last() {
    let (_folder, path) = file("events.csv", csv(&events()));
    let run = |every: &[&str]| {
        let arguments = ["run", argument(&path), "--sensor", "120x120", "--network", "force-lstm", "--json"];
        lines(&meissner(&[&arguments, every].concat())).0.iter().map(bits).collect::<Vec<_>>()
    };
    let all = run(&[]);
    assert_eq!(run(&["--every", "10000us"]), all);
    let thirds: Vec<Vec<u32>> = all.chunks_exact(3).map(|three| three[2].clone()).collect();
    assert_eq!(run(&["--every", "30000us"]), thirds);
    assert_eq!(run(&["--every", "end"]), all[all.len() - 1..]);
    for every in ["15000us", "event", "7"] {
        let arguments =
            ["run", argument(&path), "--sensor", "120x120", "--network", "force-lstm", "--every", every];
        fails(&meissner(&arguments), 2, &["--every", "10ms", "force-lstm"]);
    }
}

#[test]
fn after_the_longest_silence_the_state_is_that_before_the_first_frame() {
    let mut events = events();
    events.truncate(100);
    let gap_us = 40 * PERIOD_US;
    let again: Vec<Event> = events.iter().map(|e| Event { t_us: e.t_us + gap_us, ..*e }).collect();
    let both = csv(&[events.clone(), again].concat());
    let run = |silence: &str| {
        let arguments = ["run", "-", "--sensor", "120x120", "--network", "force-lstm", "--json"];
        lines(&meissner_reading(&[&arguments[..], &["--longest-silence", silence]].concat(), &both))
    };
    let (short, summary) = run("3");
    let frames = events.len() * 150 / PERIOD_US as usize + 1;
    assert_eq!(short.len(), 2 * frames + 3);
    let values: Vec<Vec<u32>> = short.iter().map(bits).collect();
    assert_eq!(values[..frames], values[frames + 3..], "the second press begins like the first");
    let input = &summary;
    assert_eq!((&input["empty_frames"], &input["resets"]), (&3.into(), &1.into()));
    assert_eq!(input["empty_frames_left_out"], 40 - frames - 3);
    let (long, summary) = run("1000");
    assert_eq!(long.len(), 40 + frames);
    assert_eq!(summary["resets"], 0);
    assert_ne!(bits(&long[40]), values[0], "the state has not forgotten");
}

#[test]
fn a_sliding_window_is_read_whenever_a_prediction_is_due() {
    let network = OwnNetwork::new(SLIDING);
    let events: Vec<Event> = (0..90_i64)
        .map(|i| Event::new(i * 130 + 5000 * (i / 40), (i * 5 % 8) as u16, (i * 3 % 6) as u16, i % 3 > 0))
        .collect();
    let (_folder, path) = file("events.csv", csv(&events));
    // The frame over the last 1500 us at `t_us`, from its definition.
    let frame = |t_us: i64, taken: &[Event]| {
        let mut frame = vec![0.0; 5 * 6];
        for event in taken.iter().filter(|e| e.t_us <= t_us && t_us - e.t_us <= 1500) {
            let (x, y) = (usize::from(event.x).checked_sub(1), usize::from(event.y).checked_sub(1));
            if let (Some(x), Some(y)) = (x.filter(|&x| x < 6), y.filter(|&y| y < 5)) {
                frame[y * 6 + x] += if event.on { 1.0 } else { -1.0 };
            }
        }
        frame
    };
    let run = |every: &str| {
        let more = ["--sensor", "8x6", "--every", every, "--json"];
        lines(&meissner(&network.arguments(&path, &more))).0
    };
    let mut engine = network.engine();
    for line in run("1000us") {
        let t_us = line["t_us"].as_i64().expect("a time");
        assert_eq!(t_us % 1000, 0);
        assert_eq!(bits(&line), push(&mut engine, &frame(t_us, &events)), "at {t_us}");
    }
    let after_events = run("4");
    assert_eq!(after_events.len(), 22);
    for (i, line) in after_events.iter().enumerate() {
        let taken = &events[..4 * (i + 1)];
        let t_us = taken[taken.len() - 1].t_us;
        assert_eq!(line["t_us"], t_us);
        assert_eq!(bits(line), push(&mut engine, &frame(t_us, taken)));
    }
    assert_eq!(run("end").len(), 1);
}

#[test]
fn a_sensor_smaller_than_the_frame_is_named_with_it() {
    let output = meissner_reading(&["run", "-", "--sensor", "100x120", "--network", "force-lstm"], "");
    fails(&output, 1, &["force-lstm", "100x120", "115x115"]);
}

/// 6 x 5 pixels of 8 x 6.
const SLIDING: &str = r#"
[network]
name = "own"

[input]
kind = "image"
channels = 1
height = 5
width = 6
frames = "signed"
span_us = 1500
crop = [1, 1]

[[layer]]
name = "conv"
kind = "conv"
channels = 4
kernel = 3
activation = "relu"

[[layer]]
name = "flat"
kind = "flatten"

[[layer]]
name = "fc"
kind = "dense"
outputs = 2

[output]
names = ["roll", "pitch"]
unit = "rad"
"#;
