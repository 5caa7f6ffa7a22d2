//! Networks judged on a data set of digits over several trainings and cross-validations.

use meissner_evaluate::events::folds;
use meissner_models::{Description, Weights};
use serde_json::{Value, json};

use crate::data::{DigitsFolder, RECORDINGS, Runs, Said, all_said, digits, small};
use crate::eval_digits::{TESTED, are_those, number, report};
use crate::exit_status::fails;
use crate::support::{argument, meissner, text};

/// Arguments that judge the network in `own.toml` with the trainings beside it.
fn arguments(data: &DigitsFolder, runs: &Runs) -> [String; 5] {
    let own = runs.path().join("own.toml");
    [argument(data.path()), "--network", argument(&own), "--trainings", argument(runs.path())]
        .map(str::to_owned)
}

/// The report on these trainings.
fn judged(data: &DigitsFolder, runs: &Runs, more: &[&str]) -> Value {
    let own = arguments(data, runs);
    report(&[&own.each_ref().map(String::as_str)[..], more].concat())
}

/// Asserts that the program refuses these trainings.
fn refused(data: &DigitsFolder, runs: &Runs, more: &[&str], status: i32, expected: &[&str]) {
    let own = arguments(data, runs);
    let own = own.each_ref().map(String::as_str);
    fails(&meissner(&[&["eval", "digits"], &own[..], more].concat()), status, expected);
}

fn own(runs: &Runs) -> Description {
    runs.network(&small("own", &[])).1
}

/// Names of the recordings of each of `count` folds.
fn parts(count: usize) -> Vec<Vec<String>> {
    let digits = digits();
    let classes: Vec<usize> = digits.iter().map(|digit| digit.class).collect();
    let folds = folds(&classes, count).expect("enough recordings");
    let of_fold = |fold| digits.iter().zip(&folds).filter(move |(_, own)| **own == fold);
    (0..count).map(|fold| of_fold(fold).map(|(digit, _)| digit.name.clone()).collect()).collect()
}

/// Writes a fold of seed 9 that held out `names`, with weights drawn from `drawn`.
fn fold(runs: &Runs, description: &Description, drawn: u64, names: &[String]) -> Weights {
    let held_out = json!(names).to_string();
    let metadata = [("seed", "9"), ("held_out", held_out.as_str()), ("trained_on", "the rest")];
    runs.training(&format!("fold{drawn}.safetensors"), description, drawn, &metadata)
}

#[test]
fn whole_trainings_are_judged_on_the_split_test_with_their_spread() {
    let (data, runs) = (DigitsFolder::new(), Runs::new());
    let description = own(&runs);
    let seeds = [3, 1, 2]
        .map(|seed| (seed, runs.training(&format!("{}.safetensors", 9 - seed), &description, seed, &[])));
    runs.training("else.safetensors", &description, 1, &[("network", "else")]);
    let report = judged(&data, &runs, &[]);
    let test = &report["networks"][0]["test"];
    let tested: Vec<usize> = TESTED.collect();
    let mut accuracies = Vec::new();
    for (seed, weights) in seeds {
        let one = &test["each"][seed as usize - 1];
        assert_eq!(one["seed"], seed, "by seed, not by file");
        are_those(one, &all_said(&description, &weights, 1), &tested);
        accuracies.push(number(&one["accuracy"]));
    }
    let mean = accuracies.iter().sum::<f64>() / 3.0;
    let std = (accuracies.iter().map(|share| (share - mean) * (share - mean)).sum::<f64>() / 2.0).sqrt();
    assert!((number(&test["accuracy"]["mean"]) - mean).abs() < 1e-12);
    assert!((number(&test["accuracy"]["std"]) - std).abs() < 1e-12);
    let low = (0..3).map(|i| number(&test["each"][i]["interval_95"][0])).sum::<f64>() / 3.0;
    assert!((number(&test["interval_95"][0]) - low).abs() < 1e-12, "the mean of the bounds");
    let notes = report["data"]["notes"].to_string();
    assert!(notes.contains("else.safetensors: network else is not judged"), "{notes}");
    let own = arguments(&data, &runs);
    let text = text(&meissner(&[&["eval", "digits"], &own.each_ref().map(String::as_str)[..]].concat()));
    assert!(text.contains("own, test split, seed 2") && text.contains("3 trainings"), "{text}");
}

#[test]
fn folds_are_judged_on_what_they_held_out_and_together_on_every_recording() {
    let (data, runs) = (DigitsFolder::new(), Runs::new());
    let description = own(&runs);
    let digits = digits();
    let mut said: Vec<Option<Said>> = (0..RECORDINGS).map(|_| None).collect();
    for (i, names) in parts(3).iter().enumerate() {
        let weights = fold(&runs, &description, 20 + i as u64, names);
        for (place, outcome) in all_said(&description, &weights, 1).into_iter().enumerate() {
            if names.contains(&digits[place].name) {
                said[place] = Some(outcome);
            }
        }
    }
    let said: Vec<Said> = said.into_iter().map(|said| said.expect("in one fold")).collect();
    let logits = runs.path().join("logits");
    let report = judged(&data, &runs, &["--folds", "3", "--logits", argument(&logits)]);
    let network = &report["networks"][0];
    assert_eq!(network["test"], Value::Null, "there is no whole training");
    let validated = &network["cross_validation"];
    assert_eq!((&validated["recordings"], &validated["trainings"]), (&RECORDINGS.into(), &1.into()));
    assert_eq!((&validated["each"][0]["seed"], &validated["accuracy"]["std"]), (&9.into(), &Value::Null));
    assert_eq!(validated["each"][0]["files"].as_array().map(Vec::len), Some(3));
    are_those(&validated["each"][0], &said, &(0..RECORDINGS).collect::<Vec<_>>());
    let file = Weights::load(&logits).expect("a valid file");
    let tensor = file.get("own.9.folds").expect("named by network and seed");
    let expected: Vec<u32> = said.into_iter().flat_map(|said| said.bits).collect();
    let found: Vec<u32> = tensor.values().expect("floats").iter().map(|value| value.to_bits()).collect();
    assert_eq!((tensor.shape(), found), (&[RECORDINGS, 10][..], expected));
}

