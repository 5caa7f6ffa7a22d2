//! `meissner prepare presses`: recordings and labels that users made themselves.

#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Arg;
use meissner_evaluate::prepare::labelled_presses;
use meissner_evaluate::presses::{
    ClockFit, DEFAULT_MAX_GAP_US, LabelSummary, Offset, OffsetSource, Options, Presses,
};
use meissner_run::text::{display_us, grouped, signed_us, span_us};

use crate::args::{INPUT, OUTPUT, ReadArgs};
use crate::error::CliError;
use crate::output::{Force, check_result, out, write};
use crate::progress::Progress;
use crate::stderr::tell;
use crate::text::{NONE, Table, cell, columns, duration};

/// The table, and the tensors of the file.
const LABELS: &str = "\
The table of labels is CSV with a header. Its columns:
  recording     the file's name in the folder, with or without its extension
  t_us          time on the clock of the events; also t_s, t_ms, t_ns. Without
                it, a row is about a whole recording: a class holds from its
                begin to its end, a number at its last event
  host_us       time on the host's clock instead; also host_s, host_ms, host_ns
  roll_deg ...  any other column is a label: a name, and the unit at its end
                (roll_deg, force_n, x_mm, depth_um) or in brackets (force [N]).
                Values that are no numbers are classes, as is a column `class`
A table of host_us without `recording` is a log of poses over all recordings;
those at the ends of a press are interpolated. Commas, semicolons (then also
with decimal commas) or tabs separate the columns.

Host times need the offset of the clocks: --offset, or `recordings.csv` in the
folder (recording,first_us,last_us,events,host_us), as `meissner record` writes
it. The rate of events is compared with the speed of the poses, which shows a
wrong offset and clocks that drift apart.

Tensors of --out, for P presses:
  t_us, x, y, on  I64 (events): as `prepare digits` writes them
  start           I64 (P + 1): press i has the events from start[i] to below
                  start[i + 1]
  truth.t_us      I64 (T), truth.start I64 (P + 1): the labelled instants
  truth.NAME      F32 (T): each label of numbers, for `eval angle`
  label           I64 (P): index into classes; of further labels of classes
                  label.NAME and classes.NAME
  fold            I64 (P): part of a cross-validation; split is 0 for all
Metadata, each JSON: recordings, sensor, classes, units {NAME: unit}

Examples:
  meissner prepare presses mine/
  meissner prepare presses mine/ --labels robot.csv --offset -1.25s
  meissner prepare presses mine/ --out mine.safetensors
  meissner eval angle mine.safetensors --network tactigraph-past";

/// Presses of a folder, and their labels.
#[derive(Debug, clap::Args)]
pub(crate) struct PressInput {
    /// Folder of recordings, each of one press, also in folders in it.
    ///
    /// Or a file of presses (safetensors) with labels, as `meissner prepare` and `simulate markers`
    /// write it. Presses of its split test are left out.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    /// Table of labels (CSV) [default: labels.csv in the folder].
    #[arg(long, value_name = "FILE", help_heading = INPUT)]
    labels: Option<PathBuf>,
    /// Time that is added to times of the labels to get the sensor's.
    ///
    /// It may be negative. Without this option, it is the median of first_us - host_us in
    /// recordings.csv, or 0. Where the clock restarts with each recording, each has its own, and
    /// this one is added to all of them.
    #[arg(long, value_name = "TIME", value_parser = signed_us, allow_hyphen_values = true, help_heading = INPUT)]
    offset: Option<i64>,
    /// Longest time between labels that are interpolated.
    ///
    /// A label this much before or after the events of its recording still counts: a press may be
    /// silent at its ends.
    #[arg(long, value_name = "TIME", value_parser = span_us, default_value = "100ms", help_heading = INPUT)]
    max_gap: i64,
    #[command(flatten)]
    read: ReadArgs,
}

impl PressInput {
    /// Reads the presses and reports oddities, which are an error with `--strict`.
    pub(crate) fn read(&self) -> Result<Presses, CliError> {
        let progress = Progress::busy(|| "reading recordings".to_owned());
        let options = Options {
            labels: self.labels.clone(),
            offset_us: self.offset,
            max_gap_us: self.max_gap,
            read: self.read.options(),
        };
        let presses = Presses::read(&self.folder, &options)?;
        progress.finish();
        presses.odd.iter().for_each(|odd| tell(format_args!("note: {odd}")));
        if self.read.strict && !presses.odd.is_empty() {
            return Err(CliError::Odd(presses.odd.len()));
        }
        Ok(presses)
    }
}

/// `--strict` for presses.
pub(crate) fn strict(arg: Arg) -> Arg {
    let help = "Refuse presses about which anything is odd";
    let more = "Without this option, oddities are notes. With it, they are an error, after all of them have been told.";
    arg.help(help).long_help(format!("{help}.\n\n{more}"))
}

