//! `meissner eval angle`: errors of networks that predict quantities from the events of presses.

use std::io::{self, Write};

use meissner_evaluate::NetworkReport;
use meissner_evaluate::doubts::Doubts;
use meissner_evaluate::metrics::MeanStd;
use meissner_evaluate::regression::{
    Errors, Options, OutputErrors, PressDoubts, PressFigures, Report, evaluate,
};
use meissner_plot::{Panel, Plane, Scale, Series, Style, page};
use meissner_run::text::grouped;

use super::{OutputArgs, PredictionArgs, StrideArg, judged, networks, part, seeds, shown, work, write};
use crate::error::CliError;
use crate::tasks::PressTask;
use crate::text::{Table, cell, columns, file_name};

/// Largest number of rows of the table of errors against time. JSON has all times.
const MAX_TIMES: usize = 25;

/// Number of colours of an embedding.
const BANDS: usize = 6;

/// At the end of the long help.
const METHOD: &str = "\
How it judges:
  EVENTS has streams as `meissner simulate markers` writes them from tracks with labels: each is a press. A network must predict labels of the file; the others are not needed. Angles in radians are reported in degrees.
  The engine is reset before each press. Contact is where the label depth leaves 0 (without this label, the first time of the truth), the end is the last time of the truth. Predictions are read every TIME (--every) before and after contact, and at the end. Labels are linear between their times.
  std is that of the absolute errors over the presses. After the end of a press its last error stands, so that each press counts at each time.
  newest: at every millisecond from contact to the end, the error of the newest prediction that a reader has, latency included, against the truth at that millisecond. Latencies are those of this machine: one thread pushes and predicts, and begins when a prediction is due or when it has finished the one before.
  unlike the training: the part of the windows after contact, at the ends, and of bad predictions, whose statistics are farther from those of the training than 999 of 1,000 of its own. A bad prediction has an error of more than three times the mean at the end.
  settled: the share of a press from which on all angles stay within 1 degree; the median of all presses.
  A frame network over a sliding window of signed frames is judged on the same windows.
  --svg draws errors against time, predicted against true values, and for networks over events what is read out of each press in two dimensions (t-SNE), in colours of the true values.

Trainings (--trainings): every *.safetensors file of the folder is a training, with metadata
  network     name of the network
  seed        whole number
  stride      N if the network was trained on every N-th event of a press,
              starting with the first; without this key: on all events

Outputs (--logits), at the end of each press, as the network gives them:
  For every training a tensor NETWORK.SEED, or NETWORK.shipped where the weights name no seed, of shape (presses, outputs).

Examples:
  meissner simulate dome --out tracks.safetensors
  meissner simulate markers tracks.safetensors --sensor 346x260 --out e.safetensors
  meissner eval angle e.safetensors --network tactigraph-past --svg angle.svg";

