//! `meissner bench`: latencies, work, memory and missed deadlines.

mod frame_table;
mod sweep;
mod table;

use std::path::PathBuf;

use meissner_models::AnyDescription;
use meissner_plot::{Distribution, LatencyCurve, Panel, page};
use meissner_run::RunError;
use meissner_run::bench::{self, BenchInput, BenchOptions, EventBench, EventFrameModel, EventReport};
use meissner_run::latency::Latency;
use meissner_run::model::{WeightsFile, describe_any};
use meissner_run::provenance::ModelCard;
use meissner_run::text::{TIME_FORMS, grouped, span_us};

use crate::args::{
    Every, Input, JsonArgs, MEASUREMENT, NETWORK, OUTPUT, PREDICTIONS, REMEMBERS, Threads, of_one_engine,
};
use crate::error::CliError;
use crate::given::Given;
use crate::output;
use crate::progress::Progress;
use crate::text::file_name;
use crate::view;

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
    "--view",
    "--neighbours",
];

/// Runs the benchmark that `args` describe, and writes the report to standard output.
pub(crate) fn bench(args: &BenchArgs, given: &Given) -> Result<(), CliError> {
    if let Some(quantities) = &args.sweep {
        return sweep::run(args, quantities, given);
    }
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
    let input = input(args, &model.card)?;
    let mut page =
        args.view.map(|port| view::bystander(port, &input, args.input.network(), &model)).transpose()?;
    let bench = EventBench::new(&model, input, args.options());
    let progress = Progress::new(Some(bench.total()), args.format.json);
    let report = bench.run(&mut |taken, engine| {
        progress.set(taken);
        if let (Some(page), Some(engine)) = (&mut page, engine.engine()) {
            page.look(engine);
        }
    })?;
    progress.finish();
    if let Some(path) = &args.svg {
        output::write(path, svg(&report))?;
    }
    output::print(args.format.json, &report, |out| table::write(out, &report))
}

/// Measures a frame network over events.
fn bench_frames(args: &BenchArgs, given: &Given) -> Result<(), CliError> {
    if let Some(option) = given.first(FOR_EVENTS).or(given.first(REMEMBERS)) {
        let found = format!("the frame network {}", args.input.network());
        return Err(CliError::usage(option, "a network over events with it", &found));
    }
    let weights = &args.input.weights;
    let model = EventFrameModel::named(args.input.network(), weights.file(), weights.ignore_preparation)?;
    let report = bench::bench_frames(&model, &input(args, &model.model.card)?, &args.options())?;
    output::print(args.format.json, &report, |out| frame_table::write(out, &report))
}

