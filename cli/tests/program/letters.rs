//! Letters of braille: prepared, judged since contact, measured, and fitted from the prepared file.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use meissner_engine::Engine;
use meissner_io::datasets::{EventDataset, EventRecording, Split};
use meissner_models::systems::letters::{CLASSES, SENSOR};
use meissner_models::{Description, Weights};
use safetensors::SafeTensors;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::data::{NUMBERS, letters_archive, letters_network};
use crate::exit_status::fails;
use crate::support::{argument, meissner, message, object, text, words};

/// Presses of all letters: the last one of each is for the test.
const PRESSES: usize = CLASSES.len() * NUMBERS;

/// A folder with presses, and a network with drawn weights that predicts letters.
struct Letters {
    folder: TempDir,
    network: PathBuf,
    weights: PathBuf,
}

impl Letters {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("there is a place for temporary files");
        std::fs::write(folder.path().join("letters.npz"), letters_archive()).expect("it is written");
        let [network, weights] = letters_network(folder.path());
        Self { folder, network, weights }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    fn run(&self, command: &str, own: [&Path; 2], more: &[&str]) -> std::process::Output {
        let [network, weights] = own.map(argument);
        let given =
            [command, "touch", "letters", argument(self.path()), "--network", network, "--weights", weights];
        meissner(&[&given[..], more].concat())
    }

    fn eval(&self, more: &[&str]) -> std::process::Output {
        self.run("eval", [&self.network, &self.weights], more)
    }

    fn prepare(&self, out: &Path) -> std::process::Output {
        let of = ["prepare", "touch", "letters", argument(self.path()), "--out", argument(out)];
        meissner(&of)
    }
}

/// The classes that an engine predicts for a press every `every_us` since contact, and at its end.
fn answers(engine: &mut Engine, press: &EventRecording, every_us: i64) -> Vec<usize> {
    let mut answers = Vec::new();
    let begin = press.contact.expect("a contact").begin_us;
    let end = press.events.last().expect("an event").t_us;
    for due in (1..).map(|i| begin + i * every_us).take_while(|due| *due < end).chain([end]) {
        engine.reset();
        let until = press.events.partition_point(|event| event.t_us <= due);
        engine.push_slice(&press.events[..until]);
        engine.advance(due);
        let values = engine.predict().expect("numbers").values;
        let best = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        answers.push(values.iter().position(|value| *value == best).expect("one is the best"));
    }
    answers
}

#[test]
fn accuracies_are_those_of_an_engine_since_contact() {
    let data = Letters::new();
    let report = object(&data.eval(&["--every", "50ms", "--json"]));
    assert_eq!(report["header"]["command"], "eval touch letters");
    assert_eq!((&report["since"], &report["classes"][0]), (&json!("contact"), &json!("A")));
    assert_eq!(report["data"]["test"], CLASSES.len());
    let description = Description::load(&data.network).expect("a description");
    let weights = Weights::from_bytes(&std::fs::read(&data.weights).expect("weights")).expect("weights");
    let network = Arc::new(description.network(&weights).expect("a network"));
    let mut engine = Engine::new(network, SENSOR).expect("an engine");
    let set = EventDataset::letters(data.path(), &CLASSES).expect("presses");
    let test: Vec<_> = set.recordings.iter().filter(|press| press.split == Split::Test).collect();
    let said: Vec<_> = test.iter().map(|press| (press.class, answers(&mut engine, press, 50_000))).collect();
    let judged = &report["networks"][0]["test"];
    let curve = judged["accuracy_at"].as_array().expect("a curve");
    assert_eq!(curve.len(), report["times_us"].as_array().expect("times").len());
    for (i, found) in curve.iter().enumerate() {
        let right =
            said.iter().filter(|(class, answers)| answers[i.min(answers.len() - 1)] == *class).count();
        let expected = right as f64 / test.len() as f64;
        assert_eq!(found["mean"].as_f64(), Some(expected), "{i}: {report}");
    }
    let right = said.iter().filter(|(class, answers)| answers.last() == Some(class)).count();
    assert_eq!(judged["accuracy"]["mean"].as_f64(), Some(right as f64 / test.len() as f64));
    // From contact to the last event, not from the first one.
    let last =
        test.iter().filter_map(|press| Some(press.events.last()?.t_us - press.contact?.begin_us)).max();
    let times = (last.expect("a press") + 49_999) / 50_000;
    assert_eq!(curve.len() as i64, times);
}

