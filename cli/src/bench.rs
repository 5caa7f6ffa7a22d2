//! `meissner bench`: latencies, work, memory and missed deadlines.

mod args;
mod compare_table;
mod frame_table;
mod plot;
mod table;

use meissner_models::AnyDescription;
use meissner_run::RunError;
use meissner_run::bench::{self, BenchInput, EventBench, EventFrameModel};
use meissner_run::model::describe_any;
use meissner_run::provenance::ModelCard;

use crate::args::{NetworkWeights, REMEMBERS};
use crate::error::CliError;
use crate::given::Given;
use crate::output;
use crate::progress::Progress;
pub(crate) use args::BenchArgs;

/// Options that fit only networks over events, like [`REMEMBERS`].
pub(crate) const FOR_EVENTS: &[&str] = &[
    "--tolerance",
    "--span",
    "--capacity",
    "--burst-rate",
    "--period",
    "--slice",
    "--threads",
    "--svg",
    "--compare",
    "--neighbours",
];

/// Runs the benchmark that `args` describe, and writes the report to standard output.
pub(crate) fn bench(args: &BenchArgs, given: &Given) -> Result<(), CliError> {
    let _shared = args.threads.shared()?;
    match (describe_any(args.input.network())?, &args.compare) {
        ((AnyDescription::Frames(_), _), _) => bench_frames(args, given),
        ((AnyDescription::Events(_), _), Some(name)) => compare(args, name),
        ((AnyDescription::Events(_), _), None) => bench_events(args),
    }
}

/// Measures a network over events.
fn bench_events(args: &BenchArgs) -> Result<(), CliError> {
    let model = args.input.model()?;
    if let Some(path) = &args.svg {
        output::check_writable(path)?;
    }
    let bench = EventBench::new(&model, input(args, &model.card)?, args.options());
    let progress = Progress::new(Some(bench.total()), args.format.json);
    let report = bench.run(&mut |taken| progress.set(taken))?;
    progress.finish();
    if let Some(path) = &args.svg {
        output::write(path, plot::svg(&report))?;
    }
    output::print(args.format.json, &report, |out| table::write(out, &report))
}

/// Measures a frame network over events.
fn bench_frames(args: &BenchArgs, given: &Given) -> Result<(), CliError> {
    if let Some(option) = given.first(FOR_EVENTS).or(given.first(REMEMBERS)) {
        let found = format!("the frame network {}", args.input.network());
        return Err(CliError::usage(option, "a network over events with it", &found));
    }
    let NetworkWeights { file, ignore_preparation } = &args.input.weights;
    let model = EventFrameModel::named(args.input.network(), file.as_deref(), *ignore_preparation)?;
    let report = bench::bench_frames(&model, &input(args, &model.model.card)?, &args.options())?;
    output::print(args.format.json, &report, |out| frame_table::write(out, &report))
}

/// Compares the network over events with the frame network called `name`.
fn compare(args: &BenchArgs, name: &str) -> Result<(), CliError> {
    let model = args.input.model()?;
    let weights = args.compare_weights.as_deref();
    let against = EventFrameModel::named(name, weights, args.input.weights.ignore_preparation);
    let against = against.map_err(with_its_option)?;
    let report = bench::compare(&model, &against, &input(args, &model.card)?, &args.options())?;
    output::print(args.format.json, &report, |out| compare_table::write(out, &report))
}

/// The events that `args` select, for a benchmark of the network of `card`.
fn input(args: &BenchArgs, card: &ModelCard) -> Result<BenchInput, CliError> {
    let source = args.input.source(card)?;
    let sensor = source.sensor(args.input.read.sensor)?;
    Ok(BenchInput::take(source, sensor, card, &args.options())?)
}

/// Rewrites `error` to name the option for the weights of the compared frame network.
fn with_its_option(error: RunError) -> CliError {
    match error {
        RunError::NoWeights(network) => {
            let expected = format!("a file of weights: the description file {network} comes without");
            CliError::usage("--compare-weights", &expected, "none")
        }
        error => error.into(),
    }
}
