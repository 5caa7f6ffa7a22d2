//! `meissner eval digits` and `eval touch`: accuracies of networks over events, event by event.
//!
//! The picture has a row for the split test and one for the cross-validation: accuracies against
//! time, and a confusion matrix for each network.

use std::io::{self, Write};
use std::path::Path;

use clap::Arg;
use meissner_evaluate::events::Digits;
use meissner_evaluate::events::{EventTask, Judged, Options, Report, evaluate};
use meissner_evaluate::events::{TouchContainers, TouchLetters, TouchObjects};
use meissner_evaluate::judge::TrainingFigures;
use meissner_plot::{AccuracyCurve, Curves, Panel, page, percent};
use meissner_run::text::grouped;

use super::{
    OutputArgs, PredictionArgs, StrideArg, accuracy_of, confusion, matrix, networks, seeds, shown, spread,
    write,
};
use crate::error::CliError;
use crate::tasks::{DigitsTask, EventNetworks, TouchData, TouchSet, TouchTask};
use crate::text::{Table, cell, columns, file_name, interval};

/// Largest number of rows of the table of accuracies against time. JSON has all times.
const MAX_TIMES: usize = 40;

/// How networks are judged.
#[derive(Debug, clap::Args)]
struct JudgeArgs {
    #[command(flatten)]
    stride: StrideArg,
    #[command(flatten)]
    predictions: PredictionArgs,
    #[command(flatten)]
    output: OutputArgs,
}

/// `--every` for recordings that last longer than a press.
fn of_recordings(arg: Arg) -> Arg {
    arg.default_value("10ms")
}

impl JudgeArgs {
    /// Judges `networks` on the data set in `folder`; the picture has a `title`.
    fn eval<T: EventTask>(
        &self,
        folder: &Path,
        networks: &EventNetworks,
        title: &str,
    ) -> Result<(), CliError> {
        let options = Options {
            request: networks.request(),
            stride: self.stride.stride.map(|stride| stride as usize),
            folds: networks.folds(),
            every_us: self.predictions.every_us,
            mode: self.predictions.mode,
        };
        let judge = |workers: &_, done| evaluate::<T>(folder, &options, workers, done);
        write(&self.output, |report: &_| svg(report, title), table, judge)
    }
}

/// The report for people: shares in percent, times in milliseconds.
fn table(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let data = &report.data;
    let [recordings, train, test] = [data.recordings, data.train, data.test].map(|n| grouped(n as u64));
    writeln!(
        out,
        "data         {}: {recordings} recordings ({train} train, {test} test), {} events",
        data.folder,
        grouped(data.events)
    )?;
    let every = milliseconds(report.every_us);
    let (mode, since) = (report.mode, report.since);
    writeln!(out, "predictions  {mode}, every {every} ms since {since}, and at the end of a recording")?;
    networks(out, &report.networks, &data.notes)?;
    let judged = judged(report);
    accuracies(out, &judged)?;
    let headings = ["each seed", "files", "accuracy (%)", "95 % interval", "median settling time (ms)"];
    seeds(out, headings, &judged, |name, TrainingFigures { files, figures, .. }| {
        let (interval, settled) = (interval(figures.interval_95), settled(figures.settled_us));
        vec![[name, files.len().to_string(), percent(figures.accuracy), interval, settled]]
    })?;
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
    cell(t_us, |t_us| format!("{:.1}", t_us as f64 / 1000.0))
}

fn accuracies(out: &mut dyn Write, all: &[(String, &Judged)]) -> io::Result<()> {
    let headings = columns(
        "at the end of a recording | recordings | seeds | accuracy (%) | std | 95 % interval | \
         median settling time (ms)",
    );
    let row = |(name, Judged { trainings, mean: of, .. }): &(String, &Judged)| {
        let (count, [mean, std]) = (grouped(of.recordings), spread(of.accuracy));
        let (interval, settled) = (interval(of.interval_95), settled(of.settled_us));
        [name.clone(), count, trainings.to_string(), mean, std, interval, settled]
    };
    Table::section(out, &headings, all.iter().map(row))
}

/// Accuracies at the times of predictions, always including the last one.
fn against_time(out: &mut dyn Write, report: &Report, all: &[(String, &Judged)]) -> io::Result<()> {
    let names = all.iter().map(|(name, _)| name.as_str());
    let headings: Vec<&str> = std::iter::once("accuracy (%) after (ms)").chain(names).collect();
    let times = &report.times_us;
    let rows = shown(times.len(), MAX_TIMES, 0).map(|i| {
        let cells = all.iter().map(move |(_, judged)| percent(judged.mean.accuracy_at[i].mean));
        std::iter::once(milliseconds(times[i])).chain(cells)
    });
    Table::section(out, &headings, rows)
}

/// The picture, as the text of a file.
fn svg(report: &Report, title: &str) -> String {
    let about = format!(
        "{}: {} recordings, {} events; confusion matrices at the end of a recording: percent of the true class",
        file_name(&report.data.folder),
        grouped(report.data.recordings as u64),
        grouped(report.data.events)
    );
    let rows: Vec<Vec<Panel<'_>>> = (0..2).filter_map(|protocol| row(report, protocol)).collect();
    page(title, &about, &rows)
}

