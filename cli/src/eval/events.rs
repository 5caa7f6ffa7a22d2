//! Accuracies of networks over events, event by event: arguments, the tables of a report, and its picture.
//!
//! The picture has a row for the split test and one for the cross-validation, with accuracies against time and a confusion
//! matrix for each network.

use std::io::{self, Write};
use std::path::Path;

use meissner_evaluate::events::{EventTask, Judged, Options, Report, evaluate};
use meissner_evaluate::judge::TrainingFigures;
use meissner_evaluate::trainings::seed_name;
use meissner_plot::{AccuracyCurve, Curves, Panel, page};
use meissner_run::predictor::Mode;
use meissner_run::text::{self, grouped};

use super::{NONE, OutputArgs, accuracy_of, confusion, matrix, networks, spread, write};
use crate::args::{MODES, NETWORK, PREDICTIONS, choice};
use crate::error::CliError;
use crate::tasks::EventNetworks;
use crate::text::{Table, file_name, interval, percent};

/// Largest number of rows of the table of accuracies against time. JSON has all times.
const MAX_TIMES: usize = 40;

/// How networks are judged.
#[derive(Debug, clap::Args)]
pub(super) struct JudgeArgs {
    /// Take every Nth event of each recording [default: as the weights say].
    ///
    /// The first event is taken. The metadata of the weights state the stride of the training; if they state none, every
    /// event is taken.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = NETWORK)]
    stride: Option<u32>,
    /// Time between two predictions, from 100us to 10s.
    #[arg(long = "every", value_name = "TIME", default_value = "10ms", value_parser = every_us,
          help_heading = PREDICTIONS)]
    every_us: i64,
    /// Recompute what an event changes, or every row at every prediction.
    ///
    /// Both give the same values, bit for bit.
    #[arg(long, value_parser = choice(MODES), default_value = "incremental", help_heading = PREDICTIONS)]
    mode: Mode,
    #[command(flatten)]
    output: OutputArgs,
}

/// Reads the time between two predictions.
pub(super) fn every_us(text: &str) -> Result<i64, String> {
    let us = text::span_us(text)?;
    let fits = (100..=10_000_000).contains(&us);
    if fits { Ok(us) } else { Err("expected a time from 100us to 10s".to_owned()) }
}

impl JudgeArgs {
    /// Judges `networks` on the data set in `folder`; the picture has a `title`.
    pub(super) fn eval<T: EventTask>(
        &self,
        folder: &Path,
        networks: &EventNetworks,
        title: &str,
    ) -> Result<(), CliError> {
        let options = Options {
            request: networks.request(),
            stride: self.stride.map(|stride| stride as usize),
            folds: networks.folds(),
            every_us: self.every_us,
            mode: self.mode,
        };
        let judge = |workers: &_, done| evaluate::<T>(folder, &options, workers, done);
        write(&self.output, |report: &_| svg(report, title), table, judge)
    }
}

/// The report for people: shares in percent, times in milliseconds.
pub(super) fn table(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let data = &report.data;
    let [recordings, train, test] = [data.recordings, data.train, data.test].map(|n| grouped(n as u64));
    writeln!(
        out,
        "data         {}: {recordings} recordings ({train} train, {test} test), {} events",
        data.folder,
        grouped(data.events)
    )?;
    let every = milliseconds(report.every_us);
    writeln!(out, "predictions  {}, every {every} ms and at the end of a recording", report.mode)?;
    networks(out, &report.networks, &data.notes)?;
    let judged = judged(report);
    accuracies(out, &judged)?;
    seeds(out, &judged)?;
    against_time(out, report, &judged)?;
    judged.iter().try_for_each(|(name, judged)| {
        confusion(out, name, report.classes, "recordings", &judged.mean.confusion, judged.trainings)
    })
}

/// All figures, each with its network and protocol.
fn judged(report: &Report) -> Vec<(String, &Judged)> {
    let of_networks = report.networks.iter().flat_map(|network| {
        let named = |name| format!("{}, {name}", network.card.network.name);
        network.result.protocols().map(|(name, judged)| judged.map(|judged| (named(name), judged)))
    });
    of_networks.flatten().collect()
}

/// Microseconds as milliseconds, with all decimals.
fn milliseconds(t_us: i64) -> String {
    (t_us as f64 / 1000.0).to_string()
}

fn settled(t_us: Option<i64>) -> String {
    t_us.map_or_else(|| NONE.to_owned(), |t_us| format!("{:.1}", t_us as f64 / 1000.0))
}

