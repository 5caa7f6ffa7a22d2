//! `meissner eval`: accuracies of networks on labelled data sets.
//!
//! | file | job |
//! |---|---|
//! | `events` | digits and touch: classes of recordings of events |
//! | `slip`, `angle`, `force`, `area` | one task in each: arguments, tables, picture |
//! | `filters` | the events that filters keep |

mod angle;
mod area;
mod events;
mod filters;
mod force;
mod slip;

use std::fmt::Display;
use std::io::{self, IsTerminal, Write, stderr};
use std::iter::{once, repeat};
use std::path::PathBuf;
use std::time::Duration;

use clap::Subcommand;
use meissner_evaluate::doubts::Doubts;
use meissner_evaluate::judge::{Figures, Judged, TrainingFigures};
use meissner_evaluate::metrics::{Confusion, MeanStd};
use meissner_evaluate::regression::Work;
use meissner_evaluate::trainings::{Evaluation, seed_name};
use meissner_evaluate::{EvaluateError, NetworkReport, ProgressHandle, Workers};
use meissner_plot::{Matrix, Panel, percent};
use meissner_run::predictor::Mode;
use meissner_run::text::{grouped, span_us};
use serde::Serialize;

use crate::args::{MODES, NETWORK, OUTPUT, PREDICTIONS, Threads, choice};
use crate::error::CliError;
use crate::output::{self, ReportArgs};
use crate::progress::Progress;
use crate::stderr::tell;
use crate::text::{Table, cell, columns, duration};

/// `meissner eval`.
#[derive(Debug, clap::Args)]
pub(crate) struct EvalArgs {
    #[command(subcommand)]
    task: TaskArgs,
}

#[derive(Debug, Subcommand)]
enum TaskArgs {
    /// Direction of slip from 24 electrodes, on seen and unseen objects.
    Slip(slip::SlipArgs),
    /// Digits in front of a moving event camera (N-MNIST), over time.
    Digits(events::DigitsArgs),
    /// Objects and containers under a tactile skin, over time.
    Touch(events::TouchArgs),
    /// Angles of a contact, or other quantities of presses, over time.
    Angle(angle::AngleArgs),
    /// Contact area and normal force from pictures of a gel.
    Area(area::AreaArgs),
    /// Force of fingers that grasp, hold and release a bolt, by phase and by size.
    Force(force::ForceArgs),
    /// What filters of events keep of a simulated signal and its noise.
    Filters(filters::FiltersArgs),
}

/// Which events of a recording are taken.
#[derive(Clone, Copy, Debug, clap::Args)]
struct StrideArg {
    /// Take every Nth event of each recording [default: as the weights say].
    ///
    /// The first event is taken. The metadata of the weights state the stride of the training; if
    /// they state none, every event is taken.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = NETWORK)]
    stride: Option<u32>,
}

/// When and how is predicted.
#[derive(Clone, Copy, Debug, clap::Args)]
struct PredictionArgs {
    /// Time between two predictions, from 100us to 10s.
    #[arg(long = "every", value_name = "TIME", default_value = "1ms", value_parser = every_us,
          help_heading = PREDICTIONS)]
    every_us: i64,
    /// Recompute what an event changes, or every row at every prediction.
    ///
    /// Both give the same values, bit for bit. Frame networks compute what changes.
    #[arg(long, value_parser = choice(MODES), default_value = "incremental", help_heading = PREDICTIONS)]
    mode: Mode,
}

/// Reads the time between two predictions.
fn every_us(text: &str) -> Result<i64, String> {
    let us = span_us(text)?;
    let fits = (100..=10_000_000).contains(&us);
    if fits { Ok(us) } else { Err("expected a time from 100us to 10s".to_owned()) }
}

/// Threads and files of all tasks.
#[derive(Debug, clap::Args)]
struct OutputArgs {
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    report: ReportArgs,
    /// Draw the figures into this file.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    svg: Option<PathBuf>,
    /// Write the outputs of the networks to this file (safetensors).
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    logits: Option<PathBuf>,
}