/// `meissner eval angle`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD)]
pub(super) struct AngleArgs {
    #[command(flatten)]
    task: PressTask,
    #[command(flatten)]
    stride: StrideArg,
    #[command(flatten)]
    predictions: PredictionArgs,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn eval(args: &AngleArgs) -> Result<(), CliError> {
    let options = Options {
        request: args.task.request(),
        stride: args.stride.stride.map(|stride| stride as usize),
        every_us: args.predictions.every_us,
        mode: args.predictions.mode,
        embeds: args.output.svg.is_some(),
    };
    write(&args.output, svg, table, |workers, done| evaluate(&args.task.events, &options, workers, done))
}

/// The report for people.
fn table(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let data = &report.data;
    let (presses, events) = (grouped(data.presses as u64), grouped(data.events));
    writeln!(out, "data         {}: {presses} presses, {events} events", data.file)?;
    let every = report.every_us as f64 / 1e3;
    writeln!(out, "predictions  {}, every {every} ms and at the end of a press", report.mode)?;
    networks(out, &report.networks, &data.notes)?;
    let figures = judged(&report.networks, |result: &PressFigures| result.figures.as_ref());
    let means = means(report);
    ends(out, &means)?;
    seeds(out, ["each seed", "unit", "mean absolute", "std"], &figures, |name, one| {
        let row = |output: &OutputErrors<f64>| {
            let [mean, std] = [output.mean_absolute, output.std].map(|value| format!("{value:.3}"));
            [format!("{name}, {}", output.name), output.unit.clone(), mean, std]
        };
        rows(&one.figures).map(row).collect()
    })?;
    doubts(out, &means)?;
    work(out, "press", means.iter().map(|&(name, errors)| (name, &errors.work)))?;
    against_time(out, report, &means)
}

/// The name of each network with its mean figures.
fn means(report: &Report) -> Vec<(&str, &Errors<MeanStd>)> {
    let figures = judged(&report.networks, |result: &PressFigures| result.figures.as_ref());
    figures.into_iter().map(|(name, judged)| (name, &judged.mean)).collect()
}

/// All outputs, and all angles together.
fn rows<T>(errors: &Errors<T>) -> impl Iterator<Item = &OutputErrors<T>> {
    errors.outputs.iter().chain(&errors.angles)
}

fn ends(out: &mut dyn Write, judged: &[(&str, &Errors<MeanStd>)]) -> io::Result<()> {
    let headings = columns("at the end of a press | unit | mean absolute | std | newest | settled (%)");
    let each =
        judged.iter().flat_map(|&(name, errors)| rows(errors).map(move |output| (name, errors, output)));
    let rows = each.map(|(name, errors, output)| {
        let figure = |figure: MeanStd| format!("{:.3}", figure.mean);
        let [mean, std] = [output.mean_absolute, output.std].map(figure);
        let settled = errors.settled_share.filter(|_| output.unit == "deg");
        let settled = cell(settled, |share| format!("{:.0}", 100.0 * share));
        let (name, unit) = (format!("{name}, {}", output.name), output.unit.clone());
        [name, unit, mean, std, cell(output.newest, figure), settled]
    });
    Table::section(out, &headings, rows)
}

/// Writes the counts of windows unlike those of the training, for networks with statistics of
/// these.
fn doubts(out: &mut dyn Write, judged: &[(&str, &Errors<MeanStd>)]) -> io::Result<()> {
    let row = |&(name, errors): &(&str, &Errors<MeanStd>)| {
        let PressDoubts { all: Doubts { predictions, unlike, bad, bad_unlike }, ends, ends_unlike } =
            errors.doubts?;
        let name = name.to_owned();
        Some([name, part(unlike, predictions), part(ends_unlike, ends), part(bad_unlike, bad)])
    };
    let rows: Vec<[String; 4]> = judged.iter().filter_map(row).collect();
    if rows.is_empty() {
        return Ok(());
    }
    let headings = columns("windows unlike the training | after contact (%) | at the end (%) | bad (%)");
    Table::section(out, &headings, rows)
}

/// Writes mean absolute errors at times since contact, always including the last one.
fn against_time(out: &mut dyn Write, report: &Report, judged: &[(&str, &Errors<MeanStd>)]) -> io::Result<()> {
    let all: Vec<(String, &OutputErrors<MeanStd>)> =
        judged.iter().flat_map(|&(name, errors)| lines(name, errors)).collect();
    let names = all.iter().map(|(name, _)| name.as_str());
    let headings: Vec<&str> = std::iter::once("ms since contact").chain(names).collect();
    let times = &report.times_us;
    let rows = shown(times.len(), MAX_TIMES, 1).map(|i| {
        let cells = all.iter().map(move |(_, output)| format!("{:.2}", output.mean_absolute_at[i].mean));
        std::iter::once((times[i] as f64 / 1e3).to_string()).chain(cells)
    });
    Table::section(out, &headings, rows)
}

/// The lines of a network: all angles together if there are several, and the other outputs.
fn lines<'a>(name: &str, errors: &'a Errors<MeanStd>) -> Vec<(String, &'a OutputErrors<MeanStd>)> {
    let single = errors.outputs.iter().filter(|output| errors.angles.is_none() || output.unit != "deg");
    let named =
        |output: &'a OutputErrors<MeanStd>| (format!("{name}, {} ({})", output.name, output.unit), output);
    errors.angles.iter().chain(single).map(named).collect()
}

