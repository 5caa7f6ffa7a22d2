//! Weights whose tensors have other names than the network's: common names, `--map`, and refused
//! files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use meissner_models::{Description, NameMap, Weights, draw};
use tempfile::TempDir;

use crate::data::{DigitsFolder, Runs, small};
use crate::shared_files::shared;
use crate::support::{argument, bits, default_recording, file, lines, meissner, message, words};

const NETWORK: &str = "tactigraph-past";

/// Drawn weights of [`NETWORK`] under their own names and the names of `map`, and a path for a map.
fn files(map: &str) -> (TempDir, [PathBuf; 3]) {
    let description = Description::shipped(NETWORK).expect("shipped");
    let (folder, own) = file("own.safetensors", draw(&description, 3).to_safetensors(&BTreeMap::new()));
    let other = folder.path().join("other.safetensors");
    let map = NameMap::parse(map).expect("lines of names");
    let renamed = draw(&description, 3).renamed(&map).expect("names of the network");
    std::fs::write(&other, renamed.to_safetensors(&BTreeMap::new()))
        .expect("a temporary file can be written");
    let names = folder.path().join("names.txt");
    (folder, [own, other, names])
}

/// The first predictions with these weights.
fn predictions(weights: &Path, more: &[&str]) -> Vec<Vec<u32>> {
    let arguments = ["run", "--limit", "300", "--every", "100", "--json", "--weights", argument(weights)];
    lines(&meissner(&[&arguments, more].concat())).0.iter().map(bits).collect()
}

#[test]
fn a_map_of_lines_or_of_a_file_gives_the_bits_of_the_networks_own_names() {
    let (_folder, [own, other, names]) = files("hidden. = mlp.0.\nfc.weight = out\n");
    let expected = predictions(&own, &[]);
    assert!(!expected.is_empty());
    std::fs::write(&names, "# the head\nmlp.0. = hidden.\nout = fc.weight\n").expect("written");
    assert_eq!(predictions(&other, &["--map", argument(&names)]), expected);
    assert_eq!(predictions(&other, &["--map", "mlp.0.=hidden.", "--map", "out=fc.weight"]), expected);
    // A file whose name has the sign of a line.
    let odd = names.with_file_name("lr=0.1.txt");
    std::fs::copy(&names, &odd).expect("copied");
    assert_eq!(predictions(&other, &["--map", argument(&odd)]), expected);
}

#[test]
fn without_a_map_the_message_names_what_is_left_over_and_the_option() {
    let (_folder, [_, other, _]) = files("hidden. = mlp.0.\n");
    let output = meissner(&["run", "--limit", "300", "--weights", argument(&other)]);
    assert_eq!(output.status.code(), Some(1));
    let message = message(&output);
    for part in [
        "other.safetensors",
        "tensor \"hidden.weight\": expected shape",
        "found no such tensor; left over of this shape: \"mlp.0.weight\"",
        "--map OLD=NEW",
    ] {
        assert!(message.contains(part), "{part}: {message}");
    }
}

