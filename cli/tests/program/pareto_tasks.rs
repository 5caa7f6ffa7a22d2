//! Time against error over digits, forces and pictures.

use std::path::{Path, PathBuf};

use meissner_engine::{Engine, Sensor, StaleReadout, Staleness};
use meissner_models::{Description, Weights};
use serde_json::{Value, json};

use crate::data::{DigitsFolder, RECORDINGS, Runs, TEST, digits, small};
use crate::eval_digits;
use crate::exit_status::fails;
use crate::pareto::{errors, is_a_front, number, report, setting, settings};
use crate::support::{argument, meissner, message, object, picture_network, text};

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

/// Asserts that the error of the exact setting is 1 minus the accuracy.
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

/// The file that `simulate` writes with these arguments.
fn simulated(folder: &Path, arguments: &[&str]) -> PathBuf {
    let path = folder.join("data.safetensors");
    let output = meissner(&[&["simulate"], arguments, &["--seed", "3", "--out", argument(&path)]].concat());
    assert!(output.status.success(), "{}", message(&output));
    path
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).expect("it was written")
}

/// Runs with text for people, which must fit a terminal, and returns it with the picture and the
/// comma-separated values.
fn written(folder: &Path, arguments: &[&str]) -> [String; 3] {
    let [svg, csv] = ["front.svg", "front.csv"].map(|name| folder.join(name));
    let files = ["--svg", argument(&svg), "--csv", argument(&csv)];
    let output = meissner(&[&["pareto"], arguments, &files].concat());
    assert!(output.status.success(), "{}", message(&output));
    for line in text(&output).lines() {
        let is_one_word = line.split_whitespace().any(|word| word.chars().count() > 60);
        assert!(line.chars().count() <= 80 || is_one_word, "{line}");
    }
    [text(&output), read(&svg), read(&csv)]
}

fn eval(arguments: &[&str]) -> Value {
    object(&meissner(&[&["eval"], arguments, &["--json"]].concat()))
}

#[test]
fn grasps_have_networks_of_both_kinds_on_one_front_and_the_errors_of_eval() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = simulated(folder.path(), &["grasp", "--recordings", "3"]);
    let networks = ["--network", "force-graph", "--network", "force-tdnn"];
    let few = ["--timed-events", "1", "--repeat", "1", "--only", "stride 8", "--only", "every 2nd"];
    let state = folder.path().join("state.jsonl");
    let arguments =
        [&["force", argument(&data), "--state", argument(&state)], &networks[..], &few[..]].concat();
    let found = report(&arguments);
    assert_eq!((&found["system"], &found["unit"]), (&"force".into(), &"recording".into()));
    assert_eq!((&found["compared"], &found["data"]["timed"]), (&"task_error".into(), &1.into()));
    let judged = eval(&[&["force", argument(&data)], &networks[..]].concat());
    for network in 0..2 {
        let exact = setting(&found, network, "exact");
        let part = &judged["networks"][network]["figures"]["parts"][0];
        for (i, (kind, key)) in [("squared_force", "mse"), ("absolute_force", "mae")].into_iter().enumerate()
        {
            let task = &exact["task"][i];
            assert_eq!((&task["kind"], &task["error"]), (&kind.into(), &part[key]["mean"]), "{task}");
        }
    }
    let all: Vec<&Value> = (0..2).flat_map(|network| settings(&found, network)).collect();
    assert_eq!(all.len(), 4);
    is_a_front(&all);

    // Measurements in the state are not repeated, and all forms have the unit.
    let lines = read(&state);
    let [said, picture, csv] = written(folder.path(), &arguments);
    assert_eq!((lines, errors(&found)), (read(&state), errors(&report(&arguments))));
    for expected in ["mean squared error (N^2)", "force-graph, MAE (N)", "N^2 when it is exact"] {
        assert!(
            said.split_whitespace().collect::<Vec<_>>().join(" ").contains(expected),
            "{expected}: {said}"
        );
    }
    assert!(roxmltree::Document::parse(&picture).is_ok() && picture.contains("mean squared error (N^2)"));
    assert!(csv.lines().skip(1).all(|line| line.ends_with(",N^2")), "{csv}");
}

#[test]
fn pictures_of_presses_have_the_errors_of_eval_and_one_file_is_as_good_as_several() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = ["gel", "--presses", "3", "--pictures", "3", "--size", "32x24", "--coarseness", "1"];
    let data = simulated(folder.path(), &plan);
    let [network, weights] = picture_network(folder.path());
    let network = ["--network", argument(&network), "--weights", argument(&weights)];
    let few = ["--repeat", "1", "--only", "winograd 4x4", "--only", "every 2nd"];
    let one = [&["area", argument(&data)], &network[..], &few[..]].concat();
    let found = report(&one);
    assert_eq!((&found["unit"], &found["data"]["size"]), (&"picture".into(), &9.into()));
    let judged = eval(&[&["area", argument(&data)], &network[..]].concat());
    let set = &judged["networks"][0]["trainings"][0]["sets"][0];
    let exact = setting(&found, 0, "exact");
    assert!((number(&exact["error"]) - (1.0 - number(&set["iou"]["mean"]))).abs() < 1e-15, "{exact}");
    assert_eq!(exact["task"][1]["error"], set["force_n"]["mean"]);
    is_a_front(&settings(&found, 0).iter().collect::<Vec<_>>());

    let two = [&["area", argument(&data), argument(&data)], &network[..], &few[..]].concat();
    let both = report(&two);
    assert!((number(&setting(&both, 0, "exact")["error"]) - number(&exact["error"])).abs() < 1e-12);
    let [said, picture, csv] = written(folder.path(), &two);
    assert!(said.contains("1 - IoU (%)") && said.contains("data.safetensors (9)"), "{said}");
    assert!(
        picture.contains("1 - IoU (%)") && csv.lines().skip(1).all(|line| line.ends_with(",share")),
        "{csv}"
    );
    fails(
        &meissner(&["pareto", "area", argument(&data), "--network", "canf-plain"]),
        2,
        &["320 x 240 pixels"],
    );
}

/// An array of this shape as a file of `NumPy`.
fn npy(kind: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
    [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), values].concat()
}

#[test]
fn the_picture_of_real_pictures_which_have_no_forces_shows_how_contacts_overlap() {
    let folder = tempfile::tempdir().expect("a folder");
    let circle: Vec<u8> = [8.0_f64, 6.0, 3.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let difference: Vec<u8> = (0..12 * 16 * 3_i16).flat_map(|i| (i % 40).to_le_bytes()).collect();
    let arrays = [
        ("background.npy", npy("|u1", "(12, 16, 3)", &[90; 12 * 16 * 3])),
        ("difference.npy", npy("<i2", "(1, 12, 16, 3)", &difference)),
        ("circle.npy", npy("<f8", "(1, 3)", &circle)),
    ];
    let data = folder.path().join("balls.npz");
    std::fs::write(&data, crate::data::archive(&arrays)).expect("it is written");
    let [network, weights] = picture_network(folder.path());
    let svg = folder.path().join("area.svg");
    let output = meissner(&[
        "eval",
        "area",
        argument(&data),
        "--network",
        argument(&network),
        "--weights",
        argument(&weights),
        "--svg",
        argument(&svg),
    ]);
    assert!(output.status.success(), "{}", message(&output));
    let svg = read(&svg);
    assert!(svg.contains("IoU of contacts (%)") && svg.contains(">balls.npz<"), "{svg}");
    assert!(svg.contains(">image difference<"), "{svg}");
}