/// Compares the network over events with the frame network called `name`.
fn compare(args: &BenchArgs, name: &str) -> Result<(), CliError> {
    let model = args.input.model()?;
    let weights = args.compare_weights.as_deref().map(|path| WeightsFile { path, map: &args.compare_map });
    let against = EventFrameModel::named(name, weights, args.input.weights.ignore_preparation);
    let against = against.map_err(with_its_option)?;
    let report = bench::compare(&model, &against, &input(args, &model.card)?, &args.options())?;
    output::print(args.format.json, &report, |out| frame_table::write_comparison(out, &report))
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

/// The method of measurement, at the end of the long help.
const METHOD: &str = "\
How it measures:
  All events are read first. Then they are pushed one at a time, as fast as possible. Every push and every prediction is timed individually. The overhead of the clock is measured and reported, but not subtracted. Every pass begins with a new engine:

  warm-up   the first events (--warmup), not counted
  latency   --repeat passes over all events, for the histograms; rows and skips
            are counted in one pass
  slices    --repeat passes that push the events of each slice together, with a
            prediction after it
  stages    one pass with a clock around each stage
  deadline  one pass that pushes the events of each period together

  'push + predict' is the cost of an event: its push, and the predictions that became due with it.
  Phases: an event belongs to a burst if the events in the 10 ms of stream time before it came at the burst rate or faster; otherwise it belongs to idle.
  Deadline: stream time is divided into periods. The work of a period is the pushes of its events and one prediction for the window at its end. The deadline is missed if the work takes longer than the period. Periods without events and without a window take no work, and count as met. The number of events of a period is the number that enter or the number that leave, whichever is larger: in the silence after a burst, the leaving events cost time. The sustained rate is the highest number of events per period up to which the p99.9 of the work is below the period. Periods with similar numbers are grouped into bins, and each bin is judged together with as many lower bins as are needed for 1,000 periods.
  Memory: the size of a new engine, and the peak resident memory of the process (Linux only).
  Multiply-adds of a row are the same as in `meissner inspect`, at full neighbourhoods: an upper bound at the event level, an assumption above it.

Frame networks (with frames made of events):
  Frames are formed one at a time, from the first accepted event on, with a prediction for each. Over a sliding window, a frame is formed as often as --every says; over consecutive windows, at the end of each window. Silence also has frames. Every push and every prediction is timed individually, in --repeat passes that skip unchanged values and in the same number of passes that compute everything. The periods of the deadline report are the times from frame to frame. The work of a period is the time for its events, its frame and the prediction, with skipping. Pixels are computed in blocks, so some pixels that are counted as skipped or absorbed are still computed.

Comparison (--compare):
  The network over events runs first, then the frame network without skipping, then the frame network with skipping. All run on one thread over the same events, and predict at the times of the frames. Compute is all work between an event and a prediction: entering the event into a window or a frame, making the frame, and the layers. The fastest of --repeat passes counts. The ratio is the ratio of compute. The predictions of the two frame passes are compared bit for bit, and the differences are counted. All three leave out events that the sensor or --late drops.";

/// `meissner bench`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD, mut_arg("threads", of_one_engine))]
pub(crate) struct BenchArgs {
    /// Events and network.
    #[command(flatten)]
    pub(crate) input: Input,
    /// When to predict while latencies are measured [default: event].
    ///
    /// event: after every accepted event. N: after every N accepted events. TIME: every TIME of
    /// stream time, as `run` does. For a frame network, and with --compare, TIME is the time from
    /// frame to frame. The default is then the length of the network's windows, or 10ms for a
    /// sliding window.
    #[arg(long, value_name = "event|N|TIME", value_parser = every, help_heading = PREDICTIONS)]
    pub(crate) every: Option<Every>,
    /// Compare with this frame network over the same events.
    ///
    /// NETWORK is the name of a shipped network, or a description file, which needs
    /// --compare-weights. If its frames are larger than the sensor, the rest is zeros. If they are
    /// smaller, only the network over events gets the events outside them. The report says which.
    #[arg(
        long,
        value_name = "NETWORK",
        help_heading = NETWORK,
        conflicts_with_all = ["svg", "threads", "period_us", "burst_rate", "tolerance", "activity_filter_us", "refractory_us",
            "rate_limit", "stride", "stale_events", "stale_us"]
    )]
    pub(crate) compare: Option<String>,
    /// Weights of the network to compare with [default: those shipped with it].
    #[arg(long, value_name = "FILE", requires = "compare", help_heading = NETWORK)]
    pub(crate) compare_weights: Option<PathBuf>,
    /// Names in --compare-weights that stand for others, as --map has them.
    #[arg(long, value_name = "OLD=NEW|FILE", requires = "compare_weights", help_heading = NETWORK)]
    pub(crate) compare_map: Vec<String>,
    /// Measure how the cost of an event grows with QUANTITY [default: all].
    ///
    /// Instead of a recording, events are drawn: uniform over the sensor (--sensor, 346x260 by
    /// default), evenly spaced in time. Where they are not varied, 10,000 are in the window.
    /// Weights are drawn too, and filters are left out. Only --network, --sensor, --limit and
    /// --json fit: --limit is the number of events that are timed for each value, with a prediction
    /// after each (2,000 by default).
    #[arg(long, value_name = "QUANTITY,...", value_enum, num_args = 0.., require_equals = true, value_delimiter = ',',
          help_heading = MEASUREMENT)]
    sweep: Option<Vec<sweep::QuantityArg>>,
    /// Period of the deadline report, in stream time [default: 1ms].
    ///
    /// Not for frame networks: their periods are the times from frame to frame.
    #[arg(long = "period", value_name = "TIME", value_parser = span_us, help_heading = MEASUREMENT)]
    pub(crate) period_us: Option<i64>,
    /// Minimum rate of a burst, in events per second [default: 5 times the mean].
    #[arg(long, value_name = "RATE", value_parser = clap::value_parser!(u64).range(1..), help_heading = MEASUREMENT)]
    pub(crate) burst_rate: Option<u64>,
    /// Events of a slice, in the passes that push slices [default: 64].
    #[arg(long, value_name = "EVENTS", value_parser = slice, help_heading = MEASUREMENT)]
    pub(crate) slice: Option<usize>,
    #[command(flatten)]
    pub(crate) threads: Threads,
    /// Number of latency passes over all events.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..),
          help_heading = MEASUREMENT)]
    pub(crate) repeat: u32,
    /// Largest number of events in the warm-up pass.
    ///
    /// With frame networks the warm-up ends after 20 frames.
    #[arg(long, value_name = "N", default_value_t = 5000, help_heading = MEASUREMENT)]
    pub(crate) warmup: u64,
    /// Show the engine at work on a page of this port.
    ///
    /// It is the page of `meissner view`, on 127.0.0.1; without PORT, on any free one. Its address
    /// goes to standard error. It takes what the engine holds between two events, 20 times a second
    /// at most, and only while a page is open.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", conflicts_with = "compare",
          help_heading = OUTPUT)]
    pub(crate) view: Option<u16>,
    /// Draw the latency distribution into this file.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) svg: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) format: JsonArgs,
}

