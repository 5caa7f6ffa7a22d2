//! `meissner bench`: its arguments.

use std::path::PathBuf;

use crate::args::{Every, INPUT, Input, MEASUREMENT, NETWORK, OUTPUT, PREDICTIONS, STATUS};
use meissner_pipeline::bench::{BenchOptions, Part};
use meissner_pipeline::text::{TIME_FORMS, length_us, span_us};

/// The method of measurement, at the end of the long help.
const METHOD: &str = "\
How it measures:
  Events are read beforehand. Then they are pushed one at a time, as fast as possible, and every push and prediction is timed by itself. The clock's overhead is measured and stated, and not subtracted. Every pass begins with a new engine:

  warm-up   the first events (--warmup), not counted
  latency   --repeat passes over all events: the histograms; rows and skips are
            those of one pass
  stages    one pass with a clock around each stage
  deadline  one pass that hands over the events of a period together

  'push + predict' is the cost of an event: its push, and the predictions that were due because of it.
  Phases: an event belongs to a burst where the events in the 10 ms of stream time before it came at least at the burst rate; otherwise it belongs to idle.
  Deadline: stream time is cut in periods. The work of a period is the pushes of its events and one prediction for the window at its end. The period is missed where this took longer than the period. Periods with neither events nor a window take no work, and count as met. A period's number of events is that of those that enter or of those that leave, whichever is larger: in the silence after a burst, the leaving ones cost time. The sustained rate is the highest number up to which the p99.9 of the work is below the period: in bins of similar numbers, each judged with as many bins below it as it takes for 1,000 periods.
  Memory: what the engine takes when it is made, and the most that the process had resident (Linux only).
  Multiply-adds of a row are those of `meissner inspect`, at full neighbourhoods: an upper bound at the event level, an assumption above it.

Frame networks (whose frames are made of events):
  One frame at a time is formed, from the first accepted event on, with a prediction for each: as often as --every says where the frame shows the last microseconds, otherwise at the end of each of its windows. Silence has frames too. Every push and prediction is timed by itself, in --repeat passes that skip what no change reaches, and in as many that compute everything. The deadline's periods are the times from frame to frame. The work of a period is that of its events, its frame and the prediction, with skipping. Pixels are computed in blocks, so that some that are counted as skipped or absorbed are computed nevertheless.

Comparison (--compare):
  The network over events runs first, then the frame network with everything computed, then with skipping: on one thread, over the same events, with predictions at the same moments, which are those of the frames. Compute is everything between an event and a prediction: the event entering a window or a frame, the frame, the layers. Of --repeat passes the fastest counts. The ratio is that of compute. The differences between the predictions of the two frame passes are counted in bits. Events that the sensor or --late drops are left out of all three.";

