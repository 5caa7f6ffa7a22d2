//! The output of `run` and `play`: JSON lines for programs, or a table with a summary for people.
//!
//! The table shows some of the predictions of a file, all predictions of a live stream, and always the last one.

mod rows;
pub(crate) mod summary;

use std::collections::BTreeMap;
use std::io::{self, Write};

use meissner_pipeline::model::FrameModel;
use meissner_pipeline::play::PlaySummary;
use meissner_pipeline::provenance::{Header, InputCard, ModelCard};
use meissner_pipeline::run::{Ended, Observer, Prediction, Summary};
use meissner_pipeline::text::grouped;
use serde::Serialize;

use crate::error::CliError;
use crate::header;
use crate::output::{Out, out};
use crate::progress::{Progress, above};
use rows::Columns;
pub(crate) use rows::TableKind;

/// Approximate number of predictions of a file that the table shows.
const SHOWN: u64 = 40;

/// Writes the predictions of a run and its summary.
pub(crate) struct Report {
    out: Out,
    progress: Progress,
    /// The size of the input, if it is known.
    total: Option<u64>,
    form: Form,
}

enum Form {
    /// JSON lines; each is flushed if the stream is live.
    Json {
        live: bool,
    },
    People(Rows),
}

/// Rows for people.
struct Rows {
    columns: Columns,
    /// The part of the input that the last row was in, of [`SHOWN`] equal parts.
    part: Option<u64>,
    shown: u64,
    /// The newest row, if it has not been shown.
    held: Option<String>,
}

/// The subject of a report.
pub(crate) struct About<'a> {
    /// The subcommand.
    pub(crate) command: &'static str,
    pub(crate) json: bool,
    /// Whether each prediction is written at once.
    pub(crate) live: bool,
    pub(crate) input: InputCard,
    pub(crate) card: &'a ModelCard,
    /// How the network runs.
    pub(crate) mode: String,
    /// The network, if it is a frame network.
    pub(crate) frames: Option<&'a FrameModel>,
    pub(crate) table: TableKind,
    /// The size of the input, if it is known and not every prediction is shown.
    pub(crate) total: Option<u64>,
}

impl Report {
    /// Begins a report, and logs warnings about the network and its input.
    pub(crate) fn begin(about: About<'_>) -> Result<Self, CliError> {
        let About { command, json, live, input, card, mode, frames, table, total } = about;
        let header = Header::new(command, input.clone(), card.clone());
        header.warn();
        let mut out = out(json);
        let form = if json {
            line(&mut out, &BTreeMap::from([("header", &header)]))?;
            if live {
                out.flush()?;
            }
            Form::Json { live }
        } else {
            let columns = Columns::new(table, card);
            header::header(&mut out, &input, card, &mode, frames)?;
            writeln!(out, "{}", columns.headings())?;
            out.flush()?;
            Form::People(Rows { columns, part: None, shown: 0, held: None })
        };
        let progress = Progress::new(total.filter(|_| !live), json);
        Ok(Self { out, progress, total, form })
    }

    /// Writes the summary of a run, if standard output can still be written to.
    pub(crate) fn end(mut self, ended: Ended) -> Result<(), CliError> {
        self.progress.finish();
        let result = ended.result.map_err(CliError::from);
        if matches!(result, Err(CliError::Output(_))) {
            return result;
        }
        let written = match &ended.summary {
            Summary::Events(summary) => {
                self.summary(&**summary, summary.predictions, |out| summary::events(out, summary))
            }
            Summary::Frames(summary) => {
                self.summary(&**summary, summary.predictions, |out| summary::frames(out, summary))
            }
            _ => Ok(()),
        };
        result.and(written.map_err(CliError::from))
    }

    /// Writes the summary of a play.
    pub(crate) fn end_play(mut self, summary: &PlaySummary) -> io::Result<()> {
        self.summary(summary, summary.reports.made, |out| summary::play(out, summary))
    }

    fn summary(
        &mut self,
        summary: &impl Serialize,
        predictions: u64,
        write: impl FnOnce(&mut Out) -> io::Result<()>,
    ) -> io::Result<()> {
        let Self { out, progress, form, .. } = self;
        match form {
            Form::Json { .. } => line(out, &BTreeMap::from([("summary", summary)]))?,
            Form::People(rows) => {
                if let Some(row) = rows.held.take() {
                    rows.show(out, &row)?;
                }
                progress.finish();
                if rows.shown < predictions {
                    let (shown, all) = (grouped(rows.shown), grouped(predictions));
                    writeln!(out, "({shown} of {all} predictions shown; --json shows every one)")?;
                }
                if let Some(left_out) = rows.columns.left_out() {
                    writeln!(out, "{left_out}")?;
                }
                write(out)?;
            }
        }
        out.flush()
    }
}

impl Observer for Report {
    fn prediction(&mut self, prediction: &Prediction<'_>) -> io::Result<()> {
        let Self { out, total, form, .. } = self;
        match form {
            Form::Json { live } => {
                line(out, prediction)?;
                if *live { out.flush() } else { Ok(()) }
            }
            Form::People(rows) => {
                let (taken, row) = rows.columns.row(prediction, *total);
                let part = total.map(|total| taken.saturating_mul(SHOWN) / total.max(1));
                if part.is_some() && rows.part == part {
                    rows.held = Some(row);
                    return Ok(());
                }
                (rows.part, rows.held) = (part, None);
                rows.show(out, &row)
            }
        }
    }

    fn progress(&mut self, taken: u64) {
        self.progress.set(taken);
    }
}

impl Rows {
    fn show(&mut self, out: &mut Out, row: &str) -> io::Result<()> {
        self.shown += 1;
        above(|| {
            writeln!(out, "{row}")?;
            out.flush()
        })
    }
}

fn line(out: &mut Out, line: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer(&mut *out, line)?;
    out.write_all(b"\n")
}