impl BenchArgs {
    /// The options of the benchmark.
    fn options(&self) -> BenchOptions {
        BenchOptions {
            part: self.input.part.part(),
            limit: self.input.limit,
            late: self.input.late,
            restart: self.input.restart,
            every: self.every,
            approximations: self.input.approximations.values(),
            two_threads: self.threads.are_two(),
            repeat: self.repeat,
            warmup: self.warmup,
            burst_rate: self.burst_rate,
            period_us: self.period_us,
            slice: self.slice.unwrap_or(0),
            record_rows: self.view.is_some(),
        }
    }
}

/// Reads the number of events of a slice.
fn slice(text: &str) -> Result<usize, String> {
    text.parse()
        .ok()
        .filter(|&events| events > 0)
        .ok_or_else(|| "expected a number of events from 1 on".to_owned())
}

/// Reads when to predict. `end` is refused: a single prediction has no distribution.
fn every(text: &str) -> Result<Every, String> {
    match text.parse() {
        Ok(every @ (Every::Events(_) | Every::StreamUs(_))) => Ok(every),
        Ok(Every::End) | Err(_) => {
            Err(format!("expected `event`, a number of events such as 100, or {TIME_FORMS}"))
        }
    }
}

/// The plot as SVG text.
fn svg(report: &EventReport) -> String {
    let (all, phases) = (&report.latency_us, &report.phases);
    let [idle, burst] = [&phases.idle, &phases.burst].map(|phase| &phase.latency_us.push_predict);
    let mut curves =
        vec![("push", &all.push), ("predict", &all.predict), ("push + predict", &all.push_predict)];
    // If all events are in one phase, its curve is that of all events.
    if idle.count() > 0 && burst.count() > 0 {
        curves.extend([("push + predict, idle", idle), ("push + predict, burst", burst)]);
    }
    let curve = |(i, (name, latency)): (usize, (&str, &Latency))| LatencyCurve {
        name: name.to_owned(),
        dashed: i >= 3,
        points: latency.longer(),
    };
    let curves = curves.into_iter().enumerate().map(curve).filter(|curve| !curve.points.is_empty()).collect();
    let input = &report.input;
    let passes = if input.passes > 1 { format!(" x {} passes", input.passes) } else { String::new() };
    let about = format!(
        "{}: {} events{passes}\n{} predictions, {} kernels",
        file_name(&input.header.input.name),
        grouped(input.events),
        grouped(report.predictions),
        input.isa
    );
    page(
        &format!("Latency of {}", input.card.network.name),
        &about,
        &[vec![Panel::Distribution(Distribution { curves })]],
    )
}
