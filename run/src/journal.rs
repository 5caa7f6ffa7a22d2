//! Finished measurements in a file, one JSON object a line, so that none is made twice.
//!
//! A line is appended when a measurement finishes. A program that is stopped can leave a last line
//! without an end: it is cut off. Any other line that cannot be read is an error. Lines with keys
//! that nobody asks for stay.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::error::{Result, RunError};

/// A line of the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line<K, M> {
    /// Everything that determines the measurement.
    pub key: K,
    /// The measurement.
    pub measurement: M,
}

/// Measurements that an earlier process finished, and the file that keeps them.
#[derive(Debug)]
pub struct Journal<K, M> {
    /// Those in the file when it was opened: its memory does not grow.
    lines: Vec<Line<K, M>>,
    file: Option<(PathBuf, File)>,
}

impl<K, M> Journal<K, M>
where
    K: PartialEq + Serialize + DeserializeOwned,
    M: Serialize + DeserializeOwned,
{
    /// Reads the file at `path`, created if it is missing. Without a path, nothing is kept.
    ///
    /// # Errors
    /// The path leads to something other than a regular file, the file cannot be read or written,
    /// or one of its lines cannot be read.
    pub fn open(path: Option<&Path>) -> Result<Self> {
        let Some(path) = path else { return Ok(Self { lines: Vec::new(), file: None }) };
        // A device may have no end, and a pipe waits for its other side.
        meissner_io::check_replaceable(path).map_err(RunError::File)?;
        let failed = |source| RunError::file("write", path, source);
        let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(failed)?;
        let bytes = meissner_io::read_whole(path).map_err(RunError::File)?;
        let (lines, keep) = parse(&bytes).map_err(|(line, source)| RunError::Finished {
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

    /// The measurement with this key, if the file had it when it was opened. O(lines).
    pub fn find(&self, key: &K) -> Option<&M> {
        self.lines.iter().find(|line| line.key == *key).map(|line| &line.measurement)
    }

    /// Appends `measurement`, and returns it as a later read will return it.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn add(&mut self, key: K, measurement: M) -> Result<M> {
        let Some((path, file)) = &mut self.file else { return Ok(measurement) };
        let failed = |source| RunError::file("write", path.as_path(), source);
        let mut text = serde_json::to_vec(&Line { key, measurement }).map_err(|e| failed(e.into()))?;
        // A reader may round the last digit: the value reported now must equal the value read
        // later.
        let line: Line<K, M> = serde_json::from_slice(&text).map_err(|e| failed(e.into()))?;
        text.push(b'\n');
        file.write_all(&text).and_then(|()| file.flush()).map_err(failed)?;
        Ok(line.measurement)
    }
}

/// The lines and their number of bytes, without an unfinished last line.
pub(crate) fn parse<L: DeserializeOwned>(
    bytes: &[u8],
) -> Result<(Vec<L>, usize), (usize, serde_json::Error)> {
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
