//! Lines of a state that were cut or changed; fingerprints.

use super::{Fingerprint, Key, Line, parse};
use crate::pareto::ErrorKind;
use crate::pareto::measurement::{Differences, Measurement};

fn line(setting: &str) -> String {
    let text = |text: &str| text.to_owned();
    let key = Key {
        system: text("angle"),
        network: text("graphres"),
        weights: text("1"),
        setting: text(setting),
        data: text("2"),
        options: text("3"),
        version: text("4"),
    };
    let numerical = Differences::default().finish();
    let measurement =
        Measurement { timed: 10, rows: 0.5, multiply_adds: 1e6, numerical, ..Measurement::default() };
    serde_json::to_string(&Line { key, measurement }).expect("numbers and text") + "\n"
}

fn settings(lines: &[Line]) -> Vec<&str> {
    lines.iter().map(|line| line.key.setting.as_str()).collect()
}

#[test]
fn lines_are_read_as_they_were_written() {
    let text = line("exact") + "\n" + &line("stride 2");
    let (lines, keep) = parse(text.as_bytes()).expect("both are whole");
    assert_eq!((settings(&lines), keep), (vec!["exact", "stride 2"], text.len()));
    assert_eq!(serde_json::to_string(&lines[0]).expect("a line") + "\n", line("exact"));
}

/// A line as programs wrote it before errors had a kind.
const OLD: &str = r#"{"key":{"system":"digits","network":"digits-past","weights":"1","setting":"exact","data":"2","options":"3","version":"0.1.0"},"measurement":{"timed":10,"entered":1.0,"push_us":{"mean":1.0,"p50":1.0,"p99":2.0},"push_predict_us":{"mean":3.0,"p50":3.0,"p99":4.0},"exact_us":3.0,"ratio":1.0,"rows":4.5,"multiply_adds":1000.0,"numerical":{"max":0.0,"rms":0.0,"relative_rms":0.0,"max_by_tenth":[0.0],"rms_by_tenth":[0.0]},"task":[{"of":"split test","error":0.03,"interval_95":[0.02,0.05],"trials":1100,"trainings":1}]}}
"#;

#[test]
fn a_line_of_an_older_program_has_errors_of_wrong_answers() {
    let (lines, keep) = parse(OLD.as_bytes()).expect("it is whole");
    let task = &lines[0].measurement.task[0];
    assert_eq!((keep, task.kind, task.interval_95), (OLD.len(), ErrorKind::WrongAnswers, Some((0.02, 0.05))));
    let again = serde_json::to_string(&lines[0]).expect("a line") + "\n";
    assert_eq!(parse(again.as_bytes()).expect("it is whole").0, lines);
}

#[test]
fn a_last_line_that_was_not_finished_is_cut_off_wherever_it_ends() {
    let (first, second) = (line("exact"), line("stride 2"));
    for end in 1..second.len() - 1 {
        let text = first.clone() + &second[..end];
        let (lines, keep) = parse(text.as_bytes()).expect("the first is whole");
        assert_eq!((settings(&lines), keep), (vec!["exact"], first.len()), "{end}");
    }
    let without_end = first.clone() + second.trim_end();
    let (lines, keep) = parse(without_end.as_bytes()).expect("both are whole");
    assert_eq!((lines.len(), keep), (2, without_end.len()));
}

#[test]
fn another_line_that_cannot_be_read_is_named_by_its_number() {
    let text = line("exact") + "{\"key\":\n" + &line("stride 2");
    assert_eq!(parse(text.as_bytes()).expect_err("line 2 is broken").0, 2);
    assert_eq!(parse(b"broken\n").expect_err("finished").0, 1);
}

#[test]
fn lines_with_any_bit_flipped_or_nested_without_end_are_read_or_named_by_their_number() {
    let text = line("exact") + &line("stride 2");
    for bit in 0..8 * text.len() {
        let mut flipped = text.clone().into_bytes();
        flipped[bit / 8] ^= 1 << (bit % 8);
        match parse(&flipped) {
            Ok((lines, keep)) => assert!(lines.len() <= 2 && keep <= flipped.len(), "bit {bit}"),
            Err((number, _)) => assert!((1..=2).contains(&number), "bit {bit}: {number}"),
        }
    }
    for nested in ["[".repeat(1 << 20), "{\"key\":".repeat(1 << 18)] {
        assert_eq!(parse(format!("{}{nested}\n", line("exact")).as_bytes()).expect_err("deep").0, 2);
    }
}

#[test]
fn texts_are_told_apart_from_their_parts() {
    let of = |texts: &[&str]| {
        let mut fingerprint = Fingerprint::default();
        texts.iter().for_each(|text| fingerprint.text(text));
        fingerprint.finish()
    };
    assert_ne!(of(&["ab", "c"]), of(&["a", "bc"]));
}
