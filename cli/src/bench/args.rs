//! `meissner bench`: its arguments.

use std::path::PathBuf;

use crate::args::{Every, Input, JsonArgs, MEASUREMENT, NETWORK, OUTPUT, PREDICTIONS};
use crate::threads::{self, Threads};
use meissner_run::bench::BenchOptions;
use meissner_run::text::{TIME_FORMS, span_us};

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
#[command(after_long_help = METHOD, mut_arg("threads", threads::of_one_engine))]
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
    /// NETWORK is the name of a shipped network, or a description file, which needs --compare-weights. If its frames
    /// are larger than the sensor, the rest is zeros. If they are smaller, only the network over events gets the events
    /// outside them. The report says which case applies.
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
    /// Draw the latency distribution into this file.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) svg: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) format: JsonArgs,
}

impl BenchArgs {
    /// The options of the benchmark.
    pub(super) fn options(&self) -> BenchOptions {
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
