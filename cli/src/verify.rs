//! `meissner verify`: compares incremental results with full recomputation, bit for bit.
//! [`meissner_verify`] does the work.
//!
//! | file | contents |
//! |---|---|
//! | `streams` | random streams, recordings, and a stream to replay |
//! | `stress` | `--stress`: streams, weights, states and images that strain the arithmetic |
//! | `soak` | `--soak`: one engine over recordings in a loop, with frequent disturbances |

mod soak;
pub(crate) mod streams;
mod stress;

use std::path::PathBuf;

use clap::Arg;

use crate::args::{INPUT, MEASUREMENT, NetworkWeights, OUTPUT, PREDICTIONS, ReadArgs, Threads};
use crate::error::CliError;
use crate::given::Given;
use crate::output::ReportArgs;
#[cfg(test)]
pub(crate) use streams::FOR_EVENTS;

/// Runs the form that `args` name.
pub(crate) fn verify(args: &VerifyArgs, given: &Given) -> Result<(), CliError> {
    if let Some(option) = given.first(OF_STRESS).filter(|_| !args.stress) {
        return Err(CliError::usage(option, "--stress with it", args.network()));
    }
    match (args.stress, args.soak) {
        (true, _) => stress::stress(args),
        (_, true) => soak::soak(args),
        _ => streams::streams(args, given),
    }
}

/// The method of the three forms, at the end of the long help.
const METHOD: &str = "\
Method:
  Networks over events: the engine takes a stream, and at every comparison the batch recomputes the window from scratch. Neighbourhoods, every row of every layer and the prediction must have the same bits.
  Random streams: they contain hot spots, single pixels, equal times, sparse events, bursts and silences, times and pixels on the borders of cells, full windows, late events, events outside the sensor, clock advances without an event, resets, and states that are restored from memory and from bytes. Many streams reduce the capacity of the window to fill it. Half of the streams are compared after every event.
  Recordings: the engine takes all events of a recording and is compared with the batch after every --every events. The random streams then use the sensor of the first recording.
  Frame networks: the input is random sequences of frames, many of which are equal or zero. An engine that skips unchanged values must predict the same bits as one that computes everything.
  Mismatch: the stream is reduced as long as the results differ: steps are removed, and times and pixels are rounded. The minimal stream is written to --failure, and the exit status is 1. The network, the recordings and the seed determine everything.

