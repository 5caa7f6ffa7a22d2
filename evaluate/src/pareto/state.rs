//! Finished measurements in a file, one JSON object a line, so that nothing is measured twice.
//!
//! A line is appended when a measurement finishes. A program that is stopped can leave a last line
//! without an end: it is cut off. Any other line that cannot be read is an error. Lines of other
//! systems, networks, data or versions stay.

use std::fs::{File, OpenOptions};
use std::hash::Hasher;
use std::io::Write;
use std::path::{Path, PathBuf};

use fnv::FnvHasher;
use meissner_engine::Event;
use meissner_models::Weights;
use meissner_run::RunError;
use serde::{Deserialize, Serialize};

use super::measurement::Measurement;
use crate::error::{EvaluateError, Result};

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Key {
    pub(super) system: String,
    pub(super) network: String,
    /// Fingerprint of network and weights.
    pub(super) weights: String,
    pub(super) setting: String,
    /// Fingerprint of the data.
    pub(super) data: String,
    /// Timed events, windows, pictures or recordings, repeats, instruction set.
    pub(super) options: String,
    pub(super) version: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Line {
    pub(super) key: Key,
    pub(super) measurement: Measurement,
}

/// Finished measurements, and the file that keeps them.
#[derive(Debug, Default)]
pub struct State {
    lines: Vec<Line>,
    file: Option<(PathBuf, File)>,
}

impl State {
    /// Reads the file at `path`, created if it is missing. Without a path, nothing is kept.
    ///
    /// # Errors
    /// The file cannot be read or written, or one of its lines cannot be read.
    pub fn open(path: Option<&Path>) -> Result<Self> {
        let Some(path) = path else { return Ok(Self::default()) };
        let failed = |source| EvaluateError::Write { path: path.to_owned(), source };
        let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(failed)?;
        let bytes = meissner_io::read_whole(path).map_err(RunError::File)?;
        let (lines, keep) = parse(&bytes).map_err(|(line, source)| EvaluateError::State {
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

    pub(super) fn find(&self, key: &Key) -> Option<&Measurement> {
        self.lines.iter().find(|line| line.key == *key).map(|line| &line.measurement)
    }

    /// Appends `measurement`, and returns it as it will be read.
    pub(super) fn add(&mut self, key: Key, measurement: Measurement) -> Result<Measurement> {
        let Some((path, file)) = &mut self.file else { return Ok(measurement) };
        let failed = |source| EvaluateError::Write { path: path.clone(), source };
        let mut text = serde_json::to_vec(&Line { key, measurement }).map_err(|e| failed(e.into()))?;
        // A reader may round the last digit: what is reported now must be what is read later.
        let line: Line = serde_json::from_slice(&text).map_err(|e| failed(e.into()))?;
        text.push(b'\n');
        file.write_all(&text).and_then(|()| file.flush()).map_err(failed)?;
        let measurement = line.measurement.clone();
        self.lines.push(line);
        Ok(measurement)
    }
}

/// The lines and their number of bytes, without a last line that was not finished.
pub(super) fn parse(bytes: &[u8]) -> Result<(Vec<Line>, usize), (usize, serde_json::Error)> {
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

/// Fingerprint of networks, weights and data: FNV-1a with 64 bits. It does not withstand forgery.
#[derive(Default)]
pub(super) struct Fingerprint(FnvHasher);

impl Fingerprint {
    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        self.0.write(bytes);
    }

    /// Adds a text with its length, so that two texts differ from their concatenation.
    pub(super) fn text(&mut self, text: &str) {
        self.bytes(&(text.len() as u64).to_le_bytes());
        self.bytes(text.as_bytes());
    }

    pub(super) fn floats(&mut self, values: &[f32]) {
        values.iter().for_each(|value| self.bytes(&value.to_bits().to_le_bytes()));
    }

    pub(super) fn events(&mut self, events: &[Event]) {
        self.bytes(&(events.len() as u64).to_le_bytes());
        for event in events {
            self.bytes(&event.t_us.to_le_bytes());
            self.bytes(&event.x.to_le_bytes());
            self.bytes(&event.y.to_le_bytes());
            self.bytes(&[u8::from(event.on)]);
        }
    }

    /// Adds all tensors by name, without the metadata.
    pub(super) fn weights(&mut self, weights: &Weights) {
        for (name, tensor) in weights.iter() {
            self.text(name);
            tensor.shape().iter().for_each(|&side| self.bytes(&(side as u64).to_le_bytes()));
            self.floats(tensor.values().unwrap_or_default());
        }
    }

    /// The fingerprint, as 16 hexadecimal digits.
    pub(super) fn finish(self) -> String {
        format!("{:016x}", self.0.finish())
    }
}
