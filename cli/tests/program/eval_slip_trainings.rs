//! Networks judged over several trainings and cross-validations.

use std::path::Path;

use meissner_models::{FrameDescription, Weights};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::data::slip::{CLASSES, SlipFolder, class, drawn, outputs, training};
use crate::eval_slip::{confusion, counts, report};
use crate::exit_status::fails;
use crate::support::{argument, meissner, text};

const NETWORK: &str = "slip-lstm";

fn folder() -> TempDir {
    tempfile::tempdir().expect("there is a place for temporary files")
}

/// Writes a training of [`NETWORK`] with drawn weights and `more` metadata.
fn write(folder: &Path, name: &str, seed: u64, more: &[(&str, &str)]) -> Weights {
    let weights = drawn(NETWORK, seed);
    let description = FrameDescription::shipped(NETWORK).expect("it is shipped");
    let (seed, preparation) = (seed.to_string(), description.preparation().expect("over readings"));
    let own = [
        ("network", NETWORK),
        ("seed", seed.as_str()),
        ("trained_on", "Basic"),
        ("preparation", preparation.as_str()),
    ];
    let own = own.into_iter().filter(|(key, _)| more.iter().all(|(other, _)| other != key));
    training(folder, name, &weights, &own.chain(more.iter().copied()).collect::<Vec<_>>());
    weights
}

/// The program's output for the trainings in `folder`.
fn judged(data: &SlipFolder, folder: &TempDir, more: &[&str]) -> std::process::Output {
    let own = ["eval", "slip", argument(data.path()), "--trainings", argument(folder.path())];
    meissner(&[&own[..], more].concat())
}

fn trainings(data: &SlipFolder, folder: &TempDir) -> Value {
    report(&[argument(data.path()), "--trainings", argument(folder.path())])
}

/// The sum of the diagonal over the sum of all.
fn accuracy(matrix: &[Vec<u64>]) -> f64 {
    let hits: u64 = (0..7).map(|class| matrix[class][class]).sum();
    hits as f64 / matrix.iter().flatten().sum::<u64>() as f64
}

#[test]
fn whole_trainings_are_judged_on_every_set_with_their_spread() {
    let (data, folder) = (SlipFolder::new(), folder());
    let seeds = [1, 2, 3]
        .map(|seed| outputs(NETWORK, &write(folder.path(), &format!("{seed}.safetensors"), seed, &[])));
    let report = trainings(&data, &folder);
    assert_eq!(report["networks"].as_array().map(Vec::len), Some(1), "the others have no training");
    let notes = report["data"]["notes"].to_string();
    assert!(notes.contains("slip-tuned: no training in"), "{notes}");
    for (i, object) in [2, 0, 1, 3].into_iter().enumerate() {
        let set = &report["networks"][0]["sets"][i];
        assert_eq!(set["trained_on"], i == 0, "Basic alone");
        let each = seeds.each_ref().map(|outputs| confusion(outputs, object));
        let found: Vec<_> =
            set["each"].as_array().expect("a list").iter().map(|one| counts(&one["confusion"])).collect();
        assert_eq!(found, each);
        let sum: Vec<Vec<u64>> =
            (0..7).map(|t| (0..7).map(|p| each.iter().map(|matrix| matrix[t][p]).sum()).collect()).collect();
        assert_eq!(counts(&set["confusion"]), sum);
        let shares = each.each_ref().map(|matrix| accuracy(matrix));
        let mean = shares.iter().sum::<f64>() / 3.0;
        let std = (shares.iter().map(|share| (share - mean) * (share - mean)).sum::<f64>() / 2.0).sqrt();
        let number = |key: &str| set["accuracy"][key].as_f64().expect("a number");
        assert!((number("mean") - mean).abs() < 1e-12 && (number("std") - std).abs() < 1e-12, "{set}");
        assert_eq!(set["trainings"], 3);
    }
    let text = text(&judged(&data, &folder, &["--network", NETWORK]));
    assert!(text.contains("*: trained on") && text.contains(" +- "), "{text}");
}

/// Recordings of Basic of the first classes, and of the others.
fn halves() -> [Vec<String>; 2] {
    let name = |class: &&str| format!("{class}/case1");
    [CLASSES[..3].iter().map(name).collect(), CLASSES[3..].iter().map(name).collect()]
}

