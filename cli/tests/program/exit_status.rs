//! Statuses of exit and messages, and text that fits a terminal of 80 columns.

use std::process::Output;

use crate::support::{argument, command, default_recording, file, meissner, meissner_reading, message, text};

pub(crate) fn fails(output: &Output, status: i32, expected: &[&str]) {
    let message = message(output);
    assert_eq!(output.status.code(), Some(status), "{message}");
    assert!(output.stdout.is_empty(), "nothing is printed as if it were a result");
    assert!(message.starts_with("error: "), "{message}");
    for expected in expected {
        assert!(message.contains(expected), "{expected}: {message}");
    }
}

#[test]
fn help_and_version_succeed() {
    for arguments in [
        &["--help"][..],
        &["--version"],
        &["run", "--help"],
        &["bench", "--help"],
        &["help", "convert"],
        &["eval", "digits", "--help"],
        &["prepare", "digits", "--help"],
        &["pareto", "--help"],
        &["pareto", "digits", "--help"],
        &["pareto", "angle", "--help"],
        &["pareto", "slip", "--help"],
        &["pareto", "area", "--help"],
        &["pareto", "force", "--help"],
        &["verify", "--help"],
        &["stress", "--help"],
        &["soak", "--help"],
        &["networks"],
        &["networks", "--json"],
    ] {
        assert_eq!(meissner(arguments).status.code(), Some(0), "{arguments:?}");
    }
}

#[test]
fn arguments_that_make_no_sense_are_bad_usage() {
    for arguments in [
        &["run", "--every", "sometimes"][..],
        &["run", "--every", "0"],
        &["run", "--sensor", "346"],
        &["run", "--span", "0us"],
        &["run", "--span", "7000"],
        &["run", "--span-us", "7000"],
        &["run", "--capacity", "0"],
        &["run", "--mode", "fast"],
        &["run", "--late", "maybe"],
        &["run", "--limit", "-1"],
        &["run", "--unknown"],
        &["run", "one.csv", "two.csv"],
        &["bench", "--every", "end"],
        &["bench", "--every", "0us"],
        &["bench", "--period", "0s"],
        &["bench", "--burst-rate", "0"],
        &["bench", "--repeat", "0"],
        &["bench", "--warmup", "-1"],
        &["bench", "--mode", "batch"],
        &["info"],
        &["inspect", "graphres", "--dot", "--json"],
        &["prepare", "slip", "data"],
        &["eval", "slip"],
        &["eval", "slip", "data", "--threads", "0"],
        &["prepare", "digits", "data"],
        &["eval", "digits"],
        &["eval", "digits", "data", "--every", "99us"],
        &["eval", "digits", "data", "--stride", "0"],
        &["eval", "digits", "data", "--folds", "10"],
        &["eval", "digits", "data", "--weights", "a", "--trainings", "b"],
        &["pareto", "angle"],
        &["pareto", "angle", "recording", "--repeat", "0"],
        &["pareto", "digits", "data", "--timed-events", "0"],
        &["pareto", "digits", "data", "--folds", "10"],
        &["pareto", "digits", "data", "--weights", "a", "--trainings", "b"],
        &["pareto", "slip", "data", "--threads", "0"],
        &["pareto", "area"],
        &["pareto", "force", "data", "--weights", "a", "--trainings", "b"],
        &["eval", "digits", "data", "--json", "out.json"],
        &["verify", "graphres", "--soak", "--stress"],
        &["nothing"],
    ] {
        fails(&meissner(arguments), 2, &["error: "]);
    }
    assert_eq!(meissner::<&str>(&[]).status.code(), Some(2));
    for file in ["out.json", "-"] {
        fails(&meissner(&["eval", "digits", "data", "--json", file]), 2, &[file, "--out FILE"]);
    }
}

#[test]
fn a_recording_without_geometry_asks_for_the_sensor() {
    let (_folder, path) = file("bare.csv", "1,2,3,1\n");
    fails(&meissner(&["run", argument(&path)]), 2, &["CSV", "--sensor WxH", "bare.csv"]);
    fails(&meissner_reading(&["run", "-"], "1,2,3,1\n"), 2, &["--sensor WxH", "standard input"]);
}

#[test]
fn a_description_file_needs_weights() {
    let (_folder, path) = file("own.toml", OWN_NETWORK);
    fails(&meissner(&["run", "--network", argument(&path)]), 2, &["--weights FILE"]);
}

