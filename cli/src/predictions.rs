//! The output of `run` and `play`: JSON lines for programs, or a table with a summary for people.
//!
//! The table shows some predictions of a file, all of a live stream, and always the last one.

mod rows;
pub(crate) mod summary;

use std::collections::BTreeMap;
use std::io::{self, Write};

use meissner_run::error::{RunError, chain};
use meissner_run::model::FrameModel;
use meissner_run::play::PlaySummary;
use meissner_run::provenance::{Header, InputCard, ModelCard};
use meissner_run::run::{Ended, Observer, Prediction, Summary};
use meissner_run::text::grouped;
use rows::{Columns, Row};
use serde::Serialize;

use crate::error::CliError;
use crate::output::{Out, out};
use crate::progress::{Progress, above};
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
    /// The number of equal parts of the input, each of which shows a prediction.
    parts: u64,
    /// The part of the last shown row, and the amount of input that had been taken then.
    part: Option<u64>,
    taken: Option<u64>,
    shown: u64,
    /// The newest rows, if they have not been shown: one for each input.
    held: Vec<Row>,
}

/// A value about an input of a play.
#[derive(Serialize)]
struct Of<'a, T> {
    /// Its number, from 0.
    input: usize,
    #[serde(flatten)]
    about: &'a T,
}

/// The subject of a report.
pub(crate) struct About<'a> {
    /// The subcommand.
    pub(crate) command: &'static str,
    pub(crate) json: bool,
    /// Whether each prediction is written immediately.
    pub(crate) live: bool,
    /// One, or the inputs of the sensors of a play.
    pub(crate) inputs: Vec<InputCard>,
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
        let About { command, json, live, inputs, card, mode, frames, table, total } = about;
        let headers = inputs.iter().map(|input| Header::new(command, input.clone(), card.clone()));
        let headers: Vec<_> = headers.inspect(Header::warn).collect();
        let mut out = out(json);
        let form = if json {
            for header in &headers {
                line(&mut out, &BTreeMap::from([("header", header)]))?;
            }
            if live {
                out.flush()?;
            }
            Form::Json { live }
        } else {
            let columns = Columns::new(table, card, inputs.len(), total.is_some());
            header(&mut out, &inputs, card, &mode, frames)?;
            writeln!(out, "{}", columns.headings())?;
            out.flush()?;
            let parts = (SHOWN / inputs.len().max(1) as u64).max(2);
            Form::People(Rows { columns, parts, part: None, taken: None, shown: 0, held: Vec::new() })
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

    /// Writes the summaries of the inputs of a play, or their errors.
    pub(crate) fn end_play(mut self, ended: &[Result<PlaySummary, RunError>]) -> io::Result<()> {
        if let [Ok(summary)] = ended {
            return self.summary(&Of { input: 0, about: summary }, summary.reports.made, |out| {
                summary::play(out, summary)
            });
        }
        if let Form::Json { .. } = self.form {
            for (input, ended) in ended.iter().enumerate() {
                match ended {
                    Ok(about) => line(&mut self.out, &BTreeMap::from([("summary", Of { input, about })]))?,
                    Err(error) => {
                        let about = BTreeMap::from([("error", chain(error))]);
                        line(&mut self.out, &BTreeMap::from([("failed", Of { input, about: &about })]))?;
                    }
                }
            }
            return self.out.flush();
        }
        let made = ended.iter().flatten().map(|summary| summary.reports.made).sum();
        self.summary(&(), made, |out| summary::plays(out, ended))
    }

    fn summary(
        &mut self,
        summary: &impl Serialize,
        predictions: u64,
        write: impl FnOnce(&mut Out) -> io::Result<()>,
    ) -> io::Result<()> {
        let Self { out, progress, total, form } = self;
        match form {
            Form::Json { .. } => line(out, &BTreeMap::from([("summary", summary)]))?,
            Form::People(rows) => {
                for row in std::mem::take(&mut rows.held) {
                    rows.show(out, &row, *total)?;
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
                let row = rows.columns.row(prediction);
                let taken = row.taken;
                let part = total.map(|total| taken.saturating_mul(rows.parts) / total.max(1));
                rows.held.retain(|before| before.taken == taken);
                if part.is_some() && rows.part == part && rows.taken != Some(taken) {
                    rows.held.push(row);
                    return Ok(());
                }
                (rows.part, rows.taken) = (part, Some(taken));
                rows.held.clear();
                rows.show(out, &row, *total)
            }
        }
    }

    fn progress(&mut self, taken: u64) {
        self.progress.set(taken);
    }
}

impl Rows {
    fn show(&mut self, out: &mut Out, row: &Row, total: Option<u64>) -> io::Result<()> {
        self.shown += 1;
        let text = self.columns.text(row, total);
        above(|| {
            writeln!(out, "{text}")?;
            out.flush()
        })
    }
}

fn line(out: &mut Out, line: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer(&mut *out, line)?;
    out.write_all(b"\n")
}

/// Writes the inputs, the network with its `mode`, the weights, and the window or the frames.
/// `frames` is given for a frame network.
pub(crate) fn header(
    out: &mut impl Write,
    inputs: &[InputCard],
    card: &ModelCard,
    mode: &str,
    frames: Option<&FrameModel>,
) -> io::Result<()> {
    for (number, input) in inputs.iter().enumerate() {
        let sensor = input.sensor.map(|[width, height]| format!(", {width}x{height} pixels"));
        let events = input.events.map(|events| format!(", {} events", grouped(events)));
        let about = [Some(input.format.clone()), sensor, events].into_iter().flatten().collect::<String>();
        let key = if inputs.len() > 1 {
            format!("input {number}")
        } else {
            if frames.is_some() { "input" } else { "recording" }.to_owned()
        };
        writeln!(out, "{key:<12} {}\n             {about}", input.name)?;
    }
    // If there are several inputs, each has its sensor beside it.
    let sensor = if let [input] = inputs { input.sensor } else { None };
    write_model(out, card, mode, sensor.filter(|_| frames.is_none()))?;
    if let Some(model) = frames {
        writeln!(out, "frames       {}: {}", model.description.input(), model.source)?;
    }
    writeln!(out)
}

/// Writes the lines of network and weights: the network, its sensor, and its training.
pub(crate) fn write_model(
    out: &mut impl Write,
    card: &ModelCard,
    mode: &str,
    sensor: Option<[u16; 2]>,
) -> io::Result<()> {
    let on = sensor.map_or_else(String::new, |[width, height]| format!(" on {width}x{height} pixels"));
    writeln!(out, "network      {}{on}, weights {}", card.network.name, card.trust())?;
    writeln!(out, "             {mode}")?;
    writeln!(out, "weights      {}", card.source())?;
    if let (Some(span_us), Some(capacity)) = (card.network.span_us, card.network.capacity) {
        let capacity = grouped(capacity as u64);
        writeln!(out, "window       {} ms, at most {capacity} events", span_us as f64 / 1e3)?;
    }
    Ok(())
}
