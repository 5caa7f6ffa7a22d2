//! Networks judged on presses: a small simulation of markers, and what the program says of it.

use meissner_models::TensorFile;

use crate::exit_status::fails;
use crate::support::{argument, file, meissner, message, text, words, written};

/// Two presses of a few markers that move outwards from 10 ms on.
fn tracks(labels: &[&str]) -> Vec<u8> {
    let mut file = TensorFile::new([].into());
    let t_us = [0, 10_000, 40_000];
    file.i64("t_us", &[6], &[t_us, t_us].concat());
    file.i64("start", &[3], &[0, 3, 6]);
    let mut positions = Vec::new();
    for press in 0..2 {
        for moved in [0.0, 0.0, 6.0 + press as f32] {
            positions.extend([[100.0 - moved, 80.0], [200.0 + moved, 150.0], [150.0, 200.0 + moved]]);
        }
    }
    file.f32("position", &[6, 3, 2], &positions.concat());
    for &label in labels {
        let values = if label == "depth" { [0.0, 0.0, 3.0] } else { [0.02; 3] };
        file.f32(label, &[6], &[values, values].concat());
    }
    file.into_bytes()
}

#[test]
fn presses_are_simulated_and_judged_with_errors_over_time_as_text_json_and_picture() {
    let (folder, tracks) = file("tracks.safetensors", tracks(&["roll", "pitch", "depth"]));
    let [events, svg, json] =
        ["events.safetensors", "angle.svg", "angle.json"].map(|name| folder.path().join(name));
    let simulate =
        ["simulate", "markers", argument(&tracks), "--sensor", "346x260", "--out", argument(&events)];
    assert!(meissner(&simulate).status.success());
    let arguments = ["eval", "angle", argument(&events), "--every", "5ms", "--svg", argument(&svg)];
    let output = meissner(&[&arguments[..], &["--out", argument(&json)]].concat());
    assert!(output.status.success(), "{}", message(&output));
    let said = words(&output);
    for expected in
        ["2 presses", "tactigraph-past, roll deg", "tactigraph-past, all angles deg", "ms since contact"]
    {
        assert!(said.contains(expected), "{expected}: {said}");
    }
    assert!(text(&output).lines().all(|line| line.chars().count() <= 80), "{}", text(&output));
    let picture = std::fs::read_to_string(&svg).expect("it was written");
    assert!(
        roxmltree::Document::parse(&picture).is_ok() && picture.contains("Mean absolute error against time")
    );

    let report = written(&json);
    assert_eq!(report["header"]["command"], "eval angle");
    assert_eq!(report["data"]["labels"], serde_json::json!(["depth", "pitch", "roll"]));
    assert_eq!(report["times_us"], serde_json::json!([0, 5_000, 10_000, 15_000, 20_000, 25_000, 30_000]));
    let network = &report["networks"][0];
    let figures = &network["figures"];
    assert_eq!((&network["network"]["name"], &figures["presses"]), (&"tactigraph-past".into(), &2.into()));
    for output in figures["outputs"].as_array().expect("a list") {
        assert_eq!(
            (&output["unit"], output["mean_absolute_at"].as_array().map(Vec::len)),
            (&"deg".into(), Some(7))
        );
        assert_eq!(output["mean_absolute_at"][6], output["mean_absolute"]);
    }
    assert!(figures["work"]["multiply_adds"].as_u64() > Some(0));
}

#[test]
fn presses_that_do_not_fit_are_refused_by_name() {
    let (folder, tracks) = file("tracks.safetensors", tracks(&["depth"]));
    let events = folder.path().join("events.safetensors");
    let simulate =
        ["simulate", "markers", argument(&tracks), "--sensor", "346x260", "--out", argument(&events)];
    assert!(meissner(&simulate).status.success());
    let judge = |more: &[&str]| meissner(&[&["eval", "angle", argument(&events)], more].concat());
    fails(&judge(&[]), 2, &["labels of the file: depth", "found tactigraph-past, which predicts roll"]);
    fails(&judge(&["--network", "slip-lstm"]), 2, &["slip-lstm, which predicts classes"]);
    fails(&judge(&["--every", "1us"]), 2, &["expected a time from 100us to 10s"]);
    let output = meissner(&["eval", "angle", argument(&tracks)]);
    fails(&output, 1, &["tracks.safetensors", "metadata sensor"]);
}
