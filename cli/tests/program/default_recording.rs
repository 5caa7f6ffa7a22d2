//! The recording that the program holds.

#[path = "../../examples/make_default_recording/scene.rs"]
mod scene;

use meissner_io::Format;

use crate::support::{default_recording, meissner, words};

#[test]
fn the_embedded_file_is_what_the_scene_makes() {
    let mut made = Vec::new();
    meissner_io::encode(Format::Evt3, Some(scene::SENSOR), &scene::press_and_release(), &mut made)
        .expect("EVT3 holds the scene");
    let kept = std::fs::read(default_recording()).expect("the repository holds the file");
    assert!(made == kept, "write the file again: see cli/assets/README.md");
    assert!(kept.len() < 150_000, "{} bytes", kept.len());
}

#[test]
fn it_presses_and_releases() {
    let events = scene::press_and_release();
    let during = |from: i64, to: i64| events.iter().filter(|e| (from..to).contains(&e.t_us)).count();
    assert!((10_000..=20_000).contains(&events.len()), "{} events", events.len());
    assert!(during(0, 60_000) < 100 && during(520_000, 600_000) < 100, "it starts and ends at rest");
    assert!(during(60_000, 180_000) > 5_000 && during(380_000, 520_000) > 5_000, "dots move out and back");
}

#[test]
fn without_arguments_it_runs_is_labelled_synthetic_and_the_weights_say_what_they_are() {
    let output = meissner(&["run"]);
    assert!(output.status.success());
    let text = words(&output);
    for expected in [
        "synthetic",
        "EVT3, 240x180 pixels",
        "network graphres on 240x180 pixels, weights drawn from a seed: predictions mean nothing",
        "weights shipped with the network",
        "roll (rad)",
        "latency (us)",
        "p99.9",
        "kept",
    ] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
}
