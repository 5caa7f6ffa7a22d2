//! `meissner bench`: what can be asked for.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use crate::args::{Every, Input, STATUS, span_us};

/// What is measured and how, at the end of the long help.
const METHOD: &str = "\
How it measures:
  Events are read beforehand, then pushed one at a time, as fast as they can be, and every push and prediction is timed
  singly. What a measurement of nothing takes is stated as the clock's overhead, and not subtracted. Every pass begins
  with an engine that has seen no event:
    warm-up   the first events (--warmup), not counted
    latency   --repeat passes over all events: the histograms; rows and skips are those of one pass
    stages    one pass with a clock around each stage, so that these clocks do not disturb the latencies
    deadline  one pass that hands over a period's events together
  'push + predict' is what an event cost: its push, and the predictions that were due because of it.
  Phases: an event belongs to a burst where the events in the 10 ms of stream time before it came at least at the burst
  rate, else to idle.
  Deadline: stream time is cut in periods. A period's work is the pushes of its events, and one prediction for the
  window at its end; it is missed where this took longer than the period. Periods with neither events nor a window
  take no work, and count as met. A period's number of events is that of those that enter or of those that leave,
  whichever is larger: in the silence after a burst it is the leaving ones that cost. The sustained rate is the highest
  number up to which the p99.9 of the work is below the period: in bins of similar numbers, each judged with as many
  bins below it as it takes for 1,000 periods.
  Memory: what the engine takes when it is made, and the most that the process had resident (Linux only).
  Multiply-adds of a row are those of `meissner inspect`, at full neighbourhoods: an upper bound at the event level, an
  assumption above it.";

/// `meissner bench`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
pub(crate) struct BenchArgs {
    /// Events and network.
    #[command(flatten)]
    pub(crate) input: Input,
    /// When a prediction is read while latencies are measured: after every accepted event, after every N accepted
    /// events, or every N microseconds of stream time (as `run` does).
    #[arg(long, value_name = "event|N|Nus", default_value = "event", value_parser = every)]
    pub(crate) every: Every,
    /// Length of a period of the deadline report, in microseconds of stream time.
    #[arg(long, value_name = "N", default_value = "1000", value_parser = span_us())]
    pub(crate) period_us: i64,
    /// Rate in events per second from which on events belong to a burst; without it 5 times the mean rate of the
    /// events taken.
    #[arg(long, value_name = "EVENTS_PER_S", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) burst_rate: Option<u64>,
    /// Passes over all events of which the latencies are counted.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) repeat: u32,
    /// Most events of the warm-up pass.
    #[arg(long, value_name = "N", default_value_t = 5000)]
    pub(crate) warmup: u64,
    /// Write the distribution of the latencies to this file, as a drawing.
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// One JSON object.
    ///
    /// Times are in microseconds where a name ends in _us. A distribution is {"count", "mean", "p50", "p90", "p99",
    /// "p999", "max"} in microseconds, null where nothing was measured. Beside what ran on what, the object has
    /// "events", "accepted", "dropped" and "predictions" of one pass, "passes", "clock_us" (overhead), "latency_us"
    /// {"push", "predict", "push_predict"}, "phases" {"idle", "burst": the same, with events and rows}, "skips" (as
    /// `run`), "work" (rows and multiply-adds by layer), "stages" (shares add up to 1), "memory" and "deadline".
    #[arg(long)]
    pub(crate) json: bool,
}

/// A single prediction at the end has no distribution.
fn every(text: &str) -> Result<Every, String> {
    match text.parse() {
        Ok(every @ (Every::Events(_) | Every::StreamUs(_))) => Ok(every),
        Ok(Every::End) | Err(_) => {
            Err("expected `event`, a number of events above 0 such as 100, or of microseconds such as 1000us"
                .to_owned())
        }
    }
}
