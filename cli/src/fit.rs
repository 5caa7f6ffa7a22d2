//! `meissner fit`: the head of a network, fitted to presses of another sensor.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use meissner_evaluate::fit::{
    self, DEFAULT_AGES, DEFAULT_FOLDS, Figure, Head, Options, OutputFigures, Report,
};
use meissner_evaluate::{ProgressHandle, Workers};
use meissner_plot::{Panel, Plane, Scale, Series, Style, page};
use meissner_run::RunError;
use meissner_run::model::describe;
use meissner_run::text::{date_now, grouped, span_us};
use serde::Serialize;

use crate::args::{JsonArgs, MEASUREMENT, MapArgs, NETWORK, OUTPUT, Threads};
use crate::error::CliError;
use crate::eval::confusion;
use crate::output::{Force, check_result, print, write};
use crate::prepare::presses::{PressInput, strict};
use crate::progress::Progress;
use crate::text::{Table, cell, columns};

/// At the end of the long help.
const METHOD: &str = "\
How it fits:
  The layers of events of NETWORK stay as they are. Where its readout sums, it also sums the number of events and their polarities. Dense layers behind the readout replace those of NETWORK or its head. Where these have other layers with weights and there is no --grid, the dense layers alone and the last layer alone are replaced as well, and what predicts held-out presses best is kept; dense layers that were fitted to the same presses never stay. The new layers are fitted to readouts that the engine itself computes: at the end of each press (its last labelled instant) and at random ages from a tenth of the press on, for labels along time and for classes. `meissner prepare presses --help` says how labels may look.
  Numbers: ridge regression. Classes: a discriminant with shrunken covariance. Both read the readout and products of its main modes, or Gaussian kernels of these around the presses. `--hidden` adds perceptrons for what these leave. The strength, and whether products or kernels help, is what is best on presses that are held out: every press is held out by one fold, and never by sample. Errors that are shown are of presses that were held out, with a strength that other folds chose.
  Degrees become radians, unless NETWORK has an output of the same name in degrees.

What it says, with intervals in which the figure lies in 95 % of resamples of the presses:
  error     mean absolute error at the end of a press, or share of wrong classes
  constant  the same of the mean of the labels, or of the most frequent class
  before    the same of NETWORK as it was, if it has an output of the same name
  curve     the same for heads that are fitted to a quarter, a half and all of the presses, and whether more would help

Files in the folder --out:
  NAME.toml          description
  NAME.safetensors   weights; the metadata say what they were fitted to
  NAME.md            this report, and the day
  NAME.svg           predicted against true values, errors against age

Examples:
  meissner fit tactigraph-past mine/ --out fitted --name mine
  meissner run mine/press1.aedat4 --network fitted/mine.toml --weights fitted/mine.safetensors
  meissner prepare digits nmnist/ --out digits.safetensors
  meissner fit digits-past digits.safetensors --out fitted --name digits";

