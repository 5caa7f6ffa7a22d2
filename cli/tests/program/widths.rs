//! Text for people fits a terminal of 80 columns.

use crate::support::{command, default_recording, meissner, message, text};

#[test]
fn no_line_of_text_for_people_is_wider_than_80_columns() {
    let recording = default_recording();
    let recording = recording.to_str().expect("the repository's path is text");
    // As long as paths of the machine may be, they are words of their own.
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
