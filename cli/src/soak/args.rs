//! Arguments of `meissner soak`.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use meissner_engine::Sensor;

use crate::args::{INPUT, MEASUREMENT, NETWORK, OUTPUT, PREDICTIONS, ReadArgs, STATUS, sensor};

/// The method, at the end of the long help.
const METHOD: &str = "\
Method:
  Recordings follow one another in a loop. Each begins after the end of the one before it, with a random silence of 1 us to about 9 minutes in between, so time always increases. Events are pushed one at a time, as fast as possible.
  Disturbances come between events, at random intervals and in shuffled order: a silence; a silence in which the clock is advanced without an event; saving the state as bytes, and resuming from them in a new engine; a snapshot in memory, further events, and the return to the snapshot; a reset. When a state is restored, the prediction must have the same bits as before.
  Checkpoints: the prediction is compared with the full recomputation over the accepted events since the last reset (for networks with frozen in-edges over the last (blocks + 1) x capacity events, on which it depends), bit for bit.
  Latencies: each push and each prediction is timed by itself. Disturbances and checkpoints are not timed.
  Memory: after each checkpoint, the bytes that the program has allocated and not freed are read, and (Linux only) its resident memory, in which there is also what the allocator keeps between them.

Verdict:
  Bits: they must be equal at every checkpoint and after every restored state.
  Memory: of the live bytes, the median over the last tenth of the checkpoints is compared with the maximum during warm-up. The warm-up is the first fifth of the checkpoints; it extends to the largest batch, up to half of the checkpoints. With fewer than 20 checkpoints memory is not judged.
  If either check fails, the exit status is 1. Latencies are reported as ratios of the last tenth to the first. They are not judged, since they depend on the load of the machine.
  Everything except times and memory is determined by the recordings, the network and the seed.";

/// The keys that `--json` writes.
const JSON: &str = "\
JSON (--json):
  {\"header\": origin of the results (docs/json.md), \"recordings\", \"rounds\" (recordings begun after the first), \"isa\", \"seed\", \"every\", \"events\", \"accepted\", \"disturbances\": {\"silences\", \"advances\", \"bytes\", \"snapshots\", \"resets\", \"returns_that_differ\"}, \"first\" and \"last\" (tenth of the checkpoints): {\"latency_us\": {\"push\": {\"p50\", \"p90\", \"p99\", \"p999\", \"max\"}, \"predict\": the same}, \"resident_bytes\": median}, \"ratio\" (last to first): {\"push\": {\"p50\", \"p99\"}, \"predict\": the same}, \"memory\" (live): {\"warm_bytes\", \"end_bytes\", \"growth_percent\"} or null if it is not judged, \"peak_resident_bytes\", \"seconds\", \"broken\": broken promises as texts, \"checkpoints\": [{\"events\", \"t_us\", \"nodes\", \"compared\" (events of the batch), \"equal\", \"bits\" (of the prediction, hexadecimal), \"latency_us\", \"live_bytes\", \"resident_bytes\", \"seconds\"}]}.";

/// `meissner soak`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{JSON}\n\n{STATUS}"))]
pub(crate) struct SoakArgs {
    /// Recordings, one after the other [default: a small built-in recording].
    ///
    /// If the recordings have several sensors, the sensor covers all of them. The built-in recording is a simulated
    /// press and release.
    #[arg(value_name = "RECORDING")]
    pub(super) recordings: Vec<PathBuf>,
    /// Size of the sensor in pixels, instead of the recordings'.
    ///
    /// Events outside the sensor are dropped.
    #[arg(long, value_name = "WxH", value_parser = sensor, help_heading = INPUT)]
    pub(super) sensor: Option<Sensor>,
    /// How the recordings are read.
    #[command(flatten)]
    pub(super) read: ReadArgs,
    /// Run weights that were trained on another preparation of the input.
    ///
    /// Without this option, such weights are refused.
    #[arg(long, help_heading = NETWORK)]
    pub(super) ignore_preparation: bool,
    /// Total number of events, such as 1e8.
    ///
    /// Dropped events count.
    #[arg(long, value_name = "N", value_parser = count, help_heading = INPUT)]
    pub(super) events: u64,
    /// Name of a shipped network over events, or a description file (.toml).
    ///
    /// `meissner networks` lists the shipped networks. A description file needs --weights.
    #[arg(long, value_name = "NETWORK", default_value = meissner_models::DEFAULT_NETWORK, help_heading = NETWORK)]
    pub(super) network: String,
    /// Weights [default: those shipped with the network].
    ///
    /// The file is safetensors, or a state dict that PyTorch saved.
    #[arg(long, value_name = "FILE", help_heading = NETWORK)]
    pub(super) weights: Option<PathBuf>,
    /// Number of events between predictions.
    #[arg(long, value_name = "N", default_value = "1", value_parser = count, help_heading = PREDICTIONS)]
    pub(super) every: u64,
    /// Number of events between checkpoints.
    #[arg(long, value_name = "N", default_value = "1e6", value_parser = count, help_heading = MEASUREMENT)]
    pub(super) checkpoint_every: u64,
    /// Mean number of events between disturbances.
    #[arg(long, value_name = "N", default_value = "5e4", value_parser = count, help_heading = MEASUREMENT)]
    pub(super) disturb_every: u64,
    /// Seed for silences and disturbances.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = MEASUREMENT)]
    pub(super) seed: u64,
    /// Largest growth of the live memory after warm-up, in percent.
    #[arg(long, value_name = "PERCENT", default_value_t = 10, help_heading = MEASUREMENT)]
    pub(super) memory_growth: u32,
    /// Write the results to this file as one JSON object.
    ///
    /// The keys are explained below.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) json: Option<PathBuf>,
}

/// Reads a whole number above 0, also in the form 1e8.
fn count(text: &str) -> Result<u64, String> {
    /// Largest number up to which every whole number is exact as a double.
    const MAX: f64 = 9_007_199_254_740_992.0;
    let number = text.parse::<f64>().ok().filter(|n| n.fract() == 0.0 && (1.0..=MAX).contains(n));
    number
        .map(|n| n as u64)
        .ok_or_else(|| "expected a whole number of at least 1, such as 100000 or 1e5".to_owned())
}

#[cfg(test)]
mod tests {
    use super::count;

    #[test]
    fn a_count_is_a_whole_number_above_0_with_or_without_an_exponent() {
        assert_eq!(count("1e8"), Ok(100_000_000));
        assert_eq!(count("2.5e1"), Ok(25));
        assert_eq!(count("17"), Ok(17));
        for wrong in ["", "0", "-1", "1.5", "1e-3", "inf", "NaN", "1e17", "many"] {
            assert!(count(wrong).is_err(), "{wrong}");
        }
    }
}