/// What `--json` prints.
const JSON: &str = "\
JSON (--json): one object.
  Times are in microseconds where a name ends in _us. A distribution is {\"count\", \"mean\", \"p50\", \"p90\", \"p99\", \"p999\", \"max\"} in microseconds, null where nothing was measured. The object has \"header\" (what ran on what, docs/json.md), \"events\", \"accepted\", \"dropped\" and \"predictions\" of one pass, \"passes\", \"clock_us\" (overhead), \"latency_us\" {\"push\", \"predict\", \"push_predict\"}, \"phases\" {\"idle\", \"burst\": the same, with events and rows}, \"skips\" (as `run`), \"approximations\" (as `run`), \"work\" (rows and multiply-adds by layer), \"stages\" (shares add up to 1), \"memory\" and \"deadline\".
  Of a frame network: \"frames\", and for \"skipping\" and \"everything\" the latencies of a frame, the \"layers\" with pixels \"computed\", \"skipped\" and \"absorbed\", \"multiply_adds\" and \"state_bytes\". With --compare: \"ways\", which are \"events\", \"frames_everything\" and \"frames_skipping\", each with \"compute_s\" and its parts, \"compute_s_per_s\" of stream and \"multiply_adds\"; \"ratio_percent\" of the first to the others; \"predictions_that_differ\" between the others.";

/// `meissner bench`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{JSON}\n\n{STATUS}"))]
pub(crate) struct BenchArgs {
    /// Events and network.
    #[command(flatten)]
    pub(crate) input: Input,
    /// Leave out the events of the first TIME of the recording.
    #[arg(long = "from", value_name = "TIME", value_parser = length_us, help_heading = INPUT)]
    pub(crate) from_us: Option<i64>,
    /// Take the events of TIME, and leave out those after it.
    #[arg(long = "for", value_name = "TIME", value_parser = span_us, help_heading = INPUT)]
    pub(crate) for_us: Option<i64>,
    /// When to predict while latencies are measured [default: event].
    ///
    /// event: after every accepted event. N: after every N accepted events. TIME: every TIME of stream time, as `run`
    /// does. For a frame network, and with --compare, TIME is the time from frame to frame: without this option 10ms, or
    /// the length of the windows that the network's frames show.
    #[arg(long, value_name = "event|N|TIME", value_parser = every, help_heading = PREDICTIONS)]
    pub(crate) every: Option<Every>,
    /// Compare with this frame network over the same events.
    ///
    /// It is the name of a shipped network, or a description file, which needs --compare-weights. Where its frames show
    /// more than the sensor has, the rest is zeros; where they show less, only the network over events gets the other
    /// events. The report says which.
    #[arg(
        long,
        value_name = "NETWORK",
        help_heading = NETWORK,
        conflicts_with_all = ["svg", "period_us", "burst_rate", "tolerance", "activity_filter_us", "refractory_us",
            "rate_limit", "stride", "stale_events", "stale_us"]
    )]
    pub(crate) compare: Option<String>,
    /// Weights of the network to compare with [default: those shipped with it].
    #[arg(long, value_name = "FILE", requires = "compare", help_heading = NETWORK)]
    pub(crate) compare_weights: Option<PathBuf>,
    /// Period of the deadline report, in stream time [default: 1ms].
    ///
    /// Not for frame networks, whose periods are their frames.
    #[arg(long = "period", value_name = "TIME", value_parser = span_us, help_heading = MEASUREMENT)]
    pub(crate) period_us: Option<i64>,
    /// Least rate of a burst, in events per second [default: 5 times the mean].
    #[arg(long, value_name = "RATE", value_parser = clap::value_parser!(u64).range(1..), help_heading = MEASUREMENT)]
    pub(crate) burst_rate: Option<u64>,
    /// Passes over all events from which latencies are counted.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..),
          help_heading = MEASUREMENT)]
    pub(crate) repeat: u32,
    /// Most events of the warm-up pass.
    ///
    /// With frame networks the warm-up ends after 20 frames.
    #[arg(long, value_name = "N", default_value_t = 5000, help_heading = MEASUREMENT)]
    pub(crate) warmup: u64,
    /// Draw the distribution of the latencies into this file.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) svg: Option<PathBuf>,
    /// Print one JSON object.
    ///
    /// The keys are explained below.
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) json: bool,
}

impl BenchArgs {
    /// The options of the benchmark.
    pub(super) fn options(&self) -> BenchOptions {
        BenchOptions {
            part: Part { from_us: self.from_us, for_us: self.for_us },
            limit: self.input.limit,
            late: self.input.late.into(),
            every: self.every,
            approximations: self.input.approximations.values(),
            repeat: self.repeat,
            warmup: self.warmup,
            burst_rate: self.burst_rate,
            period_us: self.period_us,
        }
    }
}

/// A single prediction at the end has no distribution.
fn every(text: &str) -> Result<Every, String> {
    match text.parse() {
        Ok(every @ (Every::Events(_) | Every::StreamUs(_))) => Ok(every),
        Ok(Every::End) | Err(_) => {
            Err(format!("expected `event`, a number of events such as 100, or {TIME_FORMS}"))
        }
    }
}