--stress takes cases of the program, in groups:
  streams    stamps at the limits of f64 and i64, spans from 10 us to 10 s, one
             pixel, one instant, ties, largest sensors
  weights    weights times 1e-6 and 1e6, denormal weights and activations,
             variances of batch norm near zero
  recurrent  gates that are saturated, open or closed, over a million frames
  winograd   images that cancel, mix magnitudes or nearly overflow: directly, by
             F(2 x 2) and by F(4 x 4)
  functions  the largest error of each elementary function over all 2^32 inputs
  Incremental against batch: as above, for every case.
  Error: the difference from the same network in f64 (crate meissner-reference), over the compared predictions. Relative errors are divided by the largest magnitude. `layer` is the layer with the largest relative error.
  Overflow: activations beyond f32 become infinite. If a layer turns them into NaN, the engine reports an error with the name of the layer.
  Time: the fastest of several passes on one thread. `x ordinary` is the ratio to the ordinary case of the same network; both are measured in turns. Times depend on the machine. Everything else is determined by the seeds in the program (functions also by the platform's f64 library).
  ULP: the distance to the result in f64, in units in the last place of the nearest f32.

--soak runs one engine over recordings in a loop, as fast as possible:
  The engine begins with a random event of a random recording, at a random time, and so it does after each checkpoint, where it forgets everything. Each recording begins after the end of the one before it, with a random silence of 1 us to about 9 minutes in between, so time always increases. If the recordings have several sensors, the sensor covers all of them. Without a recording, it is the built-in one of a simulated press and release.
  Disturbances come between events, at random intervals and in shuffled order: a silence; a silence in which the clock is advanced without an event; saving the state as bytes, and resuming from them in a new engine; a snapshot in memory, further events, and the return to the snapshot; a reset. When a state is restored, the prediction must have the same bits as before.
  Checkpoints: the prediction is compared with the full recomputation over the accepted events since the last reset (for networks with frozen in-edges over the last (blocks + 1) x capacity events, on which it depends), bit for bit.
  Latencies: each push and each prediction is timed by itself. Disturbances and checkpoints are not timed. Latencies are reported as ratios of the last tenth to the first. They are not judged, since they depend on the load of the machine.
  Memory: after each checkpoint, the bytes that the program has allocated and not freed are read, and (Linux only) its resident memory, which also contains what the allocator keeps for later. The median of the live bytes over the last tenth of the checkpoints is compared with the maximum during warm-up. The warm-up is the first fifth of the checkpoints; it extends to the largest batch, up to half of the checkpoints. With fewer than 20 checkpoints memory is not judged.
  State (--state): one line of JSON for each checkpoint: {\"key\": {\"network\": fingerprint, \"recordings\": fingerprint, \"sensor\", the options, \"checkpoint\": its number, \"events\", \"isa\", \"version\"}, \"measurement\": as in --json}. The same command goes on after the checkpoints in the file, also after a kill.
  The exit status is 1 if bits or memory fail. Everything except times and memory is determined by the recordings, the network and the seed.

Examples:
  meissner verify own.toml recording.aedat4
  meissner verify --stress --quick
  meissner verify tactigraph-past recording.aedat4 --soak --events 1e8 --state soak.jsonl";

/// `meissner verify`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD, mut_arg("threads", of_the_sweep), mut_args(of_its_form))]
pub(crate) struct VerifyArgs {
    /// Name of a shipped network, or a description file (.toml).
    ///
    /// `meissner networks` lists the shipped networks.
    #[arg(value_name = "NETWORK", required_unless_present = "stress")]
    network: Option<String>,
    /// Recordings to verify as well, for networks over events.
    #[arg(value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// Run cases of the program that strain the arithmetic.
    #[arg(long, help_heading = MEASUREMENT)]
    stress: bool,
    /// Run one engine for a very long time, and check bits, memory and latencies.
    #[arg(long, requires = "events", help_heading = MEASUREMENT)]
    soak: bool,
    /// How the recordings are read.
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    weights: NetworkWeights,
    /// Number of events between comparisons [default: 64 comparisons].
    ///
    /// With --soak, the number of events between predictions [default: 1].
    #[arg(long, value_name = "N", value_parser = count, help_heading = PREDICTIONS)]
    every: Option<u64>,
    /// Seed for random streams, drawn weights and disturbances.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = MEASUREMENT)]
    seed: u64,
    #[command(flatten)]
    streams: StreamArgs,
    #[command(flatten)]
    cases: StressArgs,
    #[command(flatten)]
    long: SoakArgs,
    #[command(flatten)]
    report: ReportArgs,
}

/// Options of random streams and of a stream to replay.
#[derive(Debug, clap::Args)]
struct StreamArgs {
    /// Run only the minimal stream of an earlier mismatch.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["recordings", "sensor"], help_heading = INPUT)]
    replay: Option<PathBuf>,
    /// Number of random streams.
    #[arg(long, value_name = "N", default_value_t = 100, help_heading = MEASUREMENT)]
    cases: u64,
    /// File for the minimal stream of a mismatch.
    ///
    /// A text of events (t,x,y,p) with the other steps as comments. It is written only at a
    /// mismatch, and replaces an existing file.
    #[arg(long, value_name = "FILE", default_value = "meissner-verify-failure.csv", help_heading = OUTPUT)]
    failure: PathBuf,
}

/// Options of `--stress`.
#[derive(Debug, clap::Args)]
struct StressArgs {
    /// With --stress, run only the groups and cases whose name contains NAME.
    ///
    /// The option may be given several times.
    #[arg(long, value_name = "NAME", help_heading = MEASUREMENT)]
    only: Vec<String>,
    /// With --stress, take fewer events, frames and inputs, and one timing pass.
    ///
    /// For functions, every 4099th of the 2^32 inputs is taken, and the inputs near special values.
    #[arg(long, help_heading = MEASUREMENT)]
    quick: bool,
    #[command(flatten)]
    threads: Threads,
    /// With --stress, list the cases without running them.
    #[arg(long, help_heading = OUTPUT)]
    list: bool,
    /// With --stress, print the tables in Markdown.
    #[arg(long, conflicts_with = "json", help_heading = OUTPUT)]
    markdown: bool,
}

/// Options of `--soak`.
#[derive(Debug, clap::Args)]
struct SoakArgs {
    /// With --soak, the total number of events, such as 1e8.
    ///
    /// Dropped events count.
    #[arg(long, value_name = "N", value_parser = count, requires = "soak", help_heading = INPUT)]
    events: Option<u64>,
    /// With --soak, the number of events between checkpoints.
    #[arg(long, value_name = "N", default_value = "1e6", value_parser = count, requires = "soak", help_heading = MEASUREMENT)]
    checkpoint_every: u64,
    /// With --soak, the mean number of events between disturbances.
    #[arg(long, value_name = "N", default_value = "5e4", value_parser = count, requires = "soak", help_heading = MEASUREMENT)]
    disturb_every: u64,
    /// With --soak, keep finished checkpoints in this file, and do not repeat them.
    #[arg(long, value_name = "FILE.jsonl", requires = "soak", help_heading = MEASUREMENT)]
    state: Option<PathBuf>,
    /// With --soak, the largest growth of the live memory after warm-up, in percent.
    #[arg(long, value_name = "PERCENT", default_value_t = 10, requires = "soak", help_heading = MEASUREMENT)]
    memory_growth: u32,
}

/// `--threads` of `--stress`.
fn of_the_sweep(arg: Arg) -> Arg {
    let help = "With --stress, threads of the sweep over all inputs [default: all cores]";
    arg.help(help).long_help(format!("{help}.\n\nEverything else runs on one thread."))
}

/// Options of `--stress`, which the other forms refuse.
pub(crate) const OF_STRESS: &[&str] = &["--only", "--quick", "--threads", "--list", "--markdown"];

/// An argument that only its own form accepts. `requires` would not work for the arguments of
/// `--stress`: clap does not require an argument that conflicts with a given one, and NETWORK is
/// given.
fn of_its_form(arg: Arg) -> Arg {
    match arg.get_id().as_str() {
        "stress" | "only" | "quick" | "threads" | "list" | "markdown" | "json" | "out" => arg,
        "replay" | "cases" | "failure" => arg.conflicts_with_all(["stress", "soak"]),
        _ => arg.conflicts_with("stress"),
    }
}

impl VerifyArgs {
    /// The network, which only `--stress` does not need.
    fn network(&self) -> &str {
        self.network.as_deref().unwrap_or_default()
    }
}

/// Reads a whole number above 0, also in the form 1e8.
pub(crate) fn count(text: &str) -> Result<u64, String> {
    /// Largest number up to which every whole number is exact as a double.
    const MAX: f64 = 9_007_199_254_740_992.0;
    let number = text.parse::<f64>().ok().filter(|n| n.fract() == 0.0 && (1.0..=MAX).contains(n));
    number
        .map(|n| n as u64)
        .ok_or_else(|| "expected a whole number of at least 1, such as 100000 or 1e5".to_owned())
}