/// `meissner fit`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD)]
#[command(mut_arg("strict", strict))]
pub(crate) struct FitArgs {
    /// Name of a shipped network over events, or a description file.
    #[arg(value_name = "NETWORK")]
    network: String,
    #[command(flatten)]
    input: PressInput,
    /// File with the weights of NETWORK [default: those shipped with it].
    #[arg(long, value_name = "FILE", help_heading = NETWORK)]
    weights: Option<PathBuf>,
    #[command(flatten)]
    map: MapArgs,
    /// Labels that are fitted, with commas between them [default: all numbers].
    ///
    /// Several labels of numbers, or one label of classes. Without this option, it is all labels of
    /// numbers; if there are none, the first label of classes.
    #[arg(long, value_name = "NAME", value_delimiter = ',', help_heading = NETWORK)]
    outputs: Option<Vec<String>>,
    /// Another length of the window, such as 2s [default: that of NETWORK].
    ///
    /// Layers of events that were trained on another length may see less of a press.
    #[arg(long, value_name = "TIME", value_parser = span_us, help_heading = NETWORK)]
    span: Option<i64>,
    /// Columns and rows of the readout [default: those of NETWORK, or finer ones].
    ///
    /// Such as 32x32: small motions show in small cells. Where the readout of NETWORK sums, its
    /// cells are halved while they have more than 4 pixels a side, up to 2,304 cells.
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = grid, help_heading = NETWORK)]
    grid: Option<[u32; 2]>,
    /// Units of a perceptron beside the ridge, or instead of the discriminant.
    ///
    /// There is one for each fold, trained with gradients and stopped where it is best on another
    /// fold; the network has their mean. They are left out where they predict held-out presses no
    /// better.
    #[arg(long, value_name = "N", default_value_t = 0,
          value_parser = clap::value_parser!(u16).range(..=1024), help_heading = NETWORK)]
    hidden: u16,
    /// Number of parts of the presses, each of which is held out once.
    #[arg(long, value_name = "N", default_value_t = DEFAULT_FOLDS as u16,
          value_parser = clap::value_parser!(u16).range(2..=100), help_heading = NETWORK)]
    folds: u16,
    /// Number of random ages at which each press is read, beside its end.
    #[arg(long, value_name = "N", default_value_t = DEFAULT_AGES as u16,
          value_parser = clap::value_parser!(u16).range(0..=1000), help_heading = NETWORK)]
    ages: u16,
    /// Also read each press moved by so many pixels, where labels stay the same.
    ///
    /// It is read moved to the left, right, top and bottom, at all ages. Events beside the sensor
    /// are dropped. Presses that are held out are predicted as they are. It helps where the place
    /// of a press varies and says nothing of its label, and takes five times as long.
    #[arg(long, value_name = "PIXELS", default_value_t = 0, help_heading = NETWORK)]
    shift: u16,
    /// Seed of random ages, of presses of the learning curve, and of intervals.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = MEASUREMENT)]
    seed: u64,
    #[command(flatten)]
    threads: Threads,
    /// Folder to write into; it is made if it does not exist.
    #[arg(long, value_name = "FOLDER", help_heading = OUTPUT)]
    out: PathBuf,
    /// Name of the fitted network, and of its files [default: that of --out].
    #[arg(long, value_name = "NAME", help_heading = OUTPUT)]
    name: Option<String>,
    #[command(flatten)]
    json: JsonArgs,
    #[command(flatten)]
    force: Force,
}

/// The report with the files.
#[derive(Serialize)]
struct Written<'a> {
    #[serde(flatten)]
    report: &'a Report,
    files: Vec<String>,
}

/// Columns and rows.
fn grid(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once('x').and_then(|(columns, rows)| {
        let [columns, rows] = [columns, rows].map(|side| side.parse().ok().filter(|side| *side > 0));
        Some([columns?, rows?])
    });
    sides.ok_or_else(|| "expected columns and rows, such as 32x32".to_owned())
}