/// The panels of one protocol; `None` if no network was judged by it.
fn row(report: &Report, protocol: usize) -> Option<Vec<Panel<'static>>> {
    let protocol_name = report.networks.first()?.result.protocols()[protocol].0;
    let (mut curves, mut matrices) = (Vec::new(), Vec::new());
    // The colour of a network depends on its index among all networks.
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
        time_title: format!("time since {} (ms)", report.since),
        times: report.times_us.iter().map(|&t_us| t_us as f64 / 1000.0).collect(),
        chance: 1.0 / report.classes.len() as f64,
        compact: false,
        curves,
    });
    (!is_empty).then(|| std::iter::once(curves).chain(matrices).collect())
}

/// At the end of the long help.
const DIGITS: &str = "\
How it judges:
  Every recording is a separate stream. The engine is reset, the events are pushed one by one, and a prediction is read every TIME (--every) and at the end. Times count from the first event of the recording. A prediction is the class with the largest output. The last prediction of a recording stays valid after its end: every recording counts at every time, and the last accuracy is the accuracy at the end. An answer settles at the first of these times from which all predictions are right. The median is the time by which half of all recordings have settled; some may never settle.
  Whole trainings are judged on the split test. Folds of a cross-validation are judged on the recordings of both splits that they held out.
  Intervals are 95 % Wilson intervals over the recordings, one for each seed. For several seeds, the bounds are means over the seeds, accuracies have a mean and a sample standard deviation (- for one seed), and confusion matrices are sums.

Trainings (--trainings): every *.safetensors file of the folder is a training, with metadata
  network     name of the network; digits-frozen uses those of digits-past
  seed        whole number
  trained_on  \"train\": the split test is unseen; folds need no trained_on
  held_out    JSON list of recordings, such as [\"train/3/00123\"]: the file is a
              fold; without this key, it is a whole training
  fold        whole number (optional)
  stride      N if the network was trained on every N-th event of a recording,
              starting with the first; without this key: on all events
  The folds of a network and seed must hold out every recording exactly once, and give one accuracy together.

Logits (--logits), at the end of each recording:
  For every whole training a tensor NETWORK.SEED, or NETWORK.shipped where the weights name no seed, of shape (recordings of the split test, 10). For the folds of a seed together a tensor NETWORK.SEED.folds of shape (recordings, 10). Metadata recordings and test: JSON lists of their names.

Examples:
  meissner eval digits nmnist/
  meissner eval digits nmnist/ --network own.toml --weights own.safetensors
  meissner eval digits nmnist/ --trainings runs/ --folds 10 --json > out.json
  meissner eval digits nmnist/ --network digits-past --every 5ms --svg out.svg";

/// `meissner eval digits`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = DIGITS, mut_arg("every_us", of_recordings))]
pub(super) struct DigitsArgs {
    #[command(flatten)]
    task: DigitsTask,
    #[command(flatten)]
    judge: JudgeArgs,
}

impl DigitsArgs {
    pub(super) fn eval(&self) -> Result<(), CliError> {
        let DigitsTask { data, networks } = &self.task;
        self.judge.eval::<Digits>(data, networks, "Digits, event by event")
    }
}

/// At the end of the long help.
const TOUCH: &str = "\
`meissner eval digits --help` explains how it judges, the trainings and the JSON: they are the same. An event of an object or a container is a spike of a taxel. Its pixel is the place of the taxel in steps of 0.05 mm, and its time is the beginning of its bin of 20 ms.
  An event of a letter is a reading of a taxel that differs from the one before it: on where the pressure rises. Its pixel is the taxel's column and row. Readings reach the host in batches every 15.7 ms, in which only their order is true: their times are spread over the batch. A recording has what happens from 0.2 s before contact (0.2 N) to 0.2 s after the lift. Times count from contact, so that accuracies are those since contact. A press without events counts as well.

Examples:
  meissner eval touch objects neutouch/ --every 100ms
  meissner eval touch containers neutouch/ --trainings runs/ --folds 5 --svg a.svg
  meissner eval touch letters braille/ --network own.toml --weights own.safetensors";

/// `meissner eval touch`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = TOUCH, mut_arg("every_us", of_recordings))]
pub(super) struct TouchArgs {
    #[command(flatten)]
    task: TouchTask,
    #[command(flatten)]
    judge: JudgeArgs,
}

impl TouchArgs {
    pub(super) fn eval(&self) -> Result<(), CliError> {
        let TouchTask { data: TouchData { set, data }, networks } = &self.task;
        match set {
            TouchSet::Objects => {
                self.judge.eval::<TouchObjects>(data, networks, "Objects by touch, event by event")
            }
            TouchSet::Containers => {
                self.judge.eval::<TouchContainers>(data, networks, "Containers by touch, event by event")
            }
            TouchSet::Letters => {
                self.judge.eval::<TouchLetters>(data, networks, "Letters of braille by touch, event by event")
            }
        }
    }
}
