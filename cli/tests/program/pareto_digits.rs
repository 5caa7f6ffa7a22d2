//! Time against error over a data set of digits.

use meissner_engine::{Engine, Sensor, StaleReadout, Staleness};
use meissner_models::{Description, Weights};
use serde_json::{Value, json};

use crate::digits_data::{DigitsFolder, RECORDINGS, Runs, TEST, digits, small};
use crate::eval_digits;
use crate::pareto::{errors, is_a_front, number, report, setting, settings};
use crate::support::argument;

/// A data set, a small network, its weights.
fn measured(changes: &[(&str, &str)]) -> (DigitsFolder, Runs, Description, Weights) {
    let (data, runs) = (DigitsFolder::new(), Runs::new());
    let (_, description) = runs.network(&small("own", changes));
    let weights = runs.training("own.safetensors", &description, 5, &[]);
    (data, runs, description, weights)
}

/// Arguments that measure the network of [`measured`].
fn arguments(data: &DigitsFolder, runs: &Runs, more: &[&str]) -> Vec<String> {
    let [network, weights] = ["own.toml", "own.safetensors"].map(|file| runs.path().join(file));
    let own =
        ["digits", argument(data.path()), "--network", argument(&network), "--weights", argument(&weights)];
    let few = ["--timed-events", "200", "--repeat", "1"];
    own.iter().chain(&few).chain(more).map(|&argument| argument.to_owned()).collect()
}