/// Fits a network and writes it.
pub(crate) fn fit(args: &FitArgs) -> Result<(), CliError> {
    let of_folder = || args.out.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = args.name.clone().or_else(of_folder);
    let name = name.ok_or_else(|| CliError::usage("--out", "a folder with a name, or --name", "neither"))?;
    if Path::new(&name).file_name().is_none_or(|file| *file != *name) {
        return Err(CliError::usage("--name", "the name of a file without its folder", &name));
    }
    fs::create_dir_all(&args.out).map_err(|error| RunError::file("make", &args.out, error))?;
    let path = |extension: &str| args.out.join(format!("{name}.{extension}"));
    let paths = ["toml", "safetensors", "md", "svg"].map(path);
    paths.iter().try_for_each(|path| check_result(path, args.force))?;
    // Checked before minutes of reading.
    describe(&args.network)?;
    let presses = args.input.read()?;
    let options = Options {
        weights: args.weights.clone(),
        map: args.map.of(args.weights.as_deref()).map(|file| file.map.to_vec()).unwrap_or_default(),
        labels: args.outputs.clone(),
        span_us: args.span,
        grid: args.grid,
        hidden: usize::from(args.hidden),
        folds: usize::from(args.folds),
        ages: usize::from(args.ages),
        shift: args.shift,
        seed: args.seed,
        ..Options::new(&args.network, &name)
    };
    let watch = ProgressHandle::default();
    let workers = Workers::new(args.threads.pool()?, watch.clone());
    let progress = Progress::busy(move || match (watch.done(), watch.total()) {
        (done, total) if done < total => format!("{done} of {total} presses read out"),
        _ => "fitting".to_owned(),
    });
    let fitted = fit::fit(&presses, &options, &workers)?;
    progress.finish();
    let report = &fitted.report;
    let [description, weights, card, picture] = &paths;
    let about = format!(
        "# {name}: the layers of events of {}, and dense layers that `meissner fit` has fitted.\n",
        report.base.name
    );
    write(description, about + &fitted.description)?;
    write(weights, &fitted.weights)?;
    write(card, page_of(&name, report, [description, weights])?)?;
    write(picture, svg(&name, report))?;
    let files = paths.iter().map(|path| path.display().to_string()).collect();
    let written = Written { report, files };
    print(args.json.json, &written, |out| {
        text(out, report)?;
        writeln!(out, "\n{}", written.files.join("\n"))
    })
}

/// The card for people.
fn page_of(name: &str, report: &Report, [description, weights]: [&Path; 2]) -> io::Result<Vec<u8>> {
    let mut out = Vec::new();
    writeln!(out, "# {name}\n\nFitted on {} by `meissner fit`. It runs with\n\n```sh", date_now())?;
    let file =
        |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    writeln!(out, "meissner run RECORDING --network {} --weights {}", file(description), file(weights))?;
    writeln!(out, "```\n\n```text")?;
    text(&mut out, report)?;
    writeln!(out, "```")?;
    Ok(out)
}

/// The report for people.
fn text(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let (data, base, sensor) = (&report.data, &report.base, &report.sensor);
    let count = |count: usize| grouped(count as u64);
    writeln!(out, "layers     {}: {}", base.name, base.weights)?;
    let (presses, events, instants) = (count(data.presses), grouped(data.events), count(data.instants));
    writeln!(out, "data       {}: {presses} presses, {events} events", data.folder)?;
    writeln!(out, "readouts   {instants} of {} values", count(base.readout))?;
    writeln!(out, "held out   each press once, in {} folds; seed {}", report.folds, report.seed)?;
    let size = |[width, height]: [u16; 2]| format!("{width}x{height}");
    let trained = cell(sensor.trained_size, size);
    let rate = cell(sensor.events_per_s, |rate| grouped(rate.round() as u64));
    let on = 100.0 * sensor.on_share;
    writeln!(
        out,
        "sensor     {}, the training's {trained}; {rate} events/s, {on:.0} % on",
        size(sensor.size)
    )?;
    for note in data.notes.iter().chain(&sensor.notes) {
        writeln!(out, "note       {note}")?;
    }
    if let [_, _, ..] = &report.heads[..] {
        let headings = columns("head | values read | error / constant's");
        let rows = report.heads.iter().map(|of| {
            let head = match of.head {
                Head::New => "new".to_owned(),
                Head::Kept { layers: 1, .. } => "behind the first layer of the old one".to_owned(),
                Head::Kept { layers, .. } => format!("behind {layers} layers of the old one"),
            };
            [head.clone(), count(of.values), short(of.error)]
        });
        Table::section(out, &headings, rows)?;
    }
    let headings = columns("end of a press | unit | error | 95 % | constant | before | strength | with");
    let rows = report.outputs.iter().map(|of| {
        let before = cell(of.before, |before| short(before.mean));
        let [error, constant] = [of.error, of.constant].map(|figure| short(figure.mean));
        let (name, unit) = (of.name.clone(), of.unit.clone());
        let with = match [of.products, of.width] {
            [0.0, 0.0] => String::new(),
            [products, 0.0] => format!("products {products}"),
            [_, width] => format!("kernel {width}"),
        };
        [name, unit, error, interval(of.error), constant, before, of.strength.to_string(), with]
    });
    Table::section(out, &headings, rows)?;
    let points = report.outputs.iter().flat_map(|of| of.curve.iter().map(move |point| (of, point)));
    let rows = points.map(|(of, point)| {
        let error = short(point.error.mean);
        [of.name.clone(), count(point.presses), error, interval(point.error)]
    });
    Table::section(out, &columns("fitted to | presses | error | 95 %"), rows)?;
    let ages = report.outputs.iter().flat_map(|of| of.ages.iter().map(move |age| (of, age)));
    let rows = ages.map(|(of, age)| {
        let span = format!("{:.0} to {:.0}", age.from_us as f64 / 1e3, age.until_us as f64 / 1e3);
        [of.name.clone(), span, count(age.instants), short(age.error)]
    });
    Table::section(out, &columns("by age | ms | readouts | error"), rows)?;
    if let (Some(classes), Some(counts)) = (&report.classes, &report.confusion) {
        let classes: Vec<&str> = classes.iter().map(String::as_str).collect();
        confusion(out, "held-out presses", &classes, "presses", counts, 1)?;
    }
    writeln!(out)?;
    report.outputs.iter().try_for_each(|of| writeln!(out, "{}", of.advice))
}

