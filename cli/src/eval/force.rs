//! `meissner eval force`: errors of networks that predict the force of a grasp.

use std::io::{self, Write};

use clap::Arg;
use meissner_evaluate::NetworkReport;
use meissner_evaluate::force::{ForceErrors, ForceFigures, Options, PartErrors, Report, evaluate};
use meissner_evaluate::metrics::MeanStd;
use meissner_plot::{Panel, Plane, Scale, Series, Style, page};
use meissner_run::text::grouped;

use super::{OutputArgs, PredictionArgs, doubts, judged, networks, seeds, work, write};
use crate::error::CliError;
use crate::tasks::ForceTask;
use crate::text::{NONE, Table, cell, columns, file_name};

/// Number of recordings in the picture.
const DRAWN: usize = 3;
/// The paper's error of its `ConvLSTM` over all frames with a force, in square newtons.
const PAPER_MSE: f64 = 0.145;

/// At the end of the long help.
const METHOD: &str = "\
How it judges:
  EVENTS has streams as `meissner simulate grasp` writes them, with the label force along time, and perhaps phase and bolt. The engine is reset before each recording. The force at the end of each frame of 10 ms counts, for every kind of network; frames begin with the first time of the labels.
  MSE and MAE are means over the frames of all recordings. Their deviations are standard deviations of the recordings' own MSE and MAE.
  contact: the frames whose true force is not 0, which are all that the paper judges.
  DTW: the mean over recordings of the distance of dynamic time warping between predicted and true force, in N (Sakoe and Chiba 1978; absolute differences, no window). Bhattacharyya: the distance between the histograms of all predicted and all true forces, in bins of 0.1 N. Both are of a part's own frames.
  newest: at every millisecond, the squared error of the newest prediction that a reader has, latency included, against the truth at that millisecond. A frame network has a new one every 10 ms, a network over events every TIME (--every).
  input unlike the training: the part of the predictions, and of bad ones, whose windows or frames are farther from those of the training than 999 of 1,000 of its own. A bad prediction has an error of more than three times the MAE.
  The paper: Baghaei Naeini et al. 2020, on recordings of its own sensor.