#[test]
fn an_output_that_names_no_format_that_can_be_written_is_bad_usage() {
    let recording = default_recording();
    for output in ["out", "out.txt", "out.aedat", "out.bin"] {
        fails(&meissner(&["convert", argument(&recording), output]), 2, &["--to aedat4|csv|npy|dat|evt3"]);
    }
}

#[test]
fn recordings_that_cannot_be_read_are_bad_input() {
    let noise: Vec<u8> = (0..200_u8).map(|i| i.wrapping_mul(91) ^ 0x80).collect();
    let whole = std::fs::read(default_recording()).expect("the repository holds the file");
    for (name, content) in [
        ("empty.raw", Vec::new()),
        ("noise.raw", noise),
        ("cut.evt3", whole[..whole.len() - 1].to_vec()),
        ("bad.csv", b"# sensor 8x8\nt,x,y,p\n1,2,three,1\n".to_vec()),
    ] {
        let (_folder, path) = file(name, content);
        fails(&meissner(&["run", argument(&path), "--sensor", "8x8"]), 1, &[name]);
        fails(&meissner(&["info", argument(&path)]), 1, &[name]);
    }
    fails(&meissner(&["run", "no/such/file.aedat4"]), 1, &["no/such/file.aedat4"]);
    fails(&meissner(&["bench", "no/such/file.aedat4"]), 1, &["no/such/file.aedat4"]);
}

#[test]
fn networks_and_weights_that_cannot_be_had_or_do_not_fit_are_bad_input() {
    fails(&meissner(&["run", "--network", "graphress"]), 1, &["graphress", "did you mean graphres?"]);
    fails(&meissner(&["bench", "--network", "canf"]), 1, &["canf", "a frame network", "`meissner inspect`"]);
    fails(&meissner(&["inspect", "graphless"]), 1, &["graphless"]);
    fails(&meissner(&["run", "--weights", "no/such.safetensors"]), 1, &["no/such.safetensors"]);
    let (_folder, path) = file("own.toml", OWN_NETWORK.replace("spline", "spiral"));
    fails(&meissner(&["inspect", argument(&path)]), 1, &["own.toml", "spiral"]);
    let (_folder, path) = file("weights.safetensors", "these are none");
    fails(&meissner(&["run", "--weights", argument(&path)]), 1, &["weights.safetensors"]);
    // Well-formed, and without a single tensor.
    let (_folder, path) = file("empty.safetensors", [&[8, 0, 0, 0, 0, 0, 0, 0][..], b"{}      "].concat());
    fails(&meissner(&["run", "--weights", argument(&path)]), 1, &["empty.safetensors", "tactigraph-past"]);
}

#[test]
fn a_network_without_an_incremental_form_says_so() {
    for command in ["run", "bench"] {
        fails(
            &meissner(&[command, "--network", "graphres-published"]),
            1,
            &["graphres-published", "batch mode"],
        );
    }
}

#[test]
fn a_drawing_that_cannot_be_written_is_refused_before_anything_is_measured() {
    fails(&meissner(&["bench", "--svg", "no/such/folder/latency.svg"]), 1, &["no/such/folder/latency.svg"]);
}

#[test]
fn a_recording_in_place_of_a_network_is_recognised() {
    let recording = default_recording();
    fails(&meissner(&["inspect", argument(&recording)]), 1, &["EVT3", "meissner info"]);
}

#[test]
fn more_state_than_the_engine_may_take_is_refused() {
    let arguments = ["run", "--sensor", "65535x65535", "--capacity", "16777216"];
    fails(&meissner(&arguments), 1, &["bytes"]);
}

/// A small network in the format of a description file.
const OWN_NETWORK: &str = r#"
[network]
name = "own"

[graph]
kind = "knn"
k = 2
candidates = "all"
scale = 0.5

[[layer]]
name = "conv"
kind = "spline"
channels = 4
kernel = 2

[[layer]]
name = "grid"
kind = "readout"
grid = [2, 2]

[[layer]]
name = "fc"
kind = "dense"
outputs = 1

[output]
names = ["force"]
unit = "N"
"#;