fn run(data: &DigitsFolder, runs: &Runs, more: &[&str]) -> Value {
    let arguments = arguments(data, runs, more);
    report(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

/// What the exact setting says is the opposite of an accuracy.
fn is_the_rest_of(task: &Value, judged: &Value) {
    let accuracy = number(&judged["accuracy"]["mean"]);
    assert!((number(&task["error"]) - (1.0 - accuracy)).abs() < 1e-12, "{task} {judged}");
    for (bound, other) in [(0, 1), (1, 0)] {
        let (bound, other) = (number(&task["interval_95"][bound]), number(&judged["interval_95"][other]));
        assert!((bound - (1.0 - other)).abs() < 1e-12, "{task} {judged}");
    }
    assert_eq!((&task["trials"], &task["trainings"]), (&judged["recordings"], &judged["trainings"]));
}

#[test]
fn the_exact_setting_is_wrong_where_the_evaluation_says_so_and_has_no_numerical_error() {
    let (data, runs, ..) = measured(&[]);
    let report = run(&data, &runs, &["--only", "exact"]);
    assert_eq!((&report["compared"], &report["unit"]), (&"task_error".into(), &"event".into()));
    let exact = setting(&report, 0, "exact");
    assert_eq!(number(&exact["numerical"]["max"]), 0.0);
    let [network, weights] = ["own.toml", "own.safetensors"].map(|file| runs.path().join(file));
    let judged = eval_digits::report(&[
        argument(data.path()),
        "--network",
        argument(&network),
        "--weights",
        argument(&weights),
    ]);
    let task = &exact["task"][0];
    is_the_rest_of(task, &judged["networks"][0]["test"]);
    assert_eq!((&task["of"], &task["trials"]), (&"split test".into(), &(10 * TEST).into()));
    assert_eq!((&exact["error"], &exact["interval_95"]), (&task["error"], &task["interval_95"]));
}

#[test]
fn a_stale_answer_is_the_one_that_stood_at_the_end() {
    let (data, runs, description, weights) = measured(&[]);
    let report = run(&data, &runs, &["--only", "stale 10 ms"]);
    let network = std::sync::Arc::new(description.network(&weights).expect("they fit"));
    let bound = Staleness::new().with_us(10_000);
    let mut wrong = [0_u64; 2];
    for digit in digits().iter().skip(RECORDINGS - 10 * TEST) {
        let engine = Engine::new(network.clone(), Sensor::new(34, 34)).expect("it fits");
        let mut stale = StaleReadout::new(engine, bound).expect("in range");
        for &event in &digit.events {
            stale.push(event);
            stale.predict().expect("numbers");
        }
        let stood = class(stale.predict().expect("numbers").values);
        let exact = class(stale.into_engine().predict().expect("numbers").values);
        wrong[0] += u64::from(exact != digit.class);
        wrong[1] += u64::from(stood != digit.class);
    }
    for (name, wrong) in [("exact", wrong[0]), ("stale 10 ms", wrong[1])] {
        let error = number(&setting(&report, 0, name)["error"]);
        assert!((error - wrong as f64 / (10 * TEST) as f64).abs() < 1e-12, "{name}");
    }
}

fn class(values: &[f32]) -> usize {
    let most = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    values.iter().position(|&value| value == most).expect("one is the largest")
}

#[test]
fn errors_are_equal_at_any_number_of_threads() {
    let (data, runs, ..) =
        measured(&[("candidates = \"past\"\nlifetime = \"window\"", "candidates = \"all\"")]);
    let run = |threads: &str| errors(&run(&data, &runs, &["--threads", threads]));
    let one = run("1");
    assert!(one.len() > 20);
    assert!(one == run("2") && one == run("5"));
}

#[test]
fn folds_are_judged_together_on_every_recording_as_the_evaluation_does() {
    let (data, runs) = (DigitsFolder::new(), Runs::new());
    let (network, description) = runs.network(&small("own", &[]));
    let names: Vec<String> = digits().into_iter().map(|digit| digit.name).collect();
    let classes: Vec<usize> = digits().iter().map(|digit| digit.class).collect();
    let folds = meissner_evaluate::events::folds(&classes, 3).expect("enough recordings");
    for fold in 0..3 {
        let held_out: Vec<&String> =
            names.iter().zip(&folds).filter(|(_, own)| **own == fold).map(|(name, _)| name).collect();
        let held_out = json!(held_out).to_string();
        let metadata = [("held_out", held_out.as_str())];
        runs.training(
            &format!("fold{fold}.safetensors"),
            &description,
            30 + fold as u64,
            &[&[("seed", "9")], &metadata[..]].concat(),
        );
    }
    let own = [
        argument(data.path()),
        "--network",
        argument(&network),
        "--trainings",
        argument(runs.path()),
        "--folds",
        "3",
    ];
    let judged = eval_digits::report(&own);
    let few = ["--timed-events", "100", "--repeat", "1", "--only", "exact"];
    let report = report(&[&["digits"], &own[..], &few].concat());
    let task = &setting(&report, 0, "exact")["task"][0];
    is_the_rest_of(task, &judged["networks"][0]["cross_validation"]);
    assert_eq!((&task["of"], &task["trials"]), (&"cross-validation".into(), &RECORDINGS.into()));
    assert!(report["networks"][0]["weights"].as_str().is_some_and(|text| text.starts_with("3 trainings")));
}

#[test]
fn networks_over_other_graphs_stand_on_one_front() {
    let (data, runs) = (DigitsFolder::new(), Runs::new());
    let (past, description) = runs.network(&small("past", &[]));
    let (all, _) = runs
        .network(&small("all", &[("candidates = \"past\"\nlifetime = \"window\"", "candidates = \"all\"")]));
    runs.training("past.safetensors", &description, 5, &[]);
    runs.training("all.safetensors", &description, 6, &[("network", "all")]);
    let svg = runs.path().join("digits.svg");
    let report = report(&[
        "digits",
        argument(data.path()),
        "--network",
        argument(&past),
        "--network",
        argument(&all),
        "--trainings",
        argument(runs.path()),
        "--timed-events",
        "200",
        "--repeat",
        "1",
        "--svg",
        argument(&svg),
    ]);
    let both: Vec<&Value> = settings(&report, 0).iter().chain(settings(&report, 1)).collect();
    is_a_front(&both);
    let words = report["words"].as_str().expect("a paragraph");
    assert!(words.contains("past is wrong in") && words.contains("within 0.5 points"), "{words}");
    let svg = std::fs::read_to_string(svg).expect("it was written");
    let document = roxmltree::Document::parse(&svg).expect("it is well-formed XML");
    let texts: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
    assert!(
        texts.contains(&"wrong answers (%)") && texts.contains(&"split test; bars: 95 % interval"),
        "{texts:?}"
    );
    assert!(texts.contains(&"past") && texts.contains(&"all"), "{texts:?}");
}