#[test]
fn folds_are_judged_on_what_they_held_out_and_together() {
    let (data, folder) = (SlipFolder::new(), folder());
    let mut expected = vec![vec![0; 7]; 7];
    for (fold, half) in halves().into_iter().enumerate() {
        let held_out = json!(half).to_string();
        let number = fold.to_string();
        let metadata = [
            ("seed", "9"),
            ("fold", number.as_str()),
            ("scheme", "recordings"),
            ("held_out", held_out.as_str()),
        ];
        let name = format!("r{fold}.safetensors");
        let outputs = outputs(NETWORK, &write(folder.path(), &name, fold as u64, &metadata));
        for (truth, name) in CLASSES.iter().enumerate() {
            if half.contains(&format!("{name}/case1")) {
                outputs[truth * 4 + 2].iter().for_each(|window| expected[truth][class(window)] += 1);
            }
        }
    }
    // By window: the first and the last of three windows of each recording.
    let windows: Vec<_> =
        CLASSES.iter().flat_map(|class| [0, 2].map(|i| json!([format!("{class}/case1"), i]))).collect();
    let windows = json!(windows).to_string();
    let metadata = [("fold", "0"), ("scheme", "windows"), ("held_out_windows", windows.as_str())];
    let by_window = outputs(NETWORK, &write(folder.path(), "w0.safetensors", 5, &metadata));
    let report = trainings(&data, &folder);
    let network = &report["networks"][0];
    assert_eq!(network["sets"], json!([]), "there is no whole training");
    let [recordings, windows] = [0, 1].map(|i| &network["cross_validation"][i]);
    assert_eq!((&recordings["scheme"], &windows["scheme"]), (&"recordings".into(), &"windows".into()));
    assert_eq!(counts(&recordings["confusion"]), expected);
    assert_eq!(recordings["accuracy"]["mean"], accuracy(&expected));
    assert_eq!(
        (&recordings["trainings"], &recordings["windows"], &recordings["of_basic"]),
        (&1.into(), &21.into(), &21.into())
    );
    assert_eq!(recordings["each"][0]["files"].as_array().map(Vec::len), Some(2));
    let mut expected = vec![vec![0; 7]; 7];
    for (truth, row) in expected.iter_mut().enumerate() {
        [0, 2].iter().for_each(|&i| row[class(&by_window[truth * 4 + 2][i])] += 1);
    }
    assert_eq!((counts(&windows["confusion"]), &windows["windows"]), (expected, &14.into()));
    let notes = report["data"]["notes"].to_string();
    assert!(notes.contains("seed 5 hold out 14 of the 21 windows of Basic"), "{notes}");
    let text = text(&judged(&data, &folder, &["--network", NETWORK]));
    for expected in ["by recording", "the paper's way", "a press changes slowly"] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
}

#[test]
fn a_folder_without_a_training_of_the_network_is_refused_with_what_it_has() {
    let (data, folder) = (SlipFolder::new(), folder());
    fails(&judged(&data, &folder, &[]), 1, &["slip-lstm, slip-regularised", "no such file"]);
    write(folder.path(), "1.safetensors", 1, &[]);
    fails(&judged(&data, &folder, &["--network", "slip-tuned"]), 1, &["= slip-tuned", "found slip-lstm"]);
    let path = argument(data.path());
    fails(&meissner(&["eval", "slip", path, "--trainings", "no/such/folder"]), 1, &["no/such/folder"]);
}

#[test]
fn files_that_do_not_say_what_they_are_are_refused_by_name() {
    let data = SlipFolder::new();
    for (metadata, expected) in [
        (&[("network", "")][..], &["\"network\"", "name"][..]),
        (&[("seed", "one")], &["\"seed\"", "whole number", "\"one\""]),
        (&[("fold", "0.5")], &["\"fold\""]),
        (&[("trained_on", "Solids")], &["\"trained_on\"", "\"Basic\"", "\"Solids\""]),
        (&[("scheme", "objects")], &["\"scheme\"", "\"objects\""]),
        (&[("held_out", "[\"n/case99\"]")], &["held-out recordings", "n/case99"]),
        (&[("held_out", "[\"n/brush3\"]")], &["set Basic", "n/brush3", "of Small"]),
        (&[("held_out_windows", "[[\"n/case1\", 3]]")], &["n/case1", "below 3", "found 3"]),
        (&[("held_out_windows", "[[\"n/case1\", 1], [\"n/case1\", 1]]")], &["again", "window 1"]),
        (
            &[("preparation", r#"{"frames":"electrodes","steps":4,"scaling":"reading"}"#)],
            &["\"steps\":5", "\"steps\":4"],
        ),
    ] {
        let folder = folder();
        write(folder.path(), "faulty.safetensors", 1, metadata);
        let expected = [&["faulty.safetensors"], expected].concat();
        fails(&judged(&data, &folder, &[]), 1, &expected);
    }
}

#[test]
fn trainings_that_are_there_twice_are_refused() {
    let (data, folder) = (SlipFolder::new(), folder());
    write(folder.path(), "a.safetensors", 4, &[]);
    write(folder.path(), "b.safetensors", 4, &[]);
    fails(&judged(&data, &folder, &[]), 1, &["b.safetensors", "seed 4", "a.safetensors too"]);
    std::fs::remove_file(folder.path().join("b.safetensors")).expect("it is there");
    for fold in ["f0.safetensors", "f1.safetensors"] {
        write(folder.path(), fold, 4, &[("held_out", "[\"n/case1\"]")]);
    }
    fails(&judged(&data, &folder, &[]), 1, &["f1.safetensors", "n/case1", "f0.safetensors holds out"]);
}

#[test]
fn a_description_file_takes_its_weights_from_the_folder() {
    let (data, folder) = (SlipFolder::new(), folder());
    let own = folder.path().join("own.toml");
    let text = include_str!("../../../models/networks/slip-lstm.toml").replace("slip-lstm", "own");
    std::fs::write(&own, text).expect("written");
    let metadata = [("network", "own"), ("seed", "-1"), ("trained_on", "Basic")];
    training(folder.path(), "own.safetensors", &drawn(NETWORK, 6), &metadata);
    let logits = folder.path().join("logits");
    let arguments = [
        argument(data.path()),
        "--network",
        argument(&own),
        "--trainings",
        argument(folder.path()),
        "--logits",
        argument(&logits),
    ];
    let report = report(&arguments);
    assert_eq!(
        counts(&report["networks"][0]["sets"][0]["confusion"]),
        confusion(&outputs(NETWORK, &drawn(NETWORK, 6)), 2)
    );
    assert!(Weights::load(&logits).expect("a valid file").get("own.-1").is_some());
}
