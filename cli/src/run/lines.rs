//! Lines for people while a run goes on: some of a file's predictions, all of a live stream's, always the last one.

use std::io::{self, Write};

use crate::progress::Progress;
use meissner_pipeline::text::grouped;

/// About so many predictions of a file are shown.
const SHOWN: u64 = 40;

/// Writes lines, one a prediction.
pub(crate) struct Lines<W> {
    out: W,
    progress: Progress,
    /// How much there is to take, where that is known.
    total: Option<u64>,
    /// Which of [`SHOWN`] equal parts of the input the last line was in.
    part: Option<u64>,
    shown: u64,
    /// The newest line, where it has not been shown.
    held: Option<String>,
}

impl<W: Write> Lines<W> {
    /// Nothing yet; with `total`, about [`SHOWN`] lines will be shown, else all.
    pub(crate) fn new(out: W, total: Option<u64>, progress: Progress) -> Self {
        Self { out, progress, total, part: None, shown: 0, held: None }
    }

    pub(super) fn total(&self) -> Option<u64> {
        self.total
    }

    /// The line of a prediction after so much of the input.
    pub(crate) fn line(&mut self, taken: u64, line: String) -> io::Result<()> {
        let part = self.total.map(|total| taken.saturating_mul(SHOWN) / total.max(1));
        if part.is_some() && self.part == part {
            self.held = Some(line);
            return Ok(());
        }
        self.part = part;
        self.held = None;
        self.show(&line)
    }

    /// After the last of all `predictions`: the line that was held back, and how many were not shown.
    pub(crate) fn end(&mut self, predictions: u64) -> io::Result<&mut W> {
        if let Some(line) = self.held.take() {
            self.show(&line)?;
        }
        self.progress.finish();
        if self.shown < predictions {
            let (shown, all) = (grouped(self.shown), grouped(predictions));
            writeln!(self.out, "({shown} of {all} predictions shown; --json shows every one)")?;
        }
        Ok(&mut self.out)
    }

    fn show(&mut self, line: &str) -> io::Result<()> {
        self.shown += 1;
        let out = &mut self.out;
        self.progress.suspend(|| {
            writeln!(out, "{line}")?;
            out.flush()
        })
    }
}