#[test]
fn lines_that_do_not_fit_are_refused_by_name() {
    let (_folder, [own, _, names]) = files("hidden. = mlp.0.\n");
    std::fs::write(&names, "hidden.bias = b\nhidden.bias = c\n").expect("written");
    for (map, expected) in [
        ("nothing=hidden.bias", "\"nothing=hidden.bias\": expected a tensor of the file, found \"nothing\""),
        ("hidden.bias=hidden.weight", "expected one tensor called \"hidden.weight\""),
        (
            "hidden.bias=hidden.bais",
            "\"hidden.bais\": expected a tensor that network \"tactigraph-past\" reads",
        ),
        ("no/such/file", "no/such/file"),
        (argument(&names), "names.txt, line 2: expected one line for \"hidden.bias\""),
    ] {
        let output = meissner(&["run", "--limit", "300", "--weights", argument(&own), "--map", map]);
        assert_eq!(output.status.code(), Some(1), "{map}");
        assert!(message(&output).contains(expected), "{map}: {}", message(&output));
    }
    let output = meissner(&["run", "--map", "a=b"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(message(&output).contains("--weights"), "{}", message(&output));
}

#[test]
fn every_command_with_weights_takes_a_map() {
    let (_folder, [_, other, names]) = files("hidden. = mlp.0.\n");
    std::fs::write(&names, "mlp.0. = hidden.\n").expect("written");
    let recording = default_recording();
    let named = ["--weights", argument(&other), "--map", argument(&names)];
    let commands: [&[&str]; 4] = [
        &["bench", "--limit", "300", "--warmup", "0"],
        &["play", "--limit", "300", "--speed", "1000"],
        &["verify", NETWORK, "--cases", "1"],
        &[
            "pareto",
            "angle",
            argument(&recording),
            "--timed-events",
            "100",
            "--repeat",
            "1",
            "--only",
            "exact",
        ],
    ];
    for command in commands {
        let output = meissner(&[command, &named].concat());
        assert!(output.status.success(), "{command:?}: {}", message(&output));
    }
}

#[test]
fn a_task_is_judged_with_weights_of_other_names() {
    let (folder, runs) = (DigitsFolder::new(), Runs::new());
    let text = small("small", &[]);
    let description = Description::parse(&text).expect("consistent");
    let network = runs.path().join("small.toml");
    std::fs::write(&network, &text).expect("written");
    let weights = draw(&description, 3);
    let judged = |name: &str, weights: &Weights, more: &[&str]| {
        let path = runs.path().join(name);
        std::fs::write(&path, weights.to_safetensors(&BTreeMap::new())).expect("written");
        let data = folder.path();
        let arguments =
            ["eval", "digits", argument(data), "--network", argument(&network), "--weights", argument(&path)];
        let output = meissner(&[&arguments, more].concat());
        assert!(output.status.success(), "{}", message(&output));
        words(&output).replace(argument(&path), "weights")
    };
    let first = weights.names().next().expect("a tensor").to_owned();
    let renamed = weights.clone().renamed(&NameMap::entry(&format!("{first} = other")).expect("a pair"));
    let of_others =
        judged("other.safetensors", &renamed.expect("a tensor"), &["--map", &format!("other={first}")]);
    assert_eq!(of_others, judged("own.safetensors", &weights, &[]));
}

#[test]
fn a_whole_module_is_refused_with_what_to_save() {
    // An archive of torch.save(model): a class, no arguments, NEWOBJ.
    let pickle = b"\x80\x02c__main__\nNet\nq\x00)\x81q\x01}q\x02b.";
    let (_folder, path) = file("model.pth", archive("model/data.pkl", pickle));
    let output = meissner(&["run", "--limit", "300", "--weights", argument(&path)]);
    assert_eq!(output.status.code(), Some(1));
    let message = message(&output);
    assert!(message.contains("model.pth") && message.contains("__main__.Net"), "{message}");
    assert!(message.contains("torch.save(model.state_dict(), \"weights.pth\")"), "{message}");
}

/// A zip archive of one stored entry.
fn archive(name: &str, data: &[u8]) -> Vec<u8> {
    let crc = !data.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    });
    let mut entry = [20_u16, 0, 0, 0, 0].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    entry.extend([crc, data.len() as u32, data.len() as u32].iter().flat_map(|v| v.to_le_bytes()));
    entry.extend([name.len() as u16, 0].iter().flat_map(|v| v.to_le_bytes()));
    let local = [b"PK\x03\x04", &entry[..], name.as_bytes(), data].concat();
    let directory = [b"PK\x01\x02\x14\0", &entry[..], &[0; 14], name.as_bytes()].concat();
    let end = [1_u16, 1].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let places = [directory.len() as u32, local.len() as u32]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect::<Vec<u8>>();
    [&local[..], &directory, b"PK\x05\x06\0\0\0\0", &end, &places, &[0; 2]].concat()
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_published_checkpoint_runs_as_its_authors_save_it() {
    let path = |name: &str| shared(&format!("data/checkpoints/{name}"));
    let network = ["--network", "graphres-published", "--mode", "batch"];
    let published = predictions(&path("contact_angle_graphres_as_published.pth"), &network);
    assert!(!published.is_empty());
    assert_eq!(published, predictions(&path("contact_angle_graphres.safetensors"), &network));
}
