//! Reports to the user the parts of a recording or a text that are left out, and its assumptions.
//!
//! Lines of a text that cannot be read are logged, counted and skipped. Input: the problem of each
//! line. Output: a warning for each of the first [`LINES_TOLD`] lines, the total number, and an
//! error if a line cannot be skipped: any line of a strict source, or most lines of a text.

use std::path::Path;

use meissner_io::{LeftOut, LeftOutKind, Recording, is_mostly_refused};
use serde::Serialize;

use crate::error::{Result, RunError};
use crate::losses::LINES_TOLD;
use crate::streams;
use crate::text::grouped;

/// The parts that were left out of a recording for one reason.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOutSummary {
    /// `outside_sensor`, `other_words`, `other_events`, `malformed` or `lines`.
    kind: &'static str,
    count: u64,
    /// The first of them, with its place.
    first: String,
}

impl From<&LeftOut> for LeftOutSummary {
    fn from(left_out: &LeftOut) -> Self {
        let first = left_out.first.first().cloned().unwrap_or_default();
        Self { kind: left_out.kind.name(), count: left_out.count, first }
    }
}

/// A sentence about the omitted parts.
pub fn sentence(LeftOut { kind, count, first }: &LeftOut) -> String {
    let first = first.first().map_or_else(String::new, |first| format!("; the first: {first}"));
    format!("{} {kind} left out{first}", grouped(*count))
}

/// Logs the omitted parts of the recording called `name`, and the assumptions about it.
pub(crate) fn warn(name: &str, recording: &Recording) {
    for assumed in &recording.assumed {
        tracing::warn!("{name}: {assumed}");
    }
    for left_out in &recording.left_out {
        if left_out.kind != LeftOutKind::Lines {
            tracing::warn!("{name}: {}", sentence(left_out));
            continue;
        }
        for problem in &left_out.first {
            tracing::warn!("{name}: {problem}");
        }
        if left_out.count > left_out.first.len() as u64 {
            tracing::warn!("{name}: more are refused; the summary says how many");
        }
    }
}

/// Number of lines from the start of a text, of which at most half may be refused. Otherwise the
/// text probably has a different format. For a shorter text, all lines count.
pub(crate) const FIRST: u64 = 100;

/// Counts of the refused and the taken lines of a text.
#[derive(Debug)]
pub(crate) struct LineErrors {
    name: String,
    strict: bool,
    /// Whether any sender can send lines: then most lines may be refused.
    of_anybody: bool,
    taken: u64,
    count: u64,
    /// Problems of the first lines until a line is taken: the format may be a different one.
    held: Vec<String>,
    first: String,
}

impl LineErrors {
    /// Counts for the text called `name`. With `strict`, the first refused line is an error.
    pub(crate) fn new(name: &str, strict: bool) -> Self {
        let (name, held, first) = (name.to_owned(), Vec::new(), String::new());
        Self { name, strict, of_anybody: false, taken: 0, count: 0, held, first }
    }

    /// Counts for the file or stream `path`. Any number of datagrams may be refused.
    pub(crate) fn of(path: &Path, strict: bool) -> Self {
        let of_anybody = streams::is_of_datagrams(path);
        Self { of_anybody, ..Self::new(&streams::name(path), strict) }
    }

    /// Counts for the stream `path`. In raw bytes of any quality, any number of words may be
    /// refused.
    pub(crate) fn of_stream(path: &Path, is_raw: bool, strict: bool) -> Self {
        let refusals = Self::of(path, strict);
        Self { of_anybody: refusals.of_anybody || is_raw, ..refusals }
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    pub(crate) fn taken(&self) -> u64 {
        self.taken
    }

    pub(crate) fn take(&mut self) {
        self.taken += 1;
        for held in std::mem::take(&mut self.held) {
            self.warn(&held);
        }
    }

    /// Counts a line that is refused because of `problem`, which names the line.
    pub(crate) fn refuse(&mut self, problem: String) -> Result<()> {
        if self.strict {
            return Err(RunError::Line { recording: self.name.clone(), problem });
        }
        self.count += 1;
        if self.count == 1 {
            self.first.clone_from(&problem);
        }
        let problem = match self.count {
            ..=LINES_TOLD => Some(problem),
            count if count == LINES_TOLD + 1 => {
                Some("more are refused; the summary says how many".to_owned())
            }
            _ => None,
        };
        match problem {
            Some(problem) if self.taken == 0 && !self.of_anybody => self.held.push(problem),
            Some(problem) => self.warn(&problem),
            None => {}
        }
        if !self.of_anybody && is_mostly_refused(self.count, self.taken, false) {
            Err(self.most(FIRST))
        } else {
            Ok(())
        }
    }

    /// Ends the text.
    pub(crate) fn end(&self) -> Result<()> {
        let lines = self.taken + self.count;
        if !self.of_anybody && is_mostly_refused(self.count, self.taken, true) {
            Err(self.most(lines))
        } else {
            Ok(())
        }
    }

    /// The refused lines in the form of a reader of files.
    pub(crate) fn left_out(&self) -> Vec<LeftOut> {
        let lines = LeftOut { kind: LeftOutKind::Lines, count: self.count, first: vec![self.first.clone()] };
        if self.count > 0 { vec![lines] } else { Vec::new() }
    }

    fn warn(&self, problem: &str) {
        tracing::warn!("{}: {problem}", self.name);
    }

    fn most(&self, lines: u64) -> RunError {
        let counts = format!("{} of the first {} lines are refused", grouped(self.count), grouped(lines));
        let problem = if lines == 1 { self.first.clone() } else { format!("{counts}; {}", self.first) };
        RunError::Lines { recording: self.name.clone(), problem }
    }
}
