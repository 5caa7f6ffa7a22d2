//! `meissner bench`: what can be asked for.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use crate::args::{Every, Input, STATUS, span_us};

use super::part::{length_us, start_us};

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
  assumption above it.

Frame networks (whose frames are made of events):
  One frame at a time, from the first accepted event on, with a prediction for each: as often as --every says where the
  frame shows the last microseconds, else at the end of each of its windows. Silence has frames too. Every push and
  prediction is timed singly, in --repeat passes with nothing computed that no change reaches (skipping), and as many
  with everything computed. The deadline's periods are the times from frame to frame; a period's work is that of its
  events, its frame and the prediction, with skipping, and its number of events that of those that enter. Pixels are
  computed in blocks, so that some that are counted as skipped or absorbed are computed nevertheless.

Comparison (--compare):
  The network over events, then the frame network with everything computed, then with skipping: one thread, the same
  events, predictions at the same moments, which are those of the frames. Compute is all that is between an event and a
  prediction: events entering a window or a frame, the frame, the layers. Of --repeat passes the fastest counts. The
  ratio is that of compute; the differences between the predictions of both frame passes are counted in bits. Dropped
  events are left out before, for all three.";

/// `meissner bench`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
pub(crate) struct BenchArgs {
    /// Events and network.
    #[command(flatten)]
    pub(crate) input: Input,
    /// When a prediction is read while latencies are measured: after every accepted event (without this option), after
    /// every N accepted events, or every N microseconds of stream time (as `run` does).
    ///
    /// For a frame network, and with --compare: every N microseconds, which is how often there is a frame. Without this
    /// option 10000us, or the length of the windows that the network's frames show.
    #[arg(long, value_name = "event|N|Nus", value_parser = every)]
    pub(crate) every: Option<Every>,
    /// Compare with this frame network over the same events: name of a shipped one, or a description file (which needs
    /// --compare-weights).
    ///
    /// Its frames are those that its description says. Where they show more than the sensor has, the rest is zeros; where
    /// they show less, other events reach the network over events alone. The report says which.
    #[arg(
        long,
        value_name = "NAME|FILE.toml",
        conflicts_with_all = ["svg", "period_us", "burst_rate", "tolerance", "activity_filter", "refractory",
            "rate_limit", "stride", "stale_events", "stale_us"]
    )]
    pub(crate) compare: Option<String>,
    /// Weights of the frame network to compare with. Without it those shipped for it.
    #[arg(long, value_name = "FILE", requires = "compare")]
    pub(crate) compare_weights: Option<PathBuf>,
    /// Leave out the events of the first SECONDS of the recording.
    #[arg(long, value_name = "SECONDS", value_parser = start_us)]
    pub(crate) from_s: Option<i64>,
    /// Take the events of so many SECONDS.
    #[arg(long, value_name = "SECONDS", value_parser = length_us)]
    pub(crate) for_s: Option<i64>,
    /// Length of a period of the deadline report, in microseconds of stream time; without it 1000. Not for frame
    /// networks, whose periods are their frames.
    #[arg(long, value_name = "N", value_parser = span_us())]
    pub(crate) period_us: Option<i64>,
    /// Rate in events per second from which on events belong to a burst; without it 5 times the mean rate of the
    /// events taken.
    #[arg(long, value_name = "EVENTS_PER_S", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) burst_rate: Option<u64>,
    /// Passes over all events of which the latencies are counted.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) repeat: u32,
    /// Most events of the warm-up pass; with frame networks it ends after 20 frames.
    #[arg(long, value_name = "N", default_value_t = 5000)]
    pub(crate) warmup: u64,
    /// Write the distribution of the latencies to this file, as a drawing.
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// One JSON object.
    ///
    /// Times are in microseconds where a name ends in _us. A distribution is {"count", "mean", "p50", "p90", "p99",
    /// "p999", "max"} in microseconds, null where nothing was measured. The object has "header" (what ran on what, docs/json.md),
    /// "events", "accepted", "dropped" and "predictions" of one pass, "passes", "clock_us" (overhead), "latency_us"
    /// {"push", "predict", "push_predict"}, "phases" {"idle", "burst": the same, with events and rows}, "skips" (as
    /// `run`), "approximations" (as `run`), "work" (rows and multiply-adds by layer), "stages" (shares add up to 1), "memory" and "deadline".
    ///
    /// Of a frame network: "frames", and for "skipping" and "everything" the latencies of a frame, the "layers" with
    /// pixels "computed", "skipped" and "absorbed", "multiply_adds" and "state_bytes". With --compare: "ways", which are
    /// "events", "frames_everything" and "frames_skipping", each with "compute_s" and its parts, "compute_s_per_s" of
    /// stream and "multiply_adds"; "ratio_percent" of the first to the others; "predictions_that_differ" between the
    /// others.
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
