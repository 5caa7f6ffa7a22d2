//! `meissner eval`: accuracies of networks on labelled data sets.
//!
//! | file | job |
//! |---|---|
//! | `digits`, `touch`, `slip`, `angle`, `force`, `area` | the tasks; tables and pictures of the last four |
//! | `filters` | what filters of events keep |
//! | `events` | arguments, tables and picture of tasks on recordings of events |

mod angle;
mod area;
mod digits;
mod events;
mod filters;
mod force;
mod slip;
mod touch;

use std::io::{self, IsTerminal, Write, stderr};
use std::iter::{once, repeat};
use std::path::PathBuf;
use std::time::Duration;

use clap::Subcommand;
use meissner_evaluate::metrics::{Confusion, MeanStd};
use meissner_evaluate::trainings::Evaluation;
use meissner_evaluate::{EvaluateError, NetworkReport, ProgressHandle, Workers};
use meissner_plot::{Matrix, Panel};
use meissner_run::text::grouped;
use serde::Serialize;

use crate::args::OUTPUT;
use crate::error::CliError;
use crate::output;
use crate::output::ReportArgs;
use crate::progress::Progress;
use crate::stderr::tell;
use crate::text::{Table, percent};
use crate::threads::Threads;

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
    Digits(digits::DigitsArgs),
    /// Objects and containers under a tactile skin, over time.
    Touch(touch::TouchArgs),
    /// Angles of a contact, or other quantities of presses, over time.
    Angle(angle::AngleArgs),
    /// Contact area and normal force from pictures of a gel.
    Area(area::AreaArgs),
    /// Force of fingers that grasp, hold and release a bolt, by phase and by size.
    Force(force::ForceArgs),
    /// What filters of events keep of a simulated signal and its noise.
    Filters(filters::FiltersArgs),
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
        TaskArgs::Digits(args) => digits::eval(args),
        TaskArgs::Angle(args) => angle::eval(args),
        TaskArgs::Area(args) => area::eval(args),
        TaskArgs::Force(args) => force::eval(args),
        TaskArgs::Touch(args) => touch::eval(args),
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

/// The cell of a missing figure.
const NONE: &str = "-";

/// Mean and deviation in percent.
fn spread(figure: MeanStd) -> [String; 2] {
    [percent(figure.mean), figure.std.map_or_else(|| NONE.to_owned(), percent)]
}

/// Writes the `confusion` of `classes` with the title `name`, in percent of each row. It is a sum over `trainings` on the same
/// data. The last column, `counted`, is the number of predictions of one training in the row.
fn confusion(
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
        let cell = |&count: &u64| match sum {
            0 => NONE.to_owned(),
            _ => format!("{:.1}", 100.0 * count as f64 / sum as f64),
        };
        let cells = row.iter().map(cell).chain([grouped(sum / trainings.max(1) as u64)]);
        table.row(std::iter::once((*class).to_owned()).chain(cells));
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

/// The line below the title of a matrix: the accuracy with its `interval`, and numbers with what they count.
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

#[cfg(test)]
mod tests {
    use super::confusion;
    use meissner_evaluate::metrics::Confusion;

    #[test]
    fn a_confusion_counts_predictions_of_one_training_for_any_number_of_them() {
        let text = |trainings: usize| {
            let mut matrix = Confusion::new(2);
            for _ in 0..trainings {
                [(0, 0), (0, 0), (0, 1), (1, 1)]
                    .into_iter()
                    .for_each(|(truth, found)| matrix.add(truth, found));
            }
            let mut text = Vec::new();
            confusion(&mut text, "own", &["n", "s"], "windows", &matrix, trainings)
                .expect("a vector takes everything");
            String::from_utf8(text).expect("text")
        };
        assert_eq!(text(5), text(1));
        assert!(text(5).contains("n  66.7   33.3        3"), "{}", text(5));
    }
}