#[test]
fn folds_that_leave_out_a_recording_or_hold_one_out_twice_are_refused() {
    let (data, runs) = (DigitsFolder::new(), Runs::new());
    let description = own(&runs);
    let parts = parts(3);
    fold(&runs, &description, 20, &parts[0]);
    fold(&runs, &description, 21, &parts[1]);
    let missing = ["fold20.safetensors", "own and seed 9", "each of 30 recordings", "found 20", "not \"t"];
    refused(&data, &runs, &[], 1, &missing);
    fold(&runs, &description, 22, &[&parts[2][..], &parts[0][..1]].concat());
    refused(
        &data,
        &runs,
        &[],
        1,
        &["fold22.safetensors", parts[0][0].as_str(), "fold20.safetensors holds out"],
    );
    fold(&runs, &description, 22, &[&parts[2][..], &parts[2][..1]].concat());
    refused(&data, &runs, &[], 1, &["fold22.safetensors", parts[2][0].as_str(), "again"]);
    fold(&runs, &description, 22, &["train/0/99".to_owned()]);
    refused(&data, &runs, &[], 1, &["held-out recordings of the data set", "train/0/99"]);
}

#[test]
fn with_a_number_of_folds_they_must_be_those_that_prepare_writes() {
    let (data, runs) = (DigitsFolder::new(), Runs::new());
    let description = own(&runs);
    let all: Vec<String> = digits().into_iter().map(|digit| digit.name).collect();
    fold(&runs, &description, 20, &all[..15]);
    fold(&runs, &description, 21, &all[15..]);
    assert_eq!(judged(&data, &runs, &[])["networks"][0]["cross_validation"]["recordings"], 30);
    refused(&data, &runs, &["--folds", "2"], 1, &["fold20.safetensors", "with --folds 2", "2 folds"]);
    refused(&data, &runs, &["--folds", "31"], 2, &["2 to 30", "found 31"]);
}

#[test]
fn files_that_do_not_say_what_they_are_are_refused_by_name() {
    let data = DigitsFolder::new();
    for (metadata, expected) in [
        (&[("network", "")][..], &["\"network\"", "name"][..]),
        (&[("seed", "one")], &["\"seed\"", "whole number", "\"one\""]),
        (&[("fold", "0.5")], &["\"fold\""]),
        (&[("trained_on", "test")], &["\"trained_on\"", "\"train\"", "\"test\""]),
        (&[("held_out", "train/0/9")], &["\"held_out\"", "JSON list of recordings"]),
        (&[("stride", "-1")], &["\"stride\" with a whole number from 1"]),
    ] {
        let runs = Runs::new();
        runs.training("faulty.safetensors", &own(&runs), 1, metadata);
        refused(&data, &runs, &[], 1, &[&["faulty.safetensors"], expected].concat());
    }
}

#[test]
fn trainings_that_do_not_go_together_are_refused() {
    let (data, runs) = (DigitsFolder::new(), Runs::new());
    let description = own(&runs);
    refused(&data, &runs, &[], 1, &["\"network\" = own", "no such file"]);
    runs.training("a.safetensors", &description, 4, &[]);
    runs.training("b.safetensors", &description, 4, &[]);
    refused(&data, &runs, &[], 1, &["b.safetensors", "seed 4", "a.safetensors too"]);
    runs.training("b.safetensors", &description, 5, &[("stride", "2")]);
    refused(&data, &runs, &[], 1, &["b.safetensors", "\"stride\" 1", "found 2", "--stride N"]);
    assert_eq!(judged(&data, &runs, &["--stride", "4"])["networks"][0]["stride"], 4);
    runs.training("a.safetensors", &description, 4, &[("network", "else")]);
    runs.training("b.safetensors", &description, 4, &[("network", "else")]);
    refused(&data, &runs, &[], 1, &["\"network\" = own", "found else"]);
}

#[test]
fn the_frozen_network_is_judged_with_the_trainings_of_the_one_over_the_past() {
    let (data, runs) = (DigitsFolder::new(), Runs::new());
    let (past, description) = runs.network(&small("digits-past", &[]));
    let changes = [("lifetime = \"window\"", "lifetime = \"frozen\"")];
    let (frozen, of_frozen) = runs.network(&small("digits-frozen", &changes));
    let weights = runs.training("past.safetensors", &description, 4, &[]);
    let report = report(&[
        argument(data.path()),
        "--network",
        argument(&past),
        "--network",
        argument(&frozen),
        "--trainings",
        argument(runs.path()),
    ]);
    let tested: Vec<usize> = TESTED.collect();
    for (i, description) in [description, of_frozen].iter().enumerate() {
        assert_eq!(report["networks"][i]["network"]["name"], description.name());
        are_those(&report["networks"][i]["test"]["each"][0], &all_said(description, &weights, 1), &tested);
    }
}
