//! `meissner eval area`: contact area and normal force from pictures of a gel.

use std::io::{self, Write};

use meissner_engine::frames::{FrameOptions, Skip};
use meissner_evaluate::NetworkReport;
use meissner_evaluate::area::{
    AreaFigures, BaselineFigures, DataReport, Figures, Options, Report, Source, evaluate,
};
use meissner_evaluate::metrics::MeanStd;
use meissner_evaluate::trainings::seed_name;
use meissner_plot::{Bar, Bars, Panel, Plane, Scale, Series, Style, page};
use meissner_run::text::grouped;

use super::{OutputArgs, doubts, networks, write};
use crate::args::APPROXIMATIONS;
use crate::error::CliError;
use crate::tasks::AreaTask;
use crate::text::{NONE, Table, cell, columns, file_name};

/// At the end of the long help.
const METHOD: &str = "\
How it judges:
  PICTURES is a file of `meissner simulate gel`, or an archive (.npz) of real pictures of balls with the arrays background (H, W, 3) u1, difference (pictures, H, W, 3) i2, a picture less the background, and circle (pictures, 3) f8: column, row and radius of the contact. Real pictures are enlarged to twice their size, and turned by a quarter where they are higher than wide.
  The engine is reset before each press, and gets the picture of the sensor at rest. Forces are scaled to the pixels of the sensor, whose size a file of `simulate gel` states. A pixel is in contact where the pressure exceeds that of 1e-4 N on 0.06 x 0.06 mm, or inside the circle.
  IoU is the intersection over the union of predicted and true contact, 1 where there are none in both. Force: absolute error of the total normal force. Centroid: distance between the means of the pixels in contact, weighted by force where it is known. Area: absolute error. std is that over the pictures.
  even IoU: the same against the label of the paper, which spreads the force evenly over all pixels that are pressed at all. Where the share of a pixel does not exceed the threshold, none is in contact.
  image difference: contact where a picture differs from the sensor at rest by more than a threshold, averaged over 5 x 5 pixels and three colours. Of 12 thresholds the best one for these very pictures is taken, which favours the baseline.
  stereo: depth by photometric stereo. Slopes are a regression on the difference of colours, fitted to balls that are pressed into the default simulated sensor; a Poisson equation makes a depth of them, which is 0 around the picture. Contact is where it exceeds the best of 12 thresholds, the force a fitted factor times the volume there.
  time: the median of a picture, on a machine whose threads all work. multiply-adds: of a picture, without what was skipped because it did not change since the picture before of the same press.
  input unlike the training: the part of the predictions, and of bad ones, whose pictures are farther from those of the training than 999 of 1,000 of its own. A bad prediction lacks more than three times as much to an IoU of 1 as the mean.

Trainings (--trainings): every *.safetensors file of the folder is a training, with metadata
  network     name of the network
  seed        whole number

Maps (--logits):
  For every training and file a tensor NETWORK.SEED.FILE, or NETWORK.shipped.FILE where the weights name no seed, of shape (pictures, H, W): force on each pixel in N. FILE counts from 0.

Examples:
  meissner simulate gel --sensor second --indenters unseen --out unseen.safetensors
  meissner eval area unseen.safetensors --svg area.svg
  meissner eval area balls.npz --network canf";

/// Figures of the papers, on their own sensors.
const PAPER: &str = "\
the paper, on its own sensors, 0 to 20 N, unseen indenters, the sensor not trained on: even IoU 0.718, force 0.767 N; \
stereo 0.451, 1.805 N; image difference 0.294";

