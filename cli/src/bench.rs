//! `meissner bench`: latencies, work, memory and missed deadlines.

mod args;
mod compare_table;
mod frame_table;
mod plot;
mod table;

use meissner_models::AnyDescription;
use meissner_pipeline::PipelineError;
use meissner_pipeline::bench::{self, BenchInput, EventBench, EventFrameModel};
use meissner_pipeline::model::describe_any;
use meissner_pipeline::provenance::ModelCard;

use crate::args::Input;
use crate::error::CliError;
use crate::output;
use crate::progress::Progress;
use crate::threads;
pub(crate) use args::BenchArgs;

/// Runs the benchmark that `args` describe, and writes the report to standard output.
pub(crate) fn bench(args: &BenchArgs) -> Result<(), CliError> {
    let _shared = threads::shared(args.threads)?;
    match (describe_any(args.input.network())?, &args.compare) {
        ((AnyDescription::Frames(_), _), _) => bench_frames(args),
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
    let progress = Progress::new(Some(bench.total()), args.json);
    let report = bench.run(&mut |taken| progress.set(taken))?;
    progress.finish();
    if let Some(path) = &args.svg {
        output::write(path, plot::svg(&report))?;
    }
    output::print(args.json, &report, |out| table::write(out, &report))
}

/// Measures a frame network over events.
fn bench_frames(args: &BenchArgs) -> Result<(), CliError> {
    check_frames(args)?;
    let Input { weights, ignore_preparation, .. } = &args.input;
    let model = EventFrameModel::named(args.input.network(), weights.as_deref(), *ignore_preparation)?;
    let report = bench::bench_frames(&model, &input(args, &model.model.card)?, &args.options())?;
    output::print(args.json, &report, |out| frame_table::write(out, &report))
}

/// Compares the network over events with the frame network called `name`.
fn compare(args: &BenchArgs, name: &str) -> Result<(), CliError> {
    let model = args.input.model()?;
    let weights = args.compare_weights.as_deref();
    let against = EventFrameModel::named(name, weights, args.input.ignore_preparation);
    let against = against.map_err(with_its_option)?;
    let report = bench::compare(&model, &against, &input(args, &model.card)?, &args.options())?;
    output::print(args.json, &report, |out| compare_table::write(out, &report))
}

/// The events that `args` select, for a benchmark of the network of `card`.
fn input(args: &BenchArgs, card: &ModelCard) -> Result<BenchInput, CliError> {
    let source = args.input.source(card)?;
    let sensor = source.sensor(args.input.sensor)?;
    Ok(BenchInput::take(source, sensor, card, &args.options())?)
}

/// Refuses options that apply only to networks over events.
fn check_frames(args: &BenchArgs) -> Result<(), CliError> {
    let approximations = &args.input.approximations;
    let given = [
        ("--tolerance", approximations.tolerance.is_some()),
        ("--span", args.input.span_us.is_some()),
        ("--capacity", args.input.capacity.is_some()),
        ("--burst-rate", args.burst_rate.is_some()),
        ("--period", args.period_us.is_some()),
        ("--slice", args.slice.is_some()),
        ("--threads", args.threads.is_some()),
        ("--svg", args.svg.is_some()),
        ("--compare", args.compare.is_some()),
    ];
    given.into_iter().chain(approximations.given()).find(|(_, given)| *given).map_or(Ok(()), |(option, _)| {
        let found = format!("the frame network {}", args.input.network());
        Err(CliError::usage(option, "a network over events with it", &found))
    })
}

/// Rewrites `error` to name the option for the weights of the compared frame network.
fn with_its_option(error: PipelineError) -> CliError {
    match error {
        PipelineError::NoWeights(network) => {
            let expected = format!("a file of weights: the description file {network} comes without");
            CliError::usage("--compare-weights", &expected, "none")
        }
        error => error.into(),
    }
}
