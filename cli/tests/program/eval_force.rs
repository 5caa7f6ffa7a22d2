//! Networks judged on grasps: a few simulated recordings, and what the program says of them.

use meissner_models::{AnyDescription, Weights, draw};

use crate::exit_status::fails;
use crate::support::{argument, meissner, message, text, words, written};

const NETWORK: &str = "force-tdnn";

#[test]
fn grasps_are_simulated_and_judged_by_phase_and_size_as_text_json_and_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let [events, svg, json] =
        ["grasps.safetensors", "force.svg", "force.json"].map(|name| folder.path().join(name));
    let simulate = ["simulate", "grasp", "--recordings", "3", "--seed", "6", "--out", argument(&events)];
    let output = meissner(&simulate);
    assert!(output.status.success() && text(&output).contains("events of 3 streams"), "{}", message(&output));
    let arguments = ["eval", "force", argument(&events), "--network", NETWORK, "--svg", argument(&svg)];
    let output = meissner(&[&arguments[..], &["--out", argument(&json)]].concat());
    assert!(output.status.success(), "{}", message(&output));
    let said = words(&output);
    for expected in [
        "3 recordings",
        "force-tdnn, all 123",
        "force-tdnn, holding",
        "force-tdnn, 16 mm 41",
        "DTW",
        "the paper",
    ] {
        assert!(said.contains(expected), "{expected}: {said}");
    }
    assert!(text(&output).lines().all(|line| line.chars().count() <= 80), "{}", text(&output));
    let picture = std::fs::read_to_string(&svg).expect("it was written");
    assert!(roxmltree::Document::parse(&picture).is_ok() && picture.contains("force-tdnn, recording 2"));
    let report = written(&json);
    assert_eq!(report["header"]["command"], "eval force");
    let figures = &report["networks"][0]["figures"];
    assert_eq!(figures["parts"].as_array().map(Vec::len), Some(7));
    assert!(figures["parts"][0]["mse"]["mean"].as_f64() > Some(0.0));

    // Leave-one-out: each training has not seen the recordings that it names, and together they
    // name each one once.
    let trainings = folder.path().join("trainings");
    std::fs::create_dir(&trainings).expect("a folder");
    let description = AnyDescription::shipped(NETWORK).expect("shipped");
    let train = |file: &str, held_out: &str| {
        let remarks = [("network", NETWORK), ("seed", "0"), ("trained", "true"), ("held_out", held_out)];
        let remarks = remarks.map(|(key, value)| (key.to_owned(), value.to_owned())).into();
        let weights: Weights = draw(&description, 3);
        std::fs::write(trainings.join(file), weights.to_safetensors(&remarks)).expect("it is written");
    };
    train("a.safetensors", "[\"0\", \"2\"]");
    train("b.safetensors", "[\"1\"]");
    let arguments = ["eval", "force", argument(&events), "--trainings", argument(&trainings)];
    let output = meissner(&arguments);
    assert!(output.status.success(), "{}", message(&output));
    assert!(words(&output).contains("2 folds of cross-validations"), "{}", text(&output));
    train("b.safetensors", "[\"2\"]");
    fails(&meissner(&arguments), 1, &["hold out different recordings", "b.safetensors"]);
}

#[test]
fn a_time_between_predictions_that_does_not_divide_a_frame_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let events = folder.path().join("grasps.safetensors");
    let output = meissner(&["eval", "force", argument(&events), "--every", "3ms"]);
    fails(&output, 2, &["divides 10000 us", "3000 us"]);
}