/// The picture: errors against time, and for each network predicted against true values.
fn svg(report: &Report) -> String {
    let about = format!(
        "{}: {} presses, {} events",
        file_name(&report.data.file),
        grouped(report.data.presses as u64),
        grouped(report.data.events)
    );
    let mut units: Vec<&str> = Vec::new();
    for output in means(report).into_iter().flat_map(|(_, errors)| &errors.outputs) {
        if !units.contains(&output.unit.as_str()) {
            units.push(&output.unit);
        }
    }
    let curves = units.iter().map(|unit| curves(report, unit)).collect();
    let scatters = report.networks.iter().map(|network| scatters(network).collect());
    let embeddings = report.networks.iter().map(|network| embeddings(network).collect());
    let rows: Vec<Vec<Panel<'_>>> = std::iter::once(curves).chain(scatters).chain(embeddings).collect();
    page("Errors of presses", &about, &rows)
}

/// Errors against time of all outputs in `unit`.
fn curves(report: &Report, unit: &str) -> Panel<'static> {
    let times = || report.times_us.iter().map(|&t_us| t_us as f64 / 1e3);
    let all = means(report)
        .into_iter()
        .flat_map(|(name, errors)| lines(name, errors))
        .filter(|(_, output)| output.unit == unit);
    let series = all.enumerate().map(|(colour, (name, output))| {
        let name = format!("{name}: {:.2} at the end", output.mean_absolute.mean);
        let points = times().zip(output.mean_absolute_at.iter().map(|at| at.mean)).collect();
        Series::new(name, colour, Style::Line, points)
    });
    Panel::Plane(Plane {
        about: "after the end of a press its last error stands".to_owned(),
        scale: Scale::FromZero,
        series: series.collect(),
        ..Plane::new(
            "Mean absolute error against time",
            ["time since contact (ms)", &format!("error ({unit})")],
        )
    })
}

/// A panel for each output of `network`.
fn scatters(network: &NetworkReport<PressFigures>) -> impl Iterator<Item = Panel<'static>> {
    let outputs = network.result.figures.iter().flat_map(|figures| &figures.mean.outputs);
    outputs.zip(&network.result.scatter).enumerate().map(|(colour, (output, points))| {
        let name = format!("mean absolute error {:.2} {}", output.mean_absolute.mean, output.unit);
        let dots = Series::new(name, colour, Style::Dots, points.clone());
        let title = format!("{}, {}", network.card.network.name, output.name);
        Panel::Plane(Plane {
            about: "at the end of each press".to_owned(),
            ..Plane::predicted(title, &output.unit, vec![dots])
        })
    })
}

/// The smallest and the largest of `values`.
fn ends_of(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// The embedding of the readouts of `network`, once for each output, coloured by its true values.
fn embeddings(network: &NetworkReport<PressFigures>) -> impl Iterator<Item = Panel<'static>> {
    let outputs = network.result.figures.iter().flat_map(|figures| &figures.mean.outputs);
    let points = network.result.embedding.iter().flat_map(std::iter::repeat);
    outputs.zip(&network.result.scatter).zip(points).map(|((output, values), points)| {
        let truth = || values.iter().map(|value| value.0);
        let (low, high) = ends_of(truth());
        let width = (high - low).max(f64::MIN_POSITIVE) / BANDS as f64;
        let band = |value: f64| (((value - low) / width) as usize).min(BANDS - 1);
        let series = (0..BANDS).map(|colour| {
            let [from, until] = [colour, colour + 1].map(|band| low + width * band as f64);
            let of_band = truth().zip(points).filter(|(value, _)| band(*value) == colour);
            let points = of_band.map(|(_, &point)| point).collect();
            Series::new(format!("{from:.1} to {until:.1}"), colour, Style::Dots, points)
        });
        Panel::Plane(Plane {
            about: format!(
                "t-SNE of what is read out at the end of each press; colours: true {} ({})",
                output.name, output.unit
            ),
            ordered: true,
            series: series.collect(),
            ..Plane::new(
                format!("{}, readout by {}", network.card.network.name, output.name),
                ["first dimension", "second dimension"],
            )
        })
    })
}
