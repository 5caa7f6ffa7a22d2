//! Time against the error of quantities: forces of simulated grasps, and contacts in simulated
//! pictures.

use serde_json::Value;
use std::path::{Path, PathBuf};

use crate::exit_status::fails;
use crate::pareto::{errors, is_a_front, number, report, setting, settings};
use crate::support::{argument, meissner, message, object, picture_network, text};

/// What `simulate` writes with these arguments.
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

    // What is in the state is not measured again, and all forms have the unit.
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
    std::fs::write(&data, crate::touch_data::archive(&arrays)).expect("it is written");
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