#[test]
fn no_message_says_a_thing_twice() {
    let (_folder, weights) = file("odd.weights", "these are none");
    let (_other, description) = file("odd.network", OWN_NETWORK.replace("spline", "spiral"));
    let (_third, recording) = file("odd.csv", "# sensor 8x8\nt,x,y,p\n1,2,three,1\n");
    let (_fourth, picture) = file("odd.png", b"\x89PNG\r\n\x1a\n");
    for (arguments, name) in [
        (&["run", "--weights", "missing.pth"][..], "missing.pth"),
        (&["run", "--weights", argument(&weights)], "odd.weights"),
        (&["inspect", argument(&description)], "odd.network"),
        (&["run", "missing.aedat4"], "missing.aedat4"),
        (&["run", argument(&recording)], "odd.csv"),
        (&["run", "--network", "canf", "missing.png"], "missing.png"),
        (&["run", "--network", "canf", argument(&picture)], "odd.png"),
        (&["run", "--network", "slip-best", "missing.csv"], "missing.csv"),
        (&["run", "--resume", "missing.state"], "missing.state"),
        (&["eval", "digits", "missing-folder"], "missing-folder"),
    ] {
        let output = meissner(arguments);
        assert!(!output.status.success(), "{arguments:?}");
        let message = message(&output);
        assert_eq!(message.matches(name).count(), 1, "{message}");
        let parts: Vec<&str> = message.trim().split(": ").collect();
        let again = (1..parts.len()).find(|&i| parts[..i].contains(&parts[i]));
        assert_eq!(again, None, "{message}");
    }
}

#[test]
fn no_line_of_text_for_people_is_wider_than_80_columns() {
    let recording = default_recording();
    let recording = recording.to_str().expect("the repository's path is text");
    // Paths of the machine may be long, but each is one word.
    let pareto = [
        "pareto",
        "angle",
        recording,
        "--network",
        "tactigraph-past",
        "--timed-events",
        "200",
        "--repeat",
        "1",
    ];
    let all: [&[&str]; 17] = [
        &["run", "--limit", "300"],
        &["run", "--limit", "300", "--network", "force-tdnn"],
        &["play", "--limit", "300", "--network", "tactigraph-past"],
        &["bench", "--limit", "300", "--network", "tactigraph-past"],
        &["bench", "--limit", "300", "--network", "force-tdnn"],
        &["bench", "--limit", "300", "--network", "tactigraph-past", "--compare", "force-tdnn"],
        &[&pareto[..], &["--only", "stale"]].concat(),
        &["verify", "tactigraph-past", "--soak", "--events", "1000", "--checkpoint-every", "500"],
        &["verify", "--stress", "--quick", "--only", "one pixel"],
        &["verify", "--stress", "--list"],
        &["verify", "tactigraph-past", "--cases", "1"],
        &["networks"],
        &["info", recording],
        &["inspect", "tactigraph"],
        &["inspect", "digits-all"],
        &["inspect", "canf"],
        &["inspect", "slip-best"],
    ];
    for arguments in all {
        let output = meissner(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", message(&output));
        for line in text(&output).lines() {
            let width = line.chars().count();
            let is_one_word = line.split_whitespace().any(|word| word.chars().count() > 60);
            assert!(width <= 80 || is_one_word, "{arguments:?}: {width} columns: {line}");
        }
    }
}

#[test]
fn the_help_fits_80_columns_whatever_the_terminal() {
    for columns in ["80", "200", "0"] {
        for arguments in
            [&["run", "-h"][..], &["run", "--help"], &["play", "--help"], &["pareto", "angle", "--help"]]
        {
            let output = command(arguments).env("COLUMNS", columns).output().expect("the program starts");
            let help = text(&output);
            assert!(help.contains("Approximations:") || !arguments.contains(&"run"), "{help}");
            for line in help.lines() {
                assert!(line.chars().count() <= 80, "{arguments:?}, {columns}: {line}");
            }
        }
    }
}

#[test]
fn a_program_that_is_built_without_optimisation_says_so_once_where_it_takes_long() {
    let said = |arguments: &[&str]| {
        let errors = String::from_utf8(meissner(arguments).stderr).expect("messages are text");
        errors.matches("built without optimisation").count()
    };
    let once = usize::from(cfg!(debug_assertions));
    for arguments in [&["run", "--limit", "10"][..], &["bench", "--limit", "10", "--json"]] {
        assert_eq!(said(arguments), once, "{arguments:?}");
    }
    for arguments in [&["networks"][..], &["inspect", "graphres"], &["run", "-h"]] {
        assert_eq!(said(arguments), 0, "{arguments:?}");
    }
}
