//! `meissner run`: runs a network over an input, and writes predictions and measurements to
//! standard output. Without arguments it shows the embedded press.

mod args;
mod press;

use meissner_engine::Sensor;
use meissner_models::systems::slip::DecisionFilter;
use meissner_run::interrupt;
use meissner_run::mcap::{self, McapLog};
use meissner_run::model::{FrameModel, describe, describe_any};
use meissner_run::predictor::Mode;
use meissner_run::provenance::{InputCard, ModelCard};
use meissner_run::run::{
    ElectrodeOptions, ElectrodeRun, Ended, EventRun, FrameRun, Observer, PictureOptions, PictureRun,
};
use meissner_run::source::Source;
use meissner_run::streams;
use meissner_run::text::grouped;
use meissner_view::Chosen;

use crate::error::CliError;
use crate::given::Given;
use crate::input::advice;
use crate::kind::NetworkKind;
use crate::page;
use crate::predictions::{About, Report, TableKind};
#[cfg(test)]
pub(crate) use args::OPTIONS_OF_KINDS;
pub(crate) use args::{RunArgs, Video, video};

/// Duration for which events of networks over frames are shown.
const SHOWN_US: i64 = 100_000;

/// Runs the network as `args` say, and writes the results to standard output.
pub(crate) fn run(args: &RunArgs, given: &Given) -> Result<(), CliError> {
    if given.is_within(&["--svg"]) {
        return press::run(args.svg.as_deref());
    }
    if args.svg.is_some() {
        return Err(CliError::usage(
            "--svg",
            "no INPUT and no other option: it draws the press that the program holds",
            "others",
        ));
    }
    let _shared = args.threads.shared()?;
    let (description, _) = describe_any(args.input.network())?;
    let kind = NetworkKind::of(&description);
    args.check(given, kind)?;
    if kind == NetworkKind::EventGraph {
        return run_events(args, given);
    }
    let input = &args.input;
    let (weights, convolution) = (&input.weights, args.frames.convolution());
    let file = weights.file();
    let model = FrameModel::named(input.network(), file, convolution, weights.ignore_preparation)?;
    let model = match args.electrodes.sampling {
        Some(sampling) => model.with_sampling(sampling),
        None => model,
    };
    match kind {
        NetworkKind::Electrodes => run_electrodes(args, given, &model),
        NetworkKind::Pictures => run_pictures(args, &model),
        _ => run_frames(args, &model),
    }
}

/// Runs a network over events.
fn run_events(args: &RunArgs, given: &Given) -> Result<(), CliError> {
    args.check_state(given)?;
    let model = args.input.model()?;
    RunArgs::check_stride(given, &model.card)?;
    let (source, sensor, input) = open(args, &model.card)?;
    let log = args.begin_log(&model.card, sensor)?;
    let run = EventRun::new(&model, source, sensor, args.options()?).map_err(|error| args.refused(error))?;
    let mode = match args.mode {
        Mode::Incremental if args.threads.are_two() => "incremental, two threads",
        Mode::Incremental => "incremental",
        Mode::Batch => "batch: every row at every prediction",
    };
    let stream = (run.source().is_live(), run.total());
    let about = args.about(TableKind::Events, input, (&model.card, mode.to_owned()), stream);
    let chosen = Chosen::new(model.network.clone(), &describe(args.input.network())?.0);
    let page = args.page(run.source(), sensor, model.network.parts().span_us, &chosen)?;
    report(about, log, |report| page::observe(page, report, |report| run.run(report)))
}

/// Runs a network over frames of events.
fn run_frames(args: &RunArgs, model: &FrameModel) -> Result<(), CliError> {
    let (source, sensor, input) = open(args, &model.card)?;
    let options = args.frame_options(true);
    let log = args.begin_log(&model.card, sensor)?;
    let run = FrameRun::new(model, options, source, sensor, args.options()?);
    let run = run.map_err(|error| args.refused(error))?;
    let stream = (run.source().is_live(), run.total());
    let about = args.about_frames(TableKind::Frames, input, (model, options), stream);
    let chosen = Chosen::framed(model.network.clone(), &model.description, model.source);
    let page = args.page(run.source(), sensor, SHOWN_US, &chosen)?;
    report(about, log, |report| page::observe(page, report, |report| run.run(report)))
}

/// Runs a network over electrodes.
fn run_electrodes(args: &RunArgs, given: &Given, model: &FrameModel) -> Result<(), CliError> {
    let path = args.recording("CSV with a column for each of 24 electrodes, in a file or as -")?;
    let asked = &args.electrodes;
    let decides = given.first(&["--hold", "--least-probability"]);
    if let Some(option) = decides.filter(|_| model.card.classes.is_none()) {
        let expected = format!("network {} to predict classes, in logit", args.input.network());
        let found = model.description.labelled_outputs();
        return Err(CliError::usage(option, &expected, &found));
    }
    let decisions = DecisionFilter::new(asked.hold.unwrap_or(1), asked.least_probability.unwrap_or(0.0))?;
    let frame_options = args.frame_options(false);
    let (strict, limit) = (args.input.read.strict, args.input.limit);
    let options = ElectrodeOptions { strict, limit, decisions, advice };
    let run = ElectrodeRun::open(model, frame_options, path, options)?;
    let input = InputCard::other(run.name(), "CSV of 24 electrodes, 100 readings a second");
    let stream = (run.is_live(), None);
    let about = args.about_frames(TableKind::Electrodes, input, (model, frame_options), stream);
    report(about, None, |report| run.run(report))
}

/// Runs a network over pictures.
fn run_pictures(args: &RunArgs, model: &FrameModel) -> Result<(), CliError> {
    let video = args.video();
    let expected = "a picture, a folder of pictures, a list of them, or a raw video (--video)";
    let path = args.recording(expected)?;
    if video.is_none() && streams::is_live(path) {
        return Err(args.no_input(expected, &streams::name(path)));
    }
    let frame_options = args.frame_options(false);
    let options = PictureOptions {
        limit: args.input.limit,
        video,
        reference: args.frames.reference.clone(),
        overlay: args.frames.overlay.clone(),
        full_scale_n: args.frames.full_scale,
    };
    let run = PictureRun::open(model, frame_options, path, &options)?;
    let pictures = run.count().map(|count| format!("{} pictures", grouped(count)));
    let pictures = pictures.or(video.map(|video| video.to_string())).unwrap_or_default();
    let input = InputCard::other(&streams::name(path), &pictures);
    let table = TableKind::Pictures(options.reference.is_some());
    // Each picture is shown as soon as it is measured, even if there are thousands.
    let about = args.about_frames(table, input, (model, frame_options), (true, None));
    report(about, None, |report| run.run(report))
}

/// Opens the events of the input.
fn open(args: &RunArgs, card: &ModelCard) -> Result<(Source, Sensor, InputCard), CliError> {
    let source = args.input.source(card)?;
    interrupt::listen();
    let sensor = source.sensor(args.input.read.sensor)?;
    let input = InputCard::events(&source.name, &source.format, sensor, source.recorded());
    Ok((source, sensor, input))
}

/// Runs, and writes the predictions and the summary, the former to `log` too.
fn report(
    about: About<'_>,
    log: Option<McapLog>,
    run: impl FnOnce(&mut dyn Observer) -> Ended,
) -> Result<(), CliError> {
    let mut report = Report::begin(about)?;
    let (ended, logged) = mcap::observe(log, &mut report, run);
    report.end(ended)?;
    Ok(logged?)
}
