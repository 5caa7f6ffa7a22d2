//! `meissner eval angle`: errors of networks that predict quantities from the events of presses.

use std::io::{self, Write};

use meissner_evaluate::NetworkReport;
use meissner_evaluate::judge::TrainingFigures;
use meissner_evaluate::metrics::MeanStd;
use meissner_evaluate::regression::{Errors, Options, OutputErrors, PressFigures, Report, evaluate};
use meissner_evaluate::trainings::seed_name;
use meissner_plot::{Panel, Plane, Series, Style, page};
use meissner_run::predictor::Mode;
use meissner_run::text::grouped;

use super::events::every_us;
use super::{NONE, OutputArgs, networks, write};
use crate::args::{MODES, NETWORK, PREDICTIONS, choice};
use crate::error::CliError;
use crate::tasks::PressTask;
use crate::text::{Table, duration, file_name};

/// Largest number of rows of the table of errors against time. JSON has all times.
const MAX_TIMES: usize = 25;

/// Colours of an embedding.
const BANDS: usize = 6;

/// At the end of the long help.
const METHOD: &str = "\
How it judges:
  EVENTS has streams as `meissner simulate markers` writes them from tracks with labels: each is a press. A network must predict labels of the file; the others are not needed. Angles in radians are reported in degrees.
  The engine is reset before each press. Contact is where the label depth leaves 0 (without this label, the first time of the truth), the end is the last time of the truth. Predictions are read every TIME (--every) before and after contact, and at the end. Labels are linear between their times.
  std is that of the absolute errors over the presses. After the end of a press its last error stands, so that each press counts at each time.
  newest: at every millisecond from contact to the end, the error of the newest prediction that a reader has, latency included, against the truth at that millisecond. Latencies are those of this machine: one thread pushes and predicts, and begins when a prediction is due or when it has finished the one before.
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
    /// Take every Nth event of each press [default: as the weights say].
    ///
    /// The first event is taken. The metadata of the weights state the stride of the training; if they state none, every
    /// event is taken.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = NETWORK)]
    stride: Option<u32>,
    /// Time between two predictions, from 100us to 10s.
    #[arg(long = "every", value_name = "TIME", default_value = "1ms", value_parser = every_us,
          help_heading = PREDICTIONS)]
    every_us: i64,
    /// Recompute what an event changes, or every row at every prediction.
    ///
    /// Both give the same values, bit for bit. Frame networks compute what changes.
    #[arg(long, value_parser = choice(MODES), default_value = "incremental", help_heading = PREDICTIONS)]
    mode: Mode,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn eval(args: &AngleArgs) -> Result<(), CliError> {
    let options = Options {
        request: args.task.request(),
        stride: args.stride.map(|stride| stride as usize),
        every_us: args.every_us,
        mode: args.mode,
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
    let judged: Vec<(&str, &Errors<MeanStd>)> = judged(report).collect();
    ends(out, &judged)?;
    seeds(out, report)?;
    work(out, &judged)?;
    against_time(out, report, &judged)
}

/// The name of each network with its figures.
fn judged(report: &Report) -> impl Iterator<Item = (&str, &Errors<MeanStd>)> {
    report.networks.iter().filter_map(|network| {
        Some((network.card.network.name.as_str(), &network.result.figures.as_ref()?.mean))
    })
}

/// All outputs, and all angles together.
fn rows<T>(errors: &Errors<T>) -> impl Iterator<Item = &OutputErrors<T>> {
    errors.outputs.iter().chain(&errors.angles)
}

fn ends(out: &mut dyn Write, judged: &[(&str, &Errors<MeanStd>)]) -> io::Result<()> {
    let headings = ["at the end of a press", "unit", "mean absolute", "std", "newest", "settled (%)"];
    let each =
        judged.iter().flat_map(|&(name, errors)| rows(errors).map(move |output| (name, errors, output)));
    let rows = each.map(|(name, errors, output)| {
        let newest = output.newest.map_or_else(|| NONE.to_owned(), |newest| format!("{:.3}", newest.mean));
        let is_angle = output.unit == "deg";
        let settled = errors.settled_share.filter(|_| is_angle).map(|share| format!("{:.0}", 100.0 * share));
        let [mean, std] = [output.mean_absolute, output.std].map(|value| format!("{:.3}", value.mean));
        let settled = settled.unwrap_or_else(|| NONE.to_owned());
        [format!("{name}, {}", output.name), output.unit.clone(), mean, std, newest, settled]
    });
    Table::section(out, &headings, rows)
}

/// Each seed, where there are several.
fn seeds(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let all =
        || report.networks.iter().filter_map(|network| Some((network, network.result.figures.as_ref()?)));
    if all().all(|(_, judged)| judged.trainings < 2) {
        return Ok(());
    }
    let each = all().flat_map(|(network, judged)| judged.each.iter().map(move |one| (network, one)));
    let rows = each.flat_map(|(network, TrainingFigures { seed, figures, .. })| {
        let name = format!("{}, seed {}", network.card.network.name, seed_name(*seed));
        rows(figures).map(move |output| {
            let [mean, std] = [output.mean_absolute, output.std].map(|value| format!("{value:.3}"));
            [format!("{name}, {}", output.name), output.unit.clone(), mean, std]
        })
    });
    Table::section(out, &["each seed", "unit", "mean absolute", "std"], rows)
}

fn work(out: &mut dyn Write, judged: &[(&str, &Errors<MeanStd>)]) -> io::Result<()> {
    let headings = [
        "work of a press",
        "events",
        "predictions",
        "rows",
        "multiply-adds (million)",
        "update p50 (us)",
        "p99 (us)",
    ];
    let rows = judged.iter().map(|(name, errors)| {
        let work = &errors.work;
        let per_press = |count: u64| count as f64 / work.presses.max(1) as f64;
        let count = |count: u64| grouped(per_press(count).round() as u64);
        let [p50, p99] = work.update_us.quantiles().map_or_else(
            || [NONE, NONE].map(str::to_owned),
            |quantiles| [quantiles.p50, quantiles.p99].map(duration),
        );
        let rows = if work.rows == 0 { NONE.to_owned() } else { count(work.rows) };
        let products = format!("{:.1}", per_press(work.multiply_adds) / 1e6);
        [(*name).to_owned(), count(work.events), count(work.predictions), rows, products, p50, p99]
    });
    Table::section(out, &headings, rows)
}

/// Mean absolute errors at times since contact, the last one always.
fn against_time(out: &mut dyn Write, report: &Report, judged: &[(&str, &Errors<MeanStd>)]) -> io::Result<()> {
    let all: Vec<(String, &OutputErrors<MeanStd>)> =
        judged.iter().flat_map(|&(name, errors)| lines(name, errors)).collect();
    let names = all.iter().map(|(name, _)| name.as_str());
    let headings: Vec<&str> = std::iter::once("ms since contact").chain(names).collect();
    let times = &report.times_us;
    let step = times.len().div_ceil(MAX_TIMES).max(1);
    let shown = (0..times.len()).filter(|i| i % step == 0 || i + 1 == times.len());
    let rows = shown.map(|i| {
        let cells = all.iter().map(move |(_, output)| format!("{:.2}", output.mean_absolute_at[i].mean));
        std::iter::once((times[i] as f64 / 1e3).to_string()).chain(cells)
    });
    Table::section(out, &headings, rows)
}

/// The lines of a network: all angles together where there are several, and the outputs that are no angles.
fn lines<'a>(name: &str, errors: &'a Errors<MeanStd>) -> Vec<(String, &'a OutputErrors<MeanStd>)> {
    let single = errors.outputs.iter().filter(|output| errors.angles.is_none() || output.unit != "deg");
    let named =
        |output: &'a OutputErrors<MeanStd>| (format!("{name}, {} ({})", output.name, output.unit), output);
    errors.angles.iter().chain(single).map(named).collect()
}