Trainings (--trainings): every *.safetensors file of the folder is a training, with metadata
  network     name of the network
  seed        whole number
  held_out    JSON list of the recordings of EVENTS that it has not seen, such as [\"17\"], for leave-one-out: all files of a seed together must hold out each recording once; without this key, it has seen no recording of EVENTS

Outputs (--logits), at the end of each frame, recording after recording:
  For every training a tensor NETWORK.SEED, NETWORK.SEED.folds or NETWORK.shipped, of shape (frames, 1).

Examples:
  meissner simulate grasp --recordings 92 --seed 2 --out test.safetensors
  meissner eval force test.safetensors --svg force.svg";

/// `meissner eval force`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD, mut_arg("every_us", dividing_a_frame))]
pub(super) struct ForceArgs {
    #[command(flatten)]
    task: ForceTask,
    #[command(flatten)]
    predictions: PredictionArgs,
    #[command(flatten)]
    output: OutputArgs,
}

/// `--every` for networks that are compared with networks over frames of 10 ms.
fn dividing_a_frame(arg: Arg) -> Arg {
    arg.help("Time between two predictions of a network over events; it divides 10ms")
}

pub(super) fn eval(args: &ForceArgs) -> Result<(), CliError> {
    let PredictionArgs { every_us, mode } = args.predictions;
    let options = Options { request: args.task.networks.request(), every_us, mode };
    write(&args.output, svg, table, |workers, done| evaluate(&args.task.events, &options, workers, done))
}

/// The report for people.
fn table(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let data = &report.data;
    let (recordings, events) = (grouped(data.recordings as u64), grouped(data.events));
    writeln!(out, "data         {}: {recordings} recordings, {events} events", data.file)?;
    writeln!(out, "force        variance {:.4} N^2: MSE of the mean predictor", data.variance)?;
    networks(out, &report.networks, &data.notes)?;
    let figures = judged(&report.networks, |result: &ForceFigures| result.figures.as_ref());
    let all: Vec<_> = figures.iter().map(|&(name, judged)| (name, &judged.mean)).collect();
    errors(out, "frames", &all, |errors| &errors.parts, None)?;
    let mse = format!("{PAPER_MSE:.3}");
    let paper = ["the paper, its own sensor: ConvLSTM, all", NONE, &mse, NONE, NONE, NONE];
    errors(out, "contact", &all, |errors| &errors.contact, Some(paper.map(str::to_owned)))?;
    distances(out, &all)?;
    let newest = all.iter().map(|(name, errors)| {
        [(*name).to_owned(), cell(errors.newest, |newest| format!("{:.4}", newest.mean))]
    });
    Table::section(out, &["newest", "MSE (N^2)"], newest)?;
    doubts(out, all.iter().map(|(name, errors)| ((*name).to_owned(), errors.doubts)))?;
    seeds(out, ["each seed", "MSE (N^2)", "MAE (N)"], &figures, |name, one| {
        let first = one.figures.parts.first();
        let figure = |of: Option<f64>| cell(of, |of| format!("{of:.4}"));
        vec![[name, figure(first.map(|part| part.mse)), figure(first.map(|part| part.mae))]]
    })?;
    work(out, "recording", all.iter().map(|&(name, errors)| (name, &errors.work)))
}

/// Rows as in the paper: a row for each network and part, then perhaps the paper's.
fn errors(
    out: &mut dyn Write,
    heading: &str,
    judged: &[(&str, &ForceErrors<MeanStd>)],
    of: fn(&ForceErrors<MeanStd>) -> &[PartErrors<MeanStd>],
    paper: Option<[String; 6]>,
) -> io::Result<()> {
    let headings = [heading, "count", "MSE (N^2)", "std", "MAE (N)", "std"];
    let rows = judged.iter().flat_map(|(name, errors)| {
        of(errors).iter().map(move |part| {
            let [mse, mse_std, mae, mae_std] =
                [part.mse, part.mse_std, part.mae, part.mae_std].map(|figure| format!("{:.4}", figure.mean));
            [format!("{name}, {}", part.part), grouped(part.frames), mse, mse_std, mae, mae_std]
        })
    });
    Table::section(out, &headings, rows.chain(paper))
}

/// A row for each network and part; a part may have no frames in contact.
fn distances(out: &mut dyn Write, judged: &[(&str, &ForceErrors<MeanStd>)]) -> io::Result<()> {
    let headings = columns("distances | DTW (N) | contact | Bhattacharyya | contact");
    let rows = judged.iter().flat_map(|(name, errors)| {
        errors.parts.iter().map(move |part| {
            let touched = errors.contact.iter().find(|touched| touched.part == part.part);
            let warping = |of: Option<MeanStd>| cell(of, |figure| format!("{:.3}", figure.mean));
            let shared = |of: Option<MeanStd>| cell(of, |figure| format!("{:.4}", figure.mean));
            [
                format!("{name}, {}", part.part),
                warping(Some(part.time_warping)),
                warping(touched.map(|touched| touched.time_warping)),
                shared(part.bhattacharyya),
                shared(touched.and_then(|touched| touched.bhattacharyya)),
            ]
        })
    });
    Table::section(out, &headings, rows)
}

/// The picture: for each network, predicted and true force over the time of some recordings.
fn svg(report: &Report) -> String {
    let about = format!(
        "{}: {} recordings, {} events",
        file_name(&report.data.file),
        grouped(report.data.recordings as u64),
        grouped(report.data.events)
    );
    let period_ms = report.period_us as f64 / 1e3;
    let panel = |network: &NetworkReport<ForceFigures>, number: usize| {
        let trace = &network.result.traces[number];
        let series = |name: &str, colour: usize, style: Style, of: fn(&(f64, f64)) -> f64| {
            let points = trace.iter().enumerate().map(|(i, pair)| ((i + 1) as f64 * period_ms, of(pair)));
            Series::new(name, colour, style, points.collect())
        };
        let squares = trace.iter().map(|(truth, found)| (truth - found) * (truth - found)).sum::<f64>();
        let mse = squares / trace.len().max(1) as f64;
        let found = format!("predicted, MSE {mse:.3} N\u{b2}");
        Panel::Plane(Plane {
            about: "at the end of each frame".to_owned(),
            scale: Scale::FromZero,
            series: vec![
                series("true", 5, Style::Dashed, |pair| pair.0),
                series(&found, 0, Style::Line, |pair| pair.1),
            ],
            ..Plane::new(
                format!("{}, recording {number}", network.card.network.name),
                ["time (ms)", "force (N)"],
            )
        })
    };
    let row = |network: &NetworkReport<ForceFigures>| -> Vec<Panel<'static>> {
        (0..network.result.traces.len().min(DRAWN)).map(|number| panel(network, number)).collect()
    };
    let rows: Vec<Vec<Panel<'_>>> = report.networks.iter().map(row).collect();
    page("Force over time", &about, &rows)
}