fn interval(figure: Figure) -> String {
    let [low, high] = figure.interval.map(short);
    format!("{low} to {high}")
}

/// A number with about three digits.
fn short(value: f64) -> String {
    let decimals = match value.abs() {
        100.0.. => 1,
        10.0.. => 2,
        0.1.. => 3,
        _ => 4,
    };
    format!("{value:.decimals$}")
}

/// The picture: predicted against true values of held-out presses, and errors against age.
fn svg(name: &str, report: &Report) -> String {
    let presses = report.data.presses;
    let about =
        format!("layers of {}, {} presses, each held out once", report.base.name, grouped(presses as u64));
    let scatters: Vec<Panel<'_>> =
        report.outputs.iter().zip(&report.scatter).map(|(of, points)| scatter(of, points)).collect();
    let curves = report.outputs.iter().map(curve).collect();
    page(name, &about, &[scatters, curves])
}

fn scatter(of: &OutputFigures, points: &[(f64, f64)]) -> Panel<'static> {
    let dots = Series::new(
        format!("mean absolute error {} {}", short(of.error.mean), of.unit),
        0,
        Style::Dots,
        points.to_vec(),
    );
    Panel::Plane(Plane {
        about: "at the end of presses that were held out".to_owned(),
        ..Plane::predicted(of.name.clone(), &of.unit, vec![dots])
    })
}

fn curve(of: &OutputFigures) -> Panel<'static> {
    let middle = |from: i64, until: i64| (from + until) as f64 / 2e3;
    let points: Vec<(f64, f64)> =
        of.ages.iter().map(|age| (middle(age.from_us, age.until_us), age.error)).collect();
    let ends = points.first().zip(points.last());
    let constant = ends.map(|(first, last)| vec![(first.0, of.constant.mean), (last.0, of.constant.mean)]);
    let title = format!("error ({})", of.unit);
    Panel::Plane(Plane {
        about: "mean over presses that were held out".to_owned(),
        scale: Scale::FromZero,
        series: vec![
            Series::new("constant, at the end", 5, Style::Dashed, constant.unwrap_or_default()),
            Series::new("fitted", 0, Style::Line, points),
        ],
        ..Plane::new(format!("{}, by age", of.name), ["ms since the first event", &title])
    })
}