/// `meissner eval area`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD)]
pub(super) struct AreaArgs {
    #[command(flatten)]
    task: AreaTask,
    /// Compute only what changes by more than this between pictures of a press.
    ///
    /// It holds for the input, in which one grey level is 0.04 for the shipped networks, and for
    /// the values of every layer. Without this option, whatever changes is computed.
    #[arg(long, value_name = "CHANGE", help_heading = APPROXIMATIONS)]
    tolerance: Option<f32>,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn eval(args: &AreaArgs) -> Result<(), CliError> {
    let skip = args.tolerance.map_or(Skip::Exact, Skip::Tolerance);
    let options = Options {
        request: args.task.networks.request(),
        data: &args.task.data,
        frames: FrameOptions::new().with_skip(skip),
    };
    write(&args.output, svg, table, |workers, done| evaluate(&options, workers, done))
}

/// The report for people.
fn table(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    for data in &report.data {
        let (pictures, presses) = (grouped(data.pictures as u64), grouped(data.presses as u64));
        let source = match data.source {
            Source::Simulated => "simulated",
            Source::Real => "real",
        };
        let forces = data.force_n.map(|[least, most]| format!(", {least:.2} to {most:.2} N"));
        let forces = forces.unwrap_or_default();
        writeln!(
            out,
            "data         {}: {source}, {pictures} pictures of {presses} presses{forces}",
            data.file
        )?;
    }
    networks(out, &report.networks, &report.notes)?;
    for (index, data) in report.data.iter().enumerate() {
        set(out, report, index, data)?;
    }
    writeln!(out, "\n{PAPER}")
}

/// The figures on one file.
fn set(out: &mut dyn Write, report: &Report, index: usize, data: &DataReport) -> io::Result<()> {
    let file = file_name(&data.file);
    let figures_of = columns(
        "IoU | std | even IoU | force (N) | std | centroid (mm) | area (mm2) | million multiply-adds | time (ms)",
    );
    let headings = [&[file], &figures_of[..]].concat();
    // The figures that networks and baselines share, then the figures of networks only.
    let row = |name, iou, even, force_n, centroid_mm, area_mm2: MeanStd, [work, time]: [String; 2]| {
        [
            name,
            mean(Some(iou)),
            deviation(Some(iou)),
            mean(even),
            mean(force_n),
            deviation(force_n),
            mean(centroid_mm),
            format!("{:.2}", area_mm2.mean),
            work,
            time,
        ]
    };
    let baseline = |name: String, of: &BaselineFigures| {
        row(
            name,
            of.iou,
            of.iou_even,
            of.force_n,
            of.centroid_mm,
            of.area_mm2,
            [NONE, NONE].map(str::to_owned),
        )
    };
    let (difference, stereo) = (&data.difference, &data.stereo);
    let baselines = [
        baseline(format!("image difference above {}", difference.threshold), difference),
        baseline(format!("stereo, deeper than {} mm", stereo.threshold), stereo),
    ];
    let rows = figures(report, index).map(|(name, of)| {
        let work = [grouped(of.multiply_adds / 1_000_000), format!("{:.1}", of.update_us / 1e3)];
        row(name, of.iou, of.iou_even, of.force_n, of.centroid_mm, of.area_mm2, work)
    });
    Table::section(out, &headings, rows.chain(baselines))?;
    let kinds = figures(report, index).flat_map(|(name, figures)| {
        figures.kinds.iter().map(move |(kind, figures)| {
            let pictures = grouped(figures.pictures as u64);
            [format!("{name}, {kind}"), pictures, mean(Some(figures.iou)), mean(figures.force_n)]
        })
    });
    Table::section(out, &["by indenter", "pictures", "IoU", "force (N)"], kinds)?;
    doubts(out, figures(report, index).map(|(name, figures)| (name, figures.doubts)))
}

/// The figures of each network and training on file number `index`, with their names.
fn figures(report: &Report, index: usize) -> impl Iterator<Item = (String, &Figures)> {
    report.networks.iter().flat_map(move |network: &NetworkReport<AreaFigures>| {
        network.result.trainings.iter().map(move |training| {
            let name = &network.card.network.name;
            let name = match &network.result.trainings[..] {
                [_] => name.clone(),
                _ => format!("{name}, seed {}", seed_name(training.seed)),
            };
            (name, &training.sets[index])
        })
    })
}

fn mean(figure: Option<MeanStd>) -> String {
    cell(figure, |figure| format!("{:.3}", figure.mean))
}

fn deviation(figure: Option<MeanStd>) -> String {
    cell(figure.and_then(|figure| figure.std), |std| format!("{std:.3}"))
}

/// The overlap of contacts as bars, then predicted against true forces of each file that has them.
fn svg(report: &Report) -> String {
    let names: Vec<_> = report.data.iter().map(|data| file_name(&data.file)).collect();
    let row = |index: usize| {
        let panel = |(colour, (name, figures)): (usize, (String, &Figures))| {
            let error = format!("mean absolute error {} N", mean(figures.force_n));
            let dots = Series::new(error, colour, Style::Dots, figures.scatter.clone());
            Panel::Plane(Plane {
                about: format!("total force; IoU {:.3}", figures.iou.mean),
                scale: Scale::FromZero,
                ..Plane::predicted(format!("{name}, {}", names[index]), "N", vec![dots])
            })
        };
        let with_force = figures(report, index).filter(|(_, figures)| !figures.scatter.is_empty());
        with_force.enumerate().map(panel).collect::<Vec<_>>()
    };
    let mut overlaps: Vec<(String, Vec<Option<Bar>>)> = Vec::new();
    for index in 0..report.data.len() {
        for (i, (name, figures)) in figures(report, index).enumerate() {
            if index == 0 {
                overlaps.push((name, Vec::new()));
            }
            overlaps[i].1.push(Some(Bar { mean: figures.iou.mean, std: None }));
        }
    }
    let reference = |name: &str, of: fn(&DataReport) -> &BaselineFigures| {
        (name.to_owned(), report.data.iter().map(|data| Some(of(data).iou.mean)).collect())
    };
    let bars = Bars {
        groups: names.iter().map(|&name| name.to_owned()).collect(),
        series: overlaps,
        references: vec![
            reference("image difference", |data| &data.difference),
            reference("stereo", |data| &data.stereo),
        ],
        y_title: "IoU of contacts (%)".to_owned(),
        note: "mean over the pictures".to_owned(),
    };
    let forces = (0..report.data.len()).map(row).filter(|row| !row.is_empty());
    let rows: Vec<_> = std::iter::once(vec![Panel::Bars(bars)]).chain(forces).collect();
    page("Contact area and normal force", &names.join(", "), &rows)
}
