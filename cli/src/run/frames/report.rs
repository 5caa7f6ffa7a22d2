//! Predictions of frame networks as they are read, for people or for programs.

use std::io::{self, BufWriter, StdoutLock, Write};

use serde::Serialize;

use super::summary::Summary;
use crate::progress::Progress;
use crate::run::json::JsonLines;
use crate::run::lines::Lines;
use crate::text::Folded;
use meissner_pipeline::provenance::Header;

/// Writes to standard output.
pub(super) enum Report {
    Json(JsonLines<Out>),
    People(Lines<Out>),
}

pub(super) type Out = Folded<BufWriter<StdoutLock<'static>>>;

#[derive(Serialize)]
struct Last<'a> {
    summary: &'a Summary,
}

impl Report {
    /// A report on `total` things to take, where that is known; a `live` one shows each line at once. `begin` writes
    /// what stands above the predictions for people.
    pub(super) fn new(
        json: bool,
        live: bool,
        header: &Header,
        total: Option<u64>,
        progress: Progress,
        begin: impl FnOnce(&mut Out) -> io::Result<()>,
    ) -> io::Result<Self> {
        let mut out = Folded::new(BufWriter::new(io::stdout().lock()), !json);
        if json {
            let mut lines = JsonLines::new(out, live);
            lines.header(header)?;
            return Ok(Self::Json(lines));
        }
        begin(&mut out)?;
        out.flush()?;
        Ok(Self::People(Lines::new(out, total, progress)))
    }

    /// A prediction, after so much of the input has been taken; `text` is its line for people.
    pub(super) fn prediction(
        &mut self,
        taken: u64,
        line: &impl Serialize,
        text: impl FnOnce(Option<u64>) -> String,
    ) -> io::Result<()> {
        match self {
            Self::Json(lines) => lines.prediction(line),
            Self::People(lines) => {
                let text = text(lines.total());
                lines.line(taken, text)
            }
        }
    }

    pub(super) fn summary(&mut self, summary: &Summary) -> io::Result<()> {
        match self {
            Self::Json(lines) => lines.last(&Last { summary }),
            Self::People(lines) => {
                let out = lines.end(summary.predictions)?;
                summary.write(out)?;
                out.flush()
            }
        }
    }
}