/// Evaluates the networks that `args` name.
pub(crate) fn eval(args: &EvalArgs) -> Result<(), CliError> {
    match &args.task {
        TaskArgs::Slip(args) => slip::eval(args),
        TaskArgs::Digits(args) => args.eval(),
        TaskArgs::Angle(args) => angle::eval(args),
        TaskArgs::Area(args) => area::eval(args),
        TaskArgs::Force(args) => force::eval(args),
        TaskArgs::Touch(args) => args.eval(),
        TaskArgs::Filters(args) => filters::eval(args),
    }
}

/// Writes the files and the text of `args` from the results of `evaluate`.
fn write<R: Serialize>(
    args: &OutputArgs,
    svg: impl Fn(&R) -> String,
    table: impl Fn(&mut dyn Write, &R) -> io::Result<()>,
    evaluate: impl FnOnce(&Workers, fn(&str, Duration)) -> Result<Evaluation<R>, EvaluateError>,
) -> Result<(), CliError> {
    output::check_all_writable([&args.report.out, &args.svg, &args.logits])?;
    let watch = ProgressHandle::default();
    let workers = Workers::new(args.threads.pool()?, watch.clone());
    let progress = Progress::busy(move || match watch.total() {
        0 => "reading".to_owned(),
        total => format!("{} of {total} judged", watch.done()),
    });
    let Evaluation { report, logits, took } = evaluate(&workers, |training, elapsed| {
        if stderr().is_terminal() {
            tell(format_args!("{:>8.1} s  {training}", elapsed.as_secs_f64()));
        }
    })?;
    progress.finish();
    if let Some(path) = &args.svg {
        output::write(path, svg(&report))?;
    }
    if let Some(path) = &args.logits {
        output::write(path, logits.into_bytes())?;
    }
    output::report(&args.report, &report, |out| {
        table(out, &report)?;
        let (seconds, threads) = (took.as_secs_f64(), workers.threads());
        writeln!(out, "\njudged in {seconds:.1} s on {threads} threads")
    })
}

/// Writes a line for each network with the source of its weights, and the `notes`.
fn networks<F>(out: &mut dyn Write, networks: &[NetworkReport<F>], notes: &[String]) -> io::Result<()> {
    for (title, NetworkReport { card, weights, .. }) in once("networks").chain(repeat("")).zip(networks) {
        let stride = card.network.stride;
        let stride = if stride > 1 { format!("; one event of {stride}") } else { String::new() };
        writeln!(out, "{title:<12} {}: {weights}{stride}", card.network.name)?;
    }
    notes.iter().try_for_each(|note| writeln!(out, "note         {note}"))
}

/// The name of each judged network, with its figures.
fn judged<'a, F, J: Figures>(
    networks: &'a [NetworkReport<F>],
    figures: fn(&F) -> Option<&Judged<J>>,
) -> Vec<(&'a str, &'a Judged<J>)> {
    let named =
        |network: &'a NetworkReport<F>| Some((network.card.network.name.as_str(), figures(&network.result)?));
    networks.iter().filter_map(named).collect()
}

/// Writes `rows` for each seed, if there are several. They get the name of network and seed.
fn seeds<J: Figures, const N: usize>(
    out: &mut dyn Write,
    headings: [&str; N],
    judged: &[(impl Display, &Judged<J>)],
    rows: impl Fn(String, &TrainingFigures<J>) -> Vec<[String; N]>,
) -> io::Result<()> {
    if judged.iter().all(|(_, judged)| judged.trainings < 2) {
        return Ok(());
    }
    let rows = judged.iter().flat_map(|(name, judged)| {
        let of_seed = |one: &TrainingFigures<J>| rows(format!("{name}, seed {}", seed_name(one.seed)), one);
        judged.each.iter().flat_map(of_seed).collect::<Vec<_>>()
    });
    Table::section(out, &headings, rows)
}

/// A part of all in percent.
fn part(part: u64, all: u64) -> String {
    cell((all > 0).then(|| 100.0 * part as f64 / all as f64), |share| format!("{share:.1}"))
}

