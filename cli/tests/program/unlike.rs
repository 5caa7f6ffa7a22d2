//! Weights of frame networks with statistics of their training, and the resulting predictions.

use std::path::Path;

use serde_json::Value;

use crate::data::slip::{SlipFolder, drawn, training};
use crate::exit_status::fails;
use crate::frames_electrodes::{csv, header, reading, row};
use crate::support::{
    argument, lines, meissner, meissner_reading, message, picture_network, text, words, written,
};

/// Runs `prepare windows` over `data`; returns its messages.
fn prepare(data: &Path, network: &str, weights: Option<&Path>, out: &Path) -> String {
    let prepare = ["prepare", "windows", argument(data), "--network", network, "--out", argument(out)];
    let weights = weights.map(|weights| ["--weights", argument(weights)]);
    let output = meissner(&[&prepare[..], weights.as_ref().map_or(&[], |weights| &weights[..])].concat());
    assert!(output.status.success(), "{}", message(&output));
    text(&output)
}

/// Evaluates as text, which fits a terminal and has the table, and returns the report.
fn judged(folder: &Path, arguments: &[&str]) -> Value {
    let json = folder.join("report.json");
    let output = meissner(&[&["eval"], arguments, &["--out", argument(&json)]].concat());
    assert!(output.status.success(), "{}", message(&output));
    assert!(
        words(&output).contains("input unlike the training of all (%) of bad ones (%)"),
        "{}",
        text(&output)
    );
    written(&json)
}

fn counts(doubts: &Value) -> [u64; 4] {
    ["predictions", "unlike", "bad", "bad_unlike"].map(|key| doubts[key].as_u64().expect(key))
}

/// Asserts that the lines of a table fit a terminal, and that some have the mark.
fn marks(said: &str) {
    assert!(said.lines().all(|line| line.chars().count() <= 80), "{said}");
    assert!(said.contains(" unlike ") && said.contains(" *"), "{said}");
    assert!(said.contains("predictions are of frames unlike those of the training"), "{said}");
}

#[test]
fn counts_of_grasps_say_that_a_hot_pixel_is_none_of_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let [grasps, known, hot] =
        ["grasps.safetensors", "known.safetensors", "hot.csv"].map(|name| folder.path().join(name));
    let simulate = ["simulate", "grasp", "--recordings", "3", "--seed", "6", "--out", argument(&grasps)];
    assert!(meissner(&simulate).status.success());
    let said = prepare(&grasps, "force-tdnn", None, &known);
    assert!(said.contains("what 123 frames were like"), "{said}");
    let own = ["force", argument(&grasps), "--network", "force-tdnn", "--weights", argument(&known)];
    let report = judged(folder.path(), &own);
    let [predictions, unlike, bad, both] = counts(&report["networks"][0]["figures"]["doubts"]);
    assert_eq!(predictions, 123);
    assert!(unlike <= 1 && bad <= predictions && both <= unlike, "{report}");

    let events: Vec<String> = (0..3_000).map(|i| format!("{},57,57,{}", 60 * i, i % 2)).collect();
    std::fs::write(&hot, events.join("\n")).expect("it can be written");
    let run = ["run", argument(&hot), "--sensor", "115x115", "--network", "force-tdnn"];
    let with = |more: &[&str]| meissner(&[&run[..], more].concat());
    let (of_known, summary) = lines(&with(&["--weights", argument(&known), "--json"]));
    let (of_shipped, _) = lines(&with(&["--json"]));
    assert!(of_known.iter().all(|line| line["unlike"].as_f64() > Some(1.0)), "{of_known:?}");
    assert_eq!(summary["unlike_training"], of_known.len());
    for (known, shipped) in of_known.iter().zip(&of_shipped) {
        assert_eq!(known["value"], shipped["value"], "the values stay");
        assert!(shipped["unlike"].as_f64() > Some(1.0), "{shipped}");
    }
    marks(&text(&with(&[])));
}

#[test]
fn readings_say_that_an_electrode_is_stuck() {
    let (data, folder) = (SlipFolder::new(), tempfile::tempdir().expect("a folder"));
    let known = folder.path().join("known.safetensors");
    // The shipped weights were trained on Basic, and the folder has few of its recordings.
    let few =
        ["prepare", "windows", argument(data.path()), "--network", "slip-lstm", "--out", argument(&known)];
    fails(&meissner(&few), 2, &["expected at least 50 frames, found 21 frames"]);
    for network in ["slip-lstm", "slip-tuned"] {
        let metadata = [("network", network), ("seed", "3")];
        let own = training(folder.path(), "own.safetensors", &drawn(network, 3), &metadata);
        let said = prepare(data.path(), network, Some(&own), &known);
        assert!(said.contains("what 56 frames were like"), "{said}");
        std::fs::remove_file(&own).expect("it is there");
        let run = |input: &str| {
            lines(&meissner_reading(
                &["run", "-", "--network", network, "--weights", argument(&known), "--json"],
                input,
            ))
        };
        let stuck = |i: usize| {
            let mut values = reading(i);
            values[7] = 4095.0;
            row(values)
        };
        let (predictions, summary) = run(&(header() + &(0..9).map(stuck).collect::<String>()));
        assert!(predictions.iter().all(|line| line["unlike"].as_f64() > Some(1.0)), "{predictions:?}");
        assert_eq!(summary["unlike_training"], 5);
        std::fs::remove_file(&known).expect("it is there");
    }
    let shipped = meissner_reading(&["run", "-", "--network", "slip-lstm"], &csv(20));
    marks(&text(&shipped));
    let report = judged(folder.path(), &["slip", argument(data.path()), "--network", "slip-lstm"]);
    let doubts = counts(&report["networks"][0]["sets"][0]["doubts"]);
    assert_eq!(doubts[0], 21, "{report}");
}

#[test]
fn pictures_say_that_one_is_black() {
    let folder = tempfile::tempdir().expect("a folder");
    let [data, known] = ["gel.safetensors", "known.safetensors"].map(|name| folder.path().join(name));
    let plan = ["simulate", "gel", "--presses", "60", "--size", "32x24", "--coarseness", "2"];
    let output = meissner(&[&plan[..], &["--seed", "3", "--out", argument(&data)]].concat());
    assert!(output.status.success(), "{}", message(&output));
    let [network, weights] = picture_network(folder.path());
    let said = prepare(&data, argument(&network), Some(&weights), &known);
    assert!(said.contains("what 60 frames were like"), "{said}");
    let own = ["--network", argument(&network), "--weights", argument(&known)];
    let report = judged(folder.path(), &[&["area", argument(&data)], &own[..]].concat());
    let [predictions, unlike, ..] = counts(&report["networks"][0]["trainings"][0]["sets"][0]["doubts"]);
    assert!(predictions == 60 && unlike <= 1, "{report}");

    let pictures = folder.path().join("pictures");
    std::fs::create_dir(&pictures).expect("it is not there");
    for (name, level) in [("a-reference-that-is-grey.ppm", 128), ("black.ppm", 0)] {
        let pixels = [level; 32 * 24 * 3];
        std::fs::write(pictures.join(name), [b"P6\n32 24\n255\n", &pixels[..]].concat()).expect("written");
    }
    let run = [&["run", argument(&pictures)], &own[..]].concat();
    let (predictions, _) = lines(&meissner(&[&run[..], &["--json"]].concat()));
    assert!(predictions[1]["unlike"].as_f64() > Some(1.0), "{predictions:?}");
    let said = text(&meissner(&run));
    assert!(said.contains(" unlike ") && said.contains(" *"), "{said}");
    assert!(said.contains("predictions are of frames unlike those of the training"), "{said}");
}