/// The picture: errors against time, and for each network found values against true ones at the end of a press.
fn svg(report: &Report) -> String {
    let about = format!(
        "{}: {} presses, {} events",
        file_name(&report.data.file),
        grouped(report.data.presses as u64),
        grouped(report.data.events)
    );
    let mut units: Vec<&str> = Vec::new();
    for output in judged(report).flat_map(|(_, errors)| &errors.outputs) {
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
    let all = judged(report)
        .flat_map(|(name, errors)| lines(name, errors))
        .filter(|(_, output)| output.unit == unit);
    let series = all.enumerate().map(|(colour, (name, output))| Series {
        name: format!("{name}: {:.2} at the end", output.mean_absolute.mean),
        colour,
        style: Style::Line,
        points: times().zip(output.mean_absolute_at.iter().map(|at| at.mean)).collect(),
    });
    Panel::Plane(Plane {
        title: "Mean absolute error against time".to_owned(),
        about: "after the end of a press its last error stands".to_owned(),
        x_title: "time since contact (ms)".to_owned(),
        y_title: format!("error ({unit})"),
        from_zero: true,
        ordered: false,
        series: series.collect(),
    })
}

/// A panel for each output of `network`.
fn scatters(network: &NetworkReport<PressFigures>) -> impl Iterator<Item = Panel<'static>> {
    let outputs = network.result.figures.iter().flat_map(|figures| &figures.mean.outputs);
    outputs.zip(&network.result.scatter).enumerate().map(|(colour, (output, points))| {
        let ends = points
            .iter()
            .map(|point| point.0)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let equal = Series {
            name: "equal".to_owned(),
            colour: 5,
            style: Style::Dashed,
            points: vec![(ends.0, ends.0), (ends.1, ends.1)],
        };
        let name = format!("mean absolute error {:.2} {}", output.mean_absolute.mean, output.unit);
        let dots = Series { name, colour, style: Style::Dots, points: points.clone() };
        Panel::Plane(Plane {
            title: format!("{}, {}", network.card.network.name, output.name),
            about: "at the end of each press".to_owned(),
            x_title: format!("true ({})", output.unit),
            y_title: format!("predicted ({})", output.unit),
            from_zero: false,
            ordered: false,
            series: vec![equal, dots],
        })
    })
}

