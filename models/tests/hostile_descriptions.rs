//! Descriptions that are damaged or request much: problems with lines, in bounded time and memory.

use super::support;

use std::error::Error;
use std::time::{Duration, Instant};

use meissner_models::{AnyDescription, Description, ModelError};
use support::{SMALL, SMALL_FRAMES, with_head};

/// Longest time for an input, whatever it requests; far more than any input here needs.
const CEILING: Duration = Duration::from_secs(10);

/// A file of repeated lines `line`, as long as the longest that is read, or a little longer.
fn longest(line: impl Fn(u32) -> String) -> String {
    let mut text = String::new();
    let mut count = 0;
    while text.len() < 1 << 18 {
        text.push_str(&line(count));
        count += 1;
    }
    text
}

/// Checks `text`; the problems of a refusal are brief and name lines of it, in order.
fn check(text: &str) -> bool {
    let start = Instant::now();
    let checked = AnyDescription::parse(text);
    assert!(start.elapsed() < CEILING, "{:?}: {:.80}", start.elapsed(), text);
    let Err(error) = checked else { return true };
    let lines = text.lines().count().max(1) + 1;
    let problems = error.problems();
    assert!(!problems.is_empty() && problems.iter().map(|problem| problem.line).is_sorted());
    for problem in problems {
        assert!((1..=lines).contains(&problem.line), "{problem}");
        assert!(problem.to_string().len() < 1000, "{:.600}", problem.to_string());
    }
    false
}

#[test]
fn a_description_cut_anywhere_or_with_any_bit_flipped_is_checked_or_refused_with_lines() {
    for text in [SMALL, SMALL_FRAMES, &with_head()] {
        assert!(check(text));
        for length in 0..text.len() {
            check(&text[..length]);
        }
        for bit in 0..8 * text.len() {
            let mut bytes = text.as_bytes().to_vec();
            bytes[bit / 8] ^= 1 << (bit % 8);
            if let Ok(text) = std::str::from_utf8(&bytes) {
                check(text);
            }
        }
    }
}

#[test]
fn an_absurd_number_anywhere_is_in_range_or_refused_with_its_line() {
    let absurd = [
        "9223372036854775807",
        "9223372036854775808",
        "-9223372036854775808",
        "18446744073709551615",
        "4294967295",
        "1e400",
        "nan",
        "-inf",
        "-0.0",
        "0x7fffffffffffffff",
        "1979-05-27",
        "[]",
        "{}",
        "\"9223372036854775807/9223372036854775807\"",
        "[\"1/9223372036854775807\", \"9223372036854775808/1\"]",
        "[9223372036854775807, 9223372036854775807]",
    ];
    for text in [SMALL, SMALL_FRAMES, &with_head()] {
        let lines: Vec<&str> = text.lines().collect();
        for (at, line) in lines.iter().enumerate() {
            let Some((key, _)) = line.split_once(" = ") else { continue };
            for value in absurd {
                let changed = format!("{key} = {value}");
                let with = |line: &str| [&lines[..at], &[line], &lines[at + 1..]].concat().join("\n");
                check(&with(&changed));
            }
        }
    }
}

#[test]
fn values_tables_and_keys_that_nest_without_end_are_refused() {
    let deep = |open: &str, close: &str| {
        let count = (1 << 17) / open.len();
        [open.repeat(count), format!("{}1{}", open.repeat(count), close.repeat(count))]
    };
    let dotted = "a.".repeat(1 << 17) + "a";
    let mut texts = vec![
        format!("{dotted} = 1"),
        format!("[{dotted}]"),
        format!("[[{dotted}]]"),
        format!("a = {{ {dotted} = 1 }}"),
        format!("{SMALL}\n[{dotted}]\n"),
    ];
    for (open, close) in [("[", "]"), ("{a=", "}"), ("[{a=", "}]")] {
        texts.extend(deep(open, close).map(|value| format!("a = {value}")));
        texts.extend(deep(open, close).map(|value| SMALL.replacen("k = 4", &format!("k = {value}"), 1)));
    }
    for text in &texts {
        assert!(!check(text), "{text:.40}");
    }
}