/// Writes the counts of input unlike the training's, for networks with statistics of their
/// training.
fn doubts(out: &mut dyn Write, judged: impl Iterator<Item = (String, Option<Doubts>)>) -> io::Result<()> {
    let row = |(name, doubts): (String, Option<Doubts>)| {
        let Doubts { predictions, unlike, bad, bad_unlike } = doubts?;
        Some([name, part(unlike, predictions), part(bad_unlike, bad)])
    };
    let rows: Vec<[String; 3]> = judged.filter_map(row).collect();
    if rows.is_empty() {
        return Ok(());
    }
    Table::section(out, &["input unlike the training", "of all (%)", "of bad ones (%)"], rows)
}

/// Writes the work of each network for a `part` of the data: a press or a recording.
fn work<'a>(
    out: &mut dyn Write,
    part: &str,
    all: impl Iterator<Item = (&'a str, &'a Work)>,
) -> io::Result<()> {
    let headings =
        columns("events | predictions | rows | multiply-adds (million) | update p50 (us) | p99 (us)");
    let rows = all.map(|(name, work)| {
        let each = |count: u64| count as f64 / work.presses.max(1) as f64;
        let count = |count: u64| grouped(each(count).round() as u64);
        let times = work.update_us.quantiles();
        [
            name.to_owned(),
            count(work.events),
            count(work.predictions),
            cell((work.rows > 0).then_some(work.rows), count),
            format!("{:.1}", each(work.multiply_adds) / 1e6),
            cell(times, |times| duration(times.p50)),
            cell(times, |times| duration(times.p99)),
        ]
    });
    Table::section(out, &[&[format!("work of a {part}").as_str()], &headings[..]].concat(), rows)
}

/// The indices of `times` that a table shows: about `most`, at equal steps from `first` (0 or 1)
/// on, and the last one.
fn shown(times: usize, most: usize, first: usize) -> impl Iterator<Item = usize> {
    let step = times.div_ceil(most).max(1);
    (0..times).filter(move |i| (i + 1 - first).is_multiple_of(step) || i + 1 == times)
}

/// Mean and deviation in percent.
fn spread(figure: MeanStd) -> [String; 2] {
    [percent(figure.mean), cell(figure.std, percent)]
}

/// Writes the `confusion` of `classes` with the title `name`, in percent of each row: a sum over
/// `trainings` on the same data. The last column, `counted`, counts the predictions of one
/// training.
pub(crate) fn confusion(
    out: &mut dyn Write,
    name: &str,
    classes: &[&str],
    counted: &str,
    confusion: &Confusion,
    trainings: usize,
) -> io::Result<()> {
    writeln!(out, "\n{name}: true class by row, predicted by column, percent of the row")?;
    let mut headings = vec![""];
    headings.extend(classes);
    headings.push(counted);
    let mut table = Table::new(&headings);
    for (class, row) in classes.iter().zip(confusion.rows()) {
        let sum: u64 = row.iter().sum();
        let share = |&count: &u64| {
            cell((sum > 0).then_some(sum), |sum| format!("{:.1}", 100.0 * count as f64 / sum as f64))
        };
        let cells = row.iter().map(share).chain([grouped(sum / trainings.max(1) as u64)]);
        table.row(once((*class).to_owned()).chain(cells));
    }
    table.write(out)
}

/// The panel of a confusion matrix.
fn matrix(
    title: String,
    about: String,
    classes: &'static [&'static str],
    confusion: &Confusion,
) -> Panel<'static> {
    let counts = confusion.rows().map(<[u64]>::to_vec).collect();
    Panel::Matrix(Matrix { title, about, classes, counts })
}

/// The line below the title of a matrix: the accuracy with its `interval`, and the counted items.
fn accuracy_of(
    accuracy: MeanStd,
    interval: &str,
    (trainings, training): (usize, &str),
    (count, counted): (u64, &str),
) -> String {
    let std = accuracy.std.map_or_else(String::new, |std| format!(" \u{b1} {:.2}", 100.0 * std));
    let (mean, count) = (100.0 * accuracy.mean, grouped(count));
    let s = if trainings == 1 { "" } else { "s" };
    format!("{mean:.2}{std} %{interval}, {trainings} {training}{s}, {count} {counted}")
}