/// `meissner prepare presses`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LABELS)]
#[command(mut_arg("strict", strict))]
pub(crate) struct PressesArgs {
    #[command(flatten)]
    input: PressInput,
    /// File to write (safetensors); without it, presses are only checked.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    out: Option<PathBuf>,
    /// Number of folds of the cross-validation in the file.
    ///
    /// Every press is held out by one fold, and each fold has about the same number of presses of
    /// every class.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(2..),
          help_heading = OUTPUT)]
    folds: u32,
    #[command(flatten)]
    force: Force,
}

/// Checks presses, reports oddities, and writes the presses if requested.
pub(crate) fn prepare(args: &PressesArgs) -> Result<(), CliError> {
    if let Some(path) = &args.out {
        check_result(path, args.force)?;
    }
    let presses = args.input.read()?;
    let mut written = None;
    if let Some(path) = &args.out {
        let (notes, prepared) = labelled_presses(&presses, args.folds as usize)?;
        write(path, prepared.file.into_bytes())?;
        notes.iter().for_each(|note| tell(format_args!("note: {note}")));
        written = Some(format!("{}: {}", path.display(), prepared.contents));
    }
    let mut out = out(false);
    describe(&presses, &mut out)?;
    if let Some(written) = written {
        writeln!(out, "\n{written}")?;
    }
    Ok(out.flush()?)
}

fn describe(presses: &Presses, out: &mut impl Write) -> io::Result<()> {
    let summary = presses.summary();
    writeln!(out, "{}", presses.folder.display())?;
    let sensors: Vec<String> = summary.sensors.iter().map(ToString::to_string).collect();
    let sensors = if sensors.is_empty() { "no sensor named".to_owned() } else { sensors.join(", ") };
    writeln!(out, "  recordings  {}, {sensors}", grouped(summary.recordings as u64))?;
    let rows = grouped(summary.rows as u64);
    writeln!(out, "  presses     {} with labels", grouped(summary.presses as u64))?;
    writeln!(out, "  events      {}", grouped(summary.events))?;
    let median = cell(summary.median_us, |us| format!("{} us", grouped(us)));
    let rate = cell(summary.median_rate, |rate| format!("{} events/s", grouped(rate.round() as u64)));
    writeln!(out, "  median      {median}, {rate}")?;
    writeln!(out, "  labels      {rows} instants from {}", presses.table.display())?;
    writeln!(out, "  offset      {}", offset(presses.offset))?;
    if let Some(fit) = presses.clock {
        writeln!(out, "  clocks      {}", clocks(fit))?;
    }
    let headings = columns("label | unit | instants | distinct | min | mean | max | std");
    Table::section(out, &headings, summary.labels.iter().map(row))?;
    for label in summary.labels.iter().filter(|label| !label.classes.is_empty()) {
        let rows = label
            .classes
            .iter()
            .map(|class| [class.name.clone(), grouped(class.presses as u64), grouped(class.rows as u64)]);
        Table::section(out, &[label.name.as_str(), "presses", "instants"], rows)?;
    }
    Ok(())
}

fn row(label: &LabelSummary) -> Vec<String> {
    let [least, mean, most, deviation] = match label.spread {
        Some(spread) => spread.map(short),
        None => [NONE; 4].map(str::to_owned),
    };
    let unit = label.unit.clone().unwrap_or_else(|| NONE.to_owned());
    let (count, distinct) = (grouped(label.count as u64), grouped(label.distinct as u64));
    vec![label.name.clone(), unit, count, distinct, least, mean, most, deviation]
}

/// A number with about four digits.
fn short(value: f64) -> String {
    match value.abs() {
        1e6.. => format!("{value:.3e}"),
        100.0.. => format!("{value:.1}"),
        1.0.. => format!("{value:.3}"),
        0.001.. => format!("{value:.5}"),
        0.0 => "0".to_owned(),
        _ => format!("{value:.3e}"),
    }
}

fn offset(offset: Offset) -> String {
    let us = display_us(offset.us);
    match offset.source {
        OffsetSource::SensorClock => "none: the labels have times of the sensor, or none".to_owned(),
        OffsetSource::Nothing => "0, as neither --offset nor recordings.csv says it".to_owned(),
        OffsetSource::Listed { recordings, spread_us } => format!(
            "{us}, the median of {} in recordings.csv, which spread over {} us",
            grouped(recordings as u64),
            duration(spread_us as f64)
        ),
        OffsetSource::Each => format!("each recording's own by recordings.csv, and {us}"),
        _ => us,
    }
}

fn clocks(fit: ClockFit) -> String {
    let drift = fit.drift.map_or_else(String::new, |drift| {
        format!("; drift {:.0} ppm (standard error {:.0})", drift.ppm, drift.error_ppm)
    });
    let ClockFit { shift_us, width_us, correlation, next, .. } = fit;
    let shift = format!("{:.1} ms (within {:.0} ms)", shift_us as f64 / 1e3, width_us as f64 / 1e3);
    format!("motion fits events best {shift} later, correlation {correlation:.2}, next peak {next:.2}{drift}")
}

const _: () = assert!(DEFAULT_MAX_GAP_US == 100_000, "the default of --max-gap");