fn accuracies(out: &mut dyn Write, all: &[(String, &Judged)]) -> io::Result<()> {
    let headings = [
        "at the end of a recording",
        "recordings",
        "seeds",
        "accuracy (%)",
        "std",
        "95 % interval",
        "median settling time (ms)",
    ];
    let row = |(name, Judged { trainings, mean: of, .. }): &(String, &Judged)| {
        let (count, [mean, std]) = (grouped(of.recordings), spread(of.accuracy));
        let (interval, settled) = (interval(of.interval_95), settled(of.settled_us));
        [name.clone(), count, trainings.to_string(), mean, std, interval, settled]
    };
    Table::section(out, &headings, all.iter().map(row))
}

/// Each seed, where there are several.
fn seeds(out: &mut dyn Write, all: &[(String, &Judged)]) -> io::Result<()> {
    if all.iter().all(|(_, judged)| judged.trainings < 2) {
        return Ok(());
    }
    let headings = ["each seed", "files", "accuracy (%)", "95 % interval", "median settling time (ms)"];
    let each = all.iter().flat_map(|(name, judged)| judged.each.iter().map(move |one| (name, one)));
    let rows = each.map(|(name, TrainingFigures { seed, files, figures })| {
        let (interval, settled) = (interval(figures.interval_95), settled(figures.settled_us));
        let name = format!("{name}, seed {}", seed_name(*seed));
        [name, files.len().to_string(), percent(figures.accuracy), interval, settled]
    });
    Table::section(out, &headings, rows)
}

/// Accuracies at the times of predictions, the last one always.
fn against_time(out: &mut dyn Write, report: &Report, all: &[(String, &Judged)]) -> io::Result<()> {
    let names = all.iter().map(|(name, _)| name.as_str());
    let headings: Vec<&str> = std::iter::once("accuracy (%) after (ms)").chain(names).collect();
    let times = &report.times_us;
    let step = times.len().div_ceil(MAX_TIMES).max(1);
    let shown = (0..times.len()).filter(|i| (i + 1) % step == 0 || i + 1 == times.len());
    let rows = shown.map(|i| {
        let cells = all.iter().map(move |(_, judged)| percent(judged.mean.accuracy_at[i].mean));
        std::iter::once(milliseconds(times[i])).chain(cells)
    });
    Table::section(out, &headings, rows)
}

/// The picture, as the text of a file.
pub(super) fn svg(report: &Report, title: &str) -> String {
    let about = format!(
        "{}: {} recordings, {} events; confusion matrices at the end of a recording: percent of the true class",
        file_name(&report.data.folder),
        grouped(report.data.recordings as u64),
        grouped(report.data.events)
    );
    let rows: Vec<Vec<Panel<'_>>> = (0..2).filter_map(|protocol| row(report, protocol)).collect();
    page(title, &about, &rows)
}

/// The panels of one protocol; `None` where no network was judged by it.
fn row(report: &Report, protocol: usize) -> Option<Vec<Panel<'static>>> {
    let protocol_name = report.networks.first()?.result.protocols()[protocol].0;
    let (mut curves, mut matrices) = (Vec::new(), Vec::new());
    // The colour of a network is that of its place among all networks.
    for (colour, network) in report.networks.iter().enumerate() {
        let Some(judged) = network.result.protocols()[protocol].1 else { continue };
        let (name, mean) = (&network.card.network.name, &judged.mean);
        let (low, high) = mean.interval_95;
        let interval = format!(" (95 %: {:.1} to {:.1})", 100.0 * low, 100.0 * high);
        curves.push(AccuracyCurve {
            name: format!("{name}, {:.1} %", 100.0 * mean.accuracy.mean),
            colour,
            accuracy: mean.accuracy_at.iter().map(|at| at.mean).collect(),
            interval: mean.interval_95_at.clone(),
        });
        let about = accuracy_of(
            mean.accuracy,
            &interval,
            (judged.trainings, "seed"),
            (mean.recordings, "recordings"),
        );
        matrices.push(matrix(format!("{name}, {protocol_name}"), about, report.classes, &mean.confusion));
    }
    let is_empty = curves.is_empty();
    let curves = Panel::Curves(Curves {
        title: format!("Accuracy against time, {protocol_name}"),
        about: "bands: 95 % intervals; after the end of a recording its last prediction stands".to_owned(),
        time_title: "time since the first event (ms)".to_owned(),
        times: report.times_us.iter().map(|&t_us| t_us as f64 / 1000.0).collect(),
        chance: 1.0 / report.classes.len() as f64,
        curves,
    });
    (!is_empty).then(|| std::iter::once(curves).chain(matrices).collect())
}