#[test]
fn a_longest_file_of_nothing_but_problems_is_refused_in_seconds() {
    let tables = |table: &'static str| move |i| format!("[[{table}]]\nname = \"c{i}\"\nkind = \"conv\"\n");
    for text in [
        longest(|_| "=\n".to_owned()),
        longest(|_| "a = 1\n".to_owned()),
        longest(|i| format!("a{i:x} = 1\n")),
        longest(|i| format!("[a{i:x}]\n")),
        longest(|i| format!("[a.b{i:x}]\n")),
        longest(|i| format!("a.b{i:x} = 1\n")),
        longest(|_| "\"".to_owned()),
        longest(|_| "\"\"\"".to_owned()),
        longest(|_| "[".to_owned()),
        longest(|_| "# \n".to_owned()),
        longest(|_| "\u{0}".to_owned()),
        longest(|_| "[[layer]]\n".to_owned()),
        longest(tables("layer")),
        format!("{SMALL}{}", longest(tables("layer"))),
        format!("{SMALL_FRAMES}{}", longest(tables("layer"))),
        format!("{SMALL}{}", longest(tables("head"))),
        format!("{SMALL}{}", longest(|i| format!("u{i:x} = 1\n"))),
        format!("layer = [{}]", longest(|_| "1,".to_owned())),
        format!("a = {{{}}}", longest(|i| format!("b{i:x}=1,"))),
        SMALL.replacen("name = \"small\"", &format!("name = \"{}\"", longest(|_| "n".to_owned())), 1),
        SMALL.replacen("k = 4", &format!("k = {}", longest(|_| "4".to_owned())), 1),
        SMALL.replacen("k = 4", &format!("k = 0.{}", longest(|_| "4".to_owned())), 1),
        SMALL.replacen("k = 4", &format!("{} = 4", longest(|_| "k".to_owned())), 1),
        SMALL.replacen("[\"roll\"]", &format!("[{}]", longest(|_| "\"n\",".to_owned())), 1),
        SMALL.replacen("[2, 3]", &format!("[{}]", longest(|_| "2,".to_owned())), 1),
    ] {
        assert!(!check(&text), "{text:.40}");
    }
}

#[test]
fn a_file_that_is_too_long_or_no_text_is_refused_with_its_place() {
    let folder = tempfile::tempdir().expect("a place for temporary files");
    let path = folder.path().join("own.toml");
    let load = |content: &[u8]| {
        std::fs::write(&path, content).expect("a place to write to");
        let error = AnyDescription::load(&path).expect_err("refused");
        assert_eq!(Description::load(&path).expect_err("refused").to_string(), error.to_string());
        error
    };
    let long = format!("{SMALL}{}", longest(|_| "# a remark\n".to_owned()));
    let error = load(long.as_bytes());
    assert!(matches!(error, ModelError::Large { limit: 262_144, found, .. } if found == long.len() as u64));
    assert!(error.to_string().contains("own.toml: expected at most 262144 bytes, found"), "{error}");
    let error = load(&[SMALL.as_bytes(), b"# caf\xe9\n"].concat());
    let source = error.source().expect("why").to_string();
    let expected = format!("expected text in UTF-8, found other bytes at byte {}", SMALL.len() + 5);
    assert!(error.to_string().ends_with("own.toml") && source == expected, "{error}: {source}");
}

#[test]
fn a_file_of_nothing_but_one_fault_names_it_once_or_a_few_times_and_counts_the_rest() {
    for text in ["\0".repeat(260_000), "\0\n".repeat(130_000), "\u{1}\0".repeat(100_000)] {
        let error = AnyDescription::parse(&text).expect_err("no description").to_string();
        let mut lines: Vec<_> = error.lines().collect();
        assert!(error.len() < 10_000 && lines.len() <= 51, "{} bytes, {} lines", error.len(), lines.len());
        let all = lines.len();
        lines.dedup();
        assert_eq!(lines.len(), all, "{error}");
    }
    let many = AnyDescription::parse(&"\0\n".repeat(1000)).expect_err("no description").to_string();
    assert!(many.contains("problems more"), "{many}");
}