#[test]
fn the_text_and_the_drawing_count_from_contact() {
    let data = Letters::new();
    let svg = data.path().join("out.svg");
    let output = data.eval(&["--every", "100ms", "--svg", argument(&svg)]);
    assert!(output.status.success(), "{}", message(&output));
    for part in ["every 100 ms since contact", "own, test split", "27 test", "accuracy (%) after (ms)"] {
        assert!(words(&output).contains(part), "{part}: {}", text(&output));
    }
    let drawn = std::fs::read_to_string(&svg).expect("a drawing");
    assert!(drawn.contains("time since contact (ms)") && drawn.contains("Letters of braille"), "{drawn}");
    let measured =
        data.run("pareto", [&data.network, &data.weights], &["--only", "exact", "--repeat", "1", "--json"]);
    assert_eq!(object(&measured)["system"], "touch letters");
}

#[test]
fn a_network_is_fitted_to_the_prepared_file_without_its_test() {
    let data = Letters::new();
    let [events, fitted] = ["letters.safetensors", "fitted"].map(|name| data.path().join(name));
    let output = data.prepare(&events);
    assert!(words(&output).contains("108 recordings, 81 for training, in 10 folds"), "{}", text(&output));
    let bytes = std::fs::read(&events).expect("it was written");
    let file = SafeTensors::deserialize(&bytes).expect("a valid file");
    assert_eq!(file.tensor("stamps_us").expect("stamps").shape(), [PRESSES, 3]);
    assert_eq!(file.tensor("label").expect("labels").shape(), [PRESSES]);

    let fit = |more: &[&str]| {
        let [network, weights] = [&data.network, &data.weights].map(|path| argument(path));
        let given = ["fit", network, argument(&events), "--weights", weights, "--out", argument(&fitted)];
        meissner(&[&given[..], &["--folds", "3", "--ages", "0", "--name", "letters"], more].concat())
    };
    let report: Value = object(&fit(&["--json"]));
    assert_eq!(report["data"]["presses"], CLASSES.len() * (NUMBERS - 1));
    assert_eq!(report["classes"], json!(CLASSES));
    let notes = report["data"]["notes"].to_string();
    assert!(notes.contains("27 presses of the split test are left out"), "{notes}");
    let own = ["letters.toml", "letters.safetensors"].map(|name| fitted.join(name));
    let judged = object(&data.run("eval", own.each_ref().map(PathBuf::as_path), &["--json"]));
    let accuracy = judged["networks"][0]["test"]["accuracy"]["mean"].as_f64().expect("a share");
    assert!(accuracy > 0.9, "letters differ by their taxel: {judged}");

    // A file already contains its labels.
    let more = |more: &[&str]| meissner(&[&["prepare", "presses", argument(&events)], more].concat());
    assert!(words(&more(&[])).contains("81 with labels"), "{}", text(&more(&[])));
    fails(
        &more(&["--labels", "labels.csv"]),
        2,
        &["--labels", "a folder of recordings", "letters.safetensors"],
    );
    fails(&more(&["--offset", "1s"]), 2, &["--offset", "a folder of recordings"]);
    fails(&more(&["--sensor", "10x8"]), 2, &["FOLDER", "options about recordings"]);
}

#[test]
fn what_is_no_set_of_letters_is_refused_with_its_place() {
    let data = Letters::new();
    let path = data.path().join("letters.npz");
    let whole = std::fs::read(&path).expect("presses");
    std::fs::write(&path, &whole[..whole.len() / 2]).expect("it is written");
    fails(&data.eval(&[]), 1, &["letters.npz", "archive at byte"]);
    std::fs::remove_file(&path).expect("it is there");
    fails(&data.eval(&[]), 1, &["letters.npz"]);
    fails(&data.prepare(&data.path().join("out")), 1, &["letters.npz"]);
    assert!(!data.path().join("out").exists());
    let other = ["eval", "touch", "letters", argument(data.path()), "--network", "touch-objects"];
    fails(&meissner(&other), 1, &["touch-objects", "expected the outputs A, B, C"]);
}
