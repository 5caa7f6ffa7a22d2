//! `fit`: from presses with labels to a network that runs.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use meissner_engine::{Engine, Event, Sensor};
use meissner_io::Format;
use meissner_models::{Description, Weights};
use serde_json::Value;
use tempfile::TempDir;

use crate::exit_status::fails;
use crate::support::{argument, bits, lines, meissner, message, object, text, words};

const SENSOR: Sensor = Sensor { width: 48, height: 36 };
const PRESSES: i64 = 12;

/// Events that move from the left to a position that is the label.
fn press(i: i64) -> (f64, Vec<Event>) {
    let to = 10.0 + 3.0 * i as f64;
    let event = |k: i64| {
        let x = to * k as f64 / 149.0 + ((k * 7 + i) % 5) as f64;
        Event::new(k * 400, (x as u16).min(47), ((k * 11) % 9 + 12) as u16, k % 2 == 0)
    };
    (to, (0..150).map(event).collect())
}

fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let mut labels = "recording,x_mm,side\n".to_owned();
    for i in 0..PRESSES {
        let (to, events) = press(i);
        let path = folder.path().join(format!("press{i}.es"));
        meissner_io::write(&path, Format::Es, Some(SENSOR), &events).expect("it can be written");
        writeln!(labels, "press{i},{to},{}", ["near", "far"][usize::from(i >= PRESSES / 2)]).expect("text");
    }
    fs::write(folder.path().join("labels.csv"), labels).expect("it can be written");
    folder
}

/// Fits to `presses` with these further arguments.
fn fit(presses: &Path, out: &Path, more: &[&str]) -> std::process::Output {
    let given = ["fit", "tactigraph-past", argument(presses), "--out", argument(out)];
    let folds = if more.contains(&"--folds") { &[][..] } else { &["--folds", "3"] };
    meissner(&[&given[..], folds, more].concat())
}

#[test]
fn a_fitted_network_runs_with_the_bits_of_an_engine() {
    let (presses, place) = (folder(), tempfile::tempdir().expect("a place"));
    let out = place.path().join("mine");
    let report = object(&fit(presses.path(), &out, &["--json"]));
    assert_eq!(report["header"]["command"], "fit");
    let x = &report["outputs"][0];
    assert_eq!((&x["name"], &x["unit"], &x["in_events"]), (&"x".into(), &"mm".into(), &true.into()));
    assert!(x["error"]["mean"].as_f64() < x["constant"]["mean"].as_f64(), "{x}");
    assert_eq!(report["pairs"][0].as_array().map(Vec::len), Some(12), "{}", report["pairs"]);
    let files: Vec<&str> =
        report["files"].as_array().expect("files").iter().filter_map(Value::as_str).collect();
    let of = |end: &str| files.iter().copied().find(|file| file.ends_with(end)).expect(end);
    let (description, weights) = (of("mine.toml"), of("mine.safetensors"));
    assert!(
        fs::read_to_string(of("mine.md"))
            .expect("a card")
            .contains("meissner run RECORDING --network mine.toml")
    );
    assert!(fs::read_to_string(of("mine.svg")).expect("a picture").starts_with("<svg"));

    let recording = presses.path().join("press4.es");
    let ran = meissner(&[
        "run",
        argument(&recording),
        "--network",
        description,
        "--weights",
        weights,
        "--every",
        "end",
        "--json",
    ]);
    let (predictions, summary) = lines(&ran);
    let network = Description::load(description).expect("a description");
    let network = network.network(&Weights::load(weights).expect("weights")).expect("they fit");
    let mut engine = Engine::new(network, SENSOR).expect("an engine");
    engine.push_slice(&press(4).1);
    let values = engine.predict().expect("numbers").values.to_vec();
    let last = predictions.last().expect("a prediction");
    assert_eq!(bits(last), values.iter().map(|value| value.to_bits()).collect::<Vec<_>>());
    assert!((f64::from(values[0]) - press(4).0).abs() < 3.0, "{values:?}");
    assert_eq!(summary["outside_training"], 0, "{summary}");
    // Twelve windows are too few for statistics; the layers know none of them.
    assert_eq!(summary["unlike_training"], Value::Null, "{summary}");
    let notes = report["sensor"]["notes"].to_string();
    assert!(notes.contains("windows are unlike those that the layers were trained on"), "{notes}");

    // The card is read, and no file is replaced silently.
    let about = meissner(&["run", argument(&recording), "--network", description, "--weights", weights]);
    assert!(words(&about).contains("head fitted to 12 presses of"), "{}", text(&about));
    fails(&fit(presses.path(), &out, &[]), 2, &["no such file", "--force replaces it"]);
    let again = fit(presses.path(), &out, &["--force", "--threads", "1"]);
    assert!(again.status.success(), "{}", message(&again));
    let said = words(&again);
    for part in ["12 presses", "48x36, the training's 346x260", "x mm", "mine.safetensors", "x: "] {
        assert!(said.contains(part), "{part}: {}", text(&again));
    }
}

#[test]
fn classes_are_fitted_where_they_are_asked_for() {
    let (presses, place) = (folder(), tempfile::tempdir().expect("a place"));
    let more = ["--outputs", "side", "--name", "sides", "--json", "--ages", "1", "--shift", "2"];
    let report = object(&fit(presses.path(), &place.path().join("mine"), &more));
    assert_eq!(report["classes"], serde_json::json!(["far", "near"]));
    assert_eq!(report["outputs"][0]["unit"], "share");
    assert!(place.path().join("mine/sides.toml").exists());
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let (presses, place) = (folder(), tempfile::tempdir().expect("a place"));
    let out = place.path().join("mine");
    let path = presses.path();
    fails(&fit(path, &out, &["--folds", "7"]), 2, &["at least 14 presses with labels", "found 12"]);
    fails(&fit(path, &out, &["--outputs", "force"]), 2, &["--outputs", "expected x, side, found force"]);
    let frames = ["fit", "canf", argument(path), "--out", argument(&out)];
    fails(&meissner(&frames), 1, &["canf", "network over events"]);
    assert!(fs::read_dir(&out).is_ok_and(|mut files| files.next().is_none()), "nothing is written");
}
