//! Lines of a file that were cut or changed; fingerprints.

use crate::fingerprint::Fingerprint;
use crate::journal::{Journal, Line, parse};

type Lines = Vec<Line<String, Vec<f64>>>;

fn line(key: &str) -> String {
    let line = Line { key: key.to_owned(), measurement: vec![1e6, 0.1, -2.5e-300] };
    serde_json::to_string(&line).expect("numbers and text") + "\n"
}

fn keys(lines: &[Line<String, Vec<f64>>]) -> Vec<&str> {
    lines.iter().map(|line| line.key.as_str()).collect()
}

#[test]
fn lines_are_read_as_they_were_written() {
    let text = line("exact") + "\n" + &line("stride 2");
    let (lines, keep): (Lines, _) = parse(text.as_bytes()).expect("both are whole");
    assert_eq!((keys(&lines), keep), (vec!["exact", "stride 2"], text.len()));
    assert_eq!(serde_json::to_string(&lines[0]).expect("a line") + "\n", line("exact"));
}

#[test]
fn a_last_line_that_was_not_finished_is_cut_off_wherever_it_ends() {
    let (first, second) = (line("exact"), line("stride 2"));
    for end in 1..second.len() - 1 {
        let text = first.clone() + &second[..end];
        let (lines, keep): (Lines, _) = parse(text.as_bytes()).expect("the first is whole");
        assert_eq!((keys(&lines), keep), (vec!["exact"], first.len()), "{end}");
    }
    let without_end = first.clone() + second.trim_end();
    let (lines, keep): (Lines, _) = parse(without_end.as_bytes()).expect("both are whole");
    assert_eq!((lines.len(), keep), (2, without_end.len()));
}

#[test]
fn another_line_that_cannot_be_read_is_named_by_its_number() {
    let number = |text: &str| parse::<Line<String, Vec<f64>>>(text.as_bytes()).expect_err("broken").0;
    assert_eq!(number(&(line("exact") + "{\"key\":\n" + &line("stride 2"))), 2);
    assert_eq!(number("broken\n"), 1);
}

#[test]
fn lines_with_any_bit_flipped_or_nested_without_end_are_read_or_named_by_their_number() {
    let text = line("exact") + &line("stride 2");
    for bit in 0..8 * text.len() {
        let mut flipped = text.clone().into_bytes();
        flipped[bit / 8] ^= 1 << (bit % 8);
        match parse::<Line<String, Vec<f64>>>(&flipped) {
            Ok((lines, keep)) => assert!(lines.len() <= 2 && keep <= flipped.len(), "bit {bit}"),
            Err((number, _)) => assert!((1..=2).contains(&number), "bit {bit}: {number}"),
        }
    }
    for nested in ["[".repeat(1 << 20), "{\"key\":".repeat(1 << 18)] {
        let text = format!("{}{nested}\n", line("exact"));
        assert_eq!(parse::<Line<String, Vec<f64>>>(text.as_bytes()).expect_err("deep").0, 2);
    }
}

#[test]
fn a_journal_without_a_file_keeps_nothing() {
    let mut journal: Journal<String, u32> = Journal::open(None).expect("there is nothing to read");
    assert_eq!(journal.add("key".to_owned(), 7).expect("there is nothing to write"), 7);
    assert_eq!(journal.find(&"key".to_owned()), None);
}

#[cfg(unix)]
#[test]
fn a_device_or_a_folder_is_no_journal() {
    use std::path::Path;

    for (path, found) in [("/dev/zero", "found a device"), ("/dev", "found a folder")] {
        let error = Journal::<String, u32>::open(Some(Path::new(path))).expect_err(path).to_string();
        assert!(error.contains(path) && error.ends_with(found), "{error}");
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