/// The embedding of what `network` reads out, once for each output, whose true values give the colours.
fn embeddings(network: &NetworkReport<PressFigures>) -> impl Iterator<Item = Panel<'static>> {
    let outputs = network.result.figures.iter().flat_map(|figures| &figures.mean.outputs);
    let points = network.result.embedding.iter().flat_map(std::iter::repeat);
    outputs.zip(&network.result.scatter).zip(points).map(|((output, values), points)| {
        let truth = || values.iter().map(|value| value.0);
        let (low, high) =
            truth().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let width = (high - low).max(f64::MIN_POSITIVE) / BANDS as f64;
        let band = |value: f64| (((value - low) / width) as usize).min(BANDS - 1);
        let series = (0..BANDS).map(|colour| Series {
            name: format!("{:.1} to {:.1}", low + width * colour as f64, low + width * (colour + 1) as f64),
            colour,
            style: Style::Dots,
            points: truth()
                .zip(points)
                .filter(|(v, _)| band(*v) == colour)
                .map(|(_, &point)| point)
                .collect(),
        });
        Panel::Plane(Plane {
            title: format!("{}, readout by {}", network.card.network.name, output.name),
            about: format!(
                "t-SNE of what is read out at the end of each press; colours: true {} ({})",
                output.name, output.unit
            ),
            x_title: "first dimension".to_owned(),
            y_title: "second dimension".to_owned(),
            from_zero: false,
            ordered: true,
            series: series.collect(),
        })
    })
}
