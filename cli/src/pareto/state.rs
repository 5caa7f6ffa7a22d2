//! Finished measurements in a file, one JSON object a line, so that nothing is measured twice.
//!
//! Lines are appended as measurements finish. A last line without its end, which a program that was stopped leaves, is cut
//! off; any other line that cannot be read is an error. Lines of other systems, networks, data or versions stay.

use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::measurement::Measurement;
use crate::error::CliError;
use meissner_pipeline::PipelineError;

/// What a measurement is of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Key {
    pub(super) system: String,
    pub(super) network: String,
    /// Fingerprint of network and weights.
    pub(super) weights: String,
    pub(super) setting: String,
    /// Fingerprint of the data.
    pub(super) data: String,
    /// What else reaches a figure.
    pub(super) options: String,
    pub(super) version: String,
}

/// A line of the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Line {
    key: Key,
    measurement: Measurement,
}

/// What is known, and where it is kept.
#[derive(Debug, Default)]
pub(super) struct State {
    lines: Vec<Line>,
    file: Option<(PathBuf, File)>,
}

impl State {
    /// Reads the file at `path`, which is made where it does not exist; without one, nothing is kept.
    pub(super) fn open(path: Option<&Path>) -> Result<Self, CliError> {
        let Some(path) = path else { return Ok(Self::default()) };
        let failed = |source| CliError::Write { path: path.to_owned(), source };
        let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(failed)?;
        let bytes = fs::read(path).map_err(|source| PipelineError::Open { path: path.to_owned(), source })?;
        let (lines, keep) = parse(&bytes).map_err(|(line, source)| CliError::State {
            path: path.to_owned(),
            line,
            source,
        })?;
        file.set_len(keep as u64).map_err(failed)?;
        if bytes[..keep].last().is_some_and(|&last| last != b'\n') {
            file.write_all(b"\n").map_err(failed)?;
        }
        Ok(Self { lines, file: Some((path.to_owned(), file)) })
    }

    /// The measurement of `key`.
    pub(super) fn find(&self, key: &Key) -> Option<&Measurement> {
        self.lines.iter().find(|line| line.key == *key).map(|line| &line.measurement)
    }

    /// Keeps `measurement`, and returns it as it will be read.
    pub(super) fn add(&mut self, key: Key, measurement: Measurement) -> Result<Measurement, CliError> {
        let Some((path, file)) = &mut self.file else { return Ok(measurement) };
        let failed = |source| CliError::Write { path: path.clone(), source };
        let mut text = serde_json::to_vec(&Line { key, measurement }).map_err(|e| failed(e.into()))?;
        // A reader may round the last digit: a run that goes on must report what one that did not stop would.
        let line: Line = serde_json::from_slice(&text).map_err(|e| failed(e.into()))?;
        text.push(b'\n');
        file.write_all(&text).and_then(|()| file.flush()).map_err(failed)?;
        let measurement = line.measurement.clone();
        self.lines.push(line);
        Ok(measurement)
    }
}

/// The lines, and how many bytes they take: all, but for a last line that was not finished. Else the number of the first
/// line that cannot be read.
fn parse(bytes: &[u8]) -> Result<(Vec<Line>, usize), (usize, serde_json::Error)> {
    let mut lines = Vec::new();
    let mut begin = 0;
    for (number, text) in (1..).zip(bytes.split_inclusive(|&byte| byte == b'\n')) {
        let finished = text.last() == Some(&b'\n');
        if !text.trim_ascii().is_empty() {
            match serde_json::from_slice(text) {
                Ok(line) => lines.push(line),
                Err(_) if !finished => return Ok((lines, begin)),
                Err(error) => return Err((number, error)),
            }
        }
        begin += text.len();
    }
    Ok((lines, begin))
}

#[cfg(test)]
mod tests {
    use super::{Key, Line, parse};
    use crate::pareto::measurement::Measurement;
    use crate::pareto::numerical::Differences;
    use crate::pareto::timing::{Lap, Timing};

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
        let measurement = Measurement {
            timed: 10,
            entered: 1.0,
            timing: Timing::of(&[(Lap::default(), Lap::default())]),
            rows: 0.5,
            multiply_adds: 1e6,
            numerical: Differences::default().finish(),
            task: Vec::new(),
        };
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
}
