//! Networks over readings of 24 electrodes: CSV from a file or standard input, a prediction a window.
//!
//! A window's readings are pushed into a network whose state is that before the first frame, and the prediction is that
//! after the last of them. A row that is no reading is reported and begins a new window, because the readings around it
//! do not follow each other.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Write, stdin};
use std::path::Path;
use std::time::Instant;

use meissner_engine::representations::{TactileForm, TactileWindow};
use meissner_io::{ElectrodeSettings, Electrodes, IoError, Reading};
use meissner_kernels::softmax;
use meissner_models::FrameSource;
use meissner_models::description::frames::Readings;
use serde::Serialize;

use super::FrameModel;
use super::header::header;
use super::machine::Machine;
use super::report::Report;
use super::summary::{ElectrodeCounts, InputCounts, Summary};
use crate::error::CliError;
use crate::latency::microseconds;
use crate::progress::Progress;
use crate::run::RunArgs;
use crate::run::json::Values;
use crate::source;

/// The unit of values that a softmax makes into probabilities.
const LOGIT: &str = "logit";

/// A prediction, as programs see it.
#[derive(Serialize)]
struct Shown<'a> {
    line: u64,
    time_s: Option<f64>,
    value: Values<'a>,
    probabilities: Option<Values<'a>>,
    class: Option<&'a str>,
    update_us: f64,
}

pub(super) fn run(
    args: &RunArgs,
    model: &FrameModel,
    machine: Machine,
    readings: Readings,
) -> Result<(), CliError> {
    let network = &args.input.network;
    let path = args.input.recording.as_deref().ok_or_else(|| CliError::NoInput {
        network: network.clone(),
        expected: "CSV with a column for each of 24 electrodes, in a file or as -",
        found: "no INPUT",
    })?;
    let (name, live) = (path.display().to_string(), source::is_stdin(path));
    let name = if live { source::STDIN_NAME.to_owned() } else { name };
    let mut rows = Electrodes::new(open(path)?, ElectrodeSettings::default());
    // A header that does not fit is found before anything is printed.
    let mut first = next(&mut rows, &name)?;
    let form = match model.description.source() {
        FrameSource::TactileImage(_) => TactileForm::Image,
        _ => TactileForm::Reading,
    };
    let window = TactileWindow::new(readings.steps, readings.sampling, readings.scaling, form)
        .map_err(|source| CliError::Frames { network: network.clone(), source })?;
    let (names, unit) = model.description.outputs();
    let report = Report::new(args.json, live, None, Progress::new(None, args.json), |out| {
        let about = "CSV of 24 electrodes, 100 readings a second";
        header(out, args, model, machine.options(), &[&name, about])?;
        headings(out, names, unit)
    })?;
    let is_class = unit == LOGIT;
    let mut windows =
        Windows { machine, report, window, names, is_class, values: Vec::new(), probabilities: Vec::new() };

    let (mut taken, mut refused) = (0, 0);
    let limit = args.input.limit.unwrap_or(u64::MAX);
    while taken + refused < limit {
        let Some(row) = first.take() else { break };
        let problem = match row {
            Ok(reading) => windows.take(&reading)?.map(|problem| format!("line {}: {problem}", reading.line)),
            Err(error) => Some(error.to_string()),
        };
        match problem {
            None => taken += 1,
            Some(problem) => {
                refused += 1;
                windows.window.reset();
                eprintln!("warning: {name}: {problem}");
            }
        }
        if taken + refused < limit {
            first = next(&mut rows, &name)?;
        }
    }
    let warnings = rows.warnings();
    let counts = ElectrodeCounts {
        readings: taken,
        rows_refused: refused,
        values_out_of_range: warnings.values_out_of_range,
        rows_off_rate: warnings.rows_off_rate,
        steps: readings.steps,
    };
    let summary = Summary::new(&windows.machine, InputCounts::Electrodes(counts));
    Ok(windows.report.summary(&summary)?)
}

fn open(path: &Path) -> Result<Box<dyn BufRead>, CliError> {
    if source::is_stdin(path) {
        return Ok(Box::new(stdin().lock()));
    }
    let file = File::open(path).map_err(|source| CliError::Open { path: path.to_owned(), source })?;
    Ok(Box::new(BufReader::new(file)))
}

/// The next row: a reading, or what is wrong with it alone.
///
/// # Errors
/// What ends the rows.
fn next<R: BufRead>(
    rows: &mut Electrodes<R>,
    name: &str,
) -> Result<Option<Result<Reading, IoError>>, CliError> {
    match rows.next() {
        Some(Err(error)) if !matches!(error, IoError::Malformed { what: "row" | "field", .. }) => {
            Err(CliError::recording(name, error))
        }
        row => Ok(row),
    }
}

fn headings(out: &mut impl Write, names: &[String], unit: &str) -> io::Result<()> {
    write!(out, "{:>7}  {:>9}", "line", "time (s)")?;
    for name in names {
        let name = if unit == LOGIT { format!("p({name})") } else { format!("{name} ({unit})") };
        write!(out, "  {name:>8}")?;
    }
    let class = if unit == LOGIT { "  class   " } else { "" };
    writeln!(out, "{class}  {:>11}", "update (us)")
}

/// Readings into windows, windows into predictions.
struct Windows<'a> {
    machine: Machine,
    report: Report,
    window: TactileWindow,
    names: &'a [String],
    /// Whether the values are of classes.
    is_class: bool,
    values: Vec<f32>,
    probabilities: Vec<f32>,
}

impl Windows<'_> {
    /// Takes a reading; why it cannot be one, where it cannot.
    fn take(&mut self, reading: &Reading) -> Result<Option<String>, CliError> {
        let start = Instant::now();
        let sequence = self.window.push(&reading.values);
        self.machine.prepared(start.elapsed());
        let sequence = match sequence {
            Ok(None) => return Ok(None),
            Ok(Some(sequence)) => sequence,
            Err(error) => return Ok(Some(error.to_string())),
        };
        self.machine.reset();
        let [_, rows, columns] = sequence.shape;
        for frame in sequence.values.chunks_exact(rows * columns) {
            self.machine.push(frame)?;
        }
        let Self { machine, values, probabilities, .. } = self;
        machine.predict(|predicted| {
            values.clear();
            values.extend_from_slice(predicted.values);
            probabilities.clone_from(values);
            softmax(probabilities);
            Ok::<_, CliError>(())
        })?;
        self.show(reading)?;
        Ok(None)
    }

    fn show(&mut self, reading: &Reading) -> io::Result<()> {
        let update_us = microseconds(self.machine.take_update());
        let largest = self.probabilities.iter().enumerate().reduce(|a, b| if b.1 > a.1 { b } else { a });
        let class = largest.map(|(class, _)| self.names[class].as_str()).filter(|_| self.is_class);
        let line = Shown {
            line: reading.line,
            time_s: reading.time_s,
            value: Values(&self.values),
            probabilities: self.is_class.then_some(Values(&self.probabilities)),
            class,
            update_us,
        };
        self.report.prediction(reading.line, &line, |_| {
            let time = reading.time_s.map_or_else(|| "-".to_owned(), |s| format!("{s:.3}"));
            let shown = if self.is_class { &self.probabilities } else { &self.values };
            let values: Vec<String> = shown.iter().map(|value| format!("  {value:>8.6}")).collect();
            let values = values.concat();
            let class = class.map_or_else(String::new, |class| format!("  {class:<8}"));
            format!("{:>7}  {time:>9}{values}{class}  {update_us:>11.1}", reading.line)
        })
    }
}
