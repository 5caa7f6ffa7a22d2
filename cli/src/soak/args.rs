//! Arguments of `meissner soak`.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use meissner_engine::Sensor;

use crate::args::{INPUT, MEASUREMENT, NETWORK, OUTPUT, PREDICTIONS, ReadArgs, STATUS, sensor};

/// The method, at the end of the long help.
const METHOD: &str = "\
Method:
  Recordings follow one another in a loop. Each begins where the recording before it ended, after a random silence of 1 us to some 9 minutes, so that time always goes on. Events are pushed one at a time, as fast as possible.
  Disturbances come between events, at random distances, from a shuffled deck: silences; silences in which time is moved on without an event; the state as bytes, and a new engine that goes on from them; a snapshot in memory, events that are to be forgotten, and the return to the snapshot; a reset. A prediction after a state returns has the bits of the one before.
  Checkpoints: the prediction against the full recomputation over the accepted events since the last reset (for networks with frozen in-edges over the last (blocks + 1) x capacity events, on which it depends), bit for bit.
  Latencies: each push and each prediction is timed by itself. Disturbances and checkpoints are not timed.
  Memory: resident memory of the process after a checkpoint (Linux only).

Verdict:
  Bits: at every checkpoint and every return of a state.
  Memory: the median over the last tenth of the checkpoints against the most in the warm-up. The warm-up is the first fifth, and more until the largest batch, up to a half. With fewer than 20 checkpoints memory is not judged.
  A run that breaks either has exit status 1. Latencies are reported as ratios of the last tenth to the first, and not judged: they depend on the load of the machine.
  Everything except times and memory is determined by recordings, network and seed.";

/// The keys that `--json` writes.
const JSON: &str = "\
JSON (--json):
  {\"header\": origin of the results (docs/json.md), \"recordings\", \"rounds\" (recordings begun after the first), \"isa\", \"seed\", \"every\", \"events\", \"accepted\", \"disturbances\": {\"silences\", \"advances\", \"bytes\", \"snapshots\", \"resets\", \"returns_that_differ\"}, \"first\" and \"last\" (tenth of the checkpoints): {\"latency_us\": {\"push\": {\"p50\", \"p90\", \"p99\", \"p999\", \"max\"}, \"predict\": the same}, \"resident_bytes\": median}, \"ratio\" (last to first): {\"push\": {\"p50\", \"p99\"}, \"predict\": the same}, \"memory\": {\"warm_bytes\", \"end_bytes\", \"growth_percent\"} or null if it is not judged, \"peak_resident_bytes\", \"seconds\", \"broken\": broken promises as texts, \"checkpoints\": [{\"events\", \"t_us\", \"nodes\", \"compared\" (events of the batch), \"equal\", \"bits\" (of the prediction, hexadecimal), \"latency_us\", \"resident_bytes\", \"seconds\"}]}.";

/// `meissner soak`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{JSON}\n\n{STATUS}"))]
pub(crate) struct SoakArgs {
    /// Recordings, one after the other [default: a small built-in recording].
    ///
    /// Of several sensors the largest extent is taken. The built-in recording is a synthetic press and release.
    #[arg(value_name = "RECORDING")]
    pub(super) recordings: Vec<PathBuf>,
    /// Size of the sensor in pixels, in place of the recordings'.
    ///
    /// Events outside the sensor are dropped.
    #[arg(long, value_name = "WxH", value_parser = sensor, help_heading = INPUT)]
    pub(super) sensor: Option<Sensor>,
    /// How the recordings are read.
    #[command(flatten)]
    pub(super) read: ReadArgs,
    /// Run weights that were trained on another preparation of the input.
    ///
    /// Without it, such weights are refused.
    #[arg(long, help_heading = NETWORK)]
    pub(super) ignore_preparation: bool,
    /// Number of events in all, such as 1e8.
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
    /// Events from one prediction to the next.
    #[arg(long, value_name = "N", default_value = "1", value_parser = count, help_heading = PREDICTIONS)]
    pub(super) every: u64,
    /// Events from one checkpoint to the next.
    #[arg(long, value_name = "N", default_value = "1e6", value_parser = count, help_heading = MEASUREMENT)]
    pub(super) checkpoint_every: u64,
    /// Mean number of events from one disturbance to the next.
    #[arg(long, value_name = "N", default_value = "5e4", value_parser = count, help_heading = MEASUREMENT)]
    pub(super) disturb_every: u64,
    /// Seed of silences and disturbances.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = MEASUREMENT)]
    pub(super) seed: u64,
    /// Largest growth of the resident memory after warm-up, in percent.
    #[arg(long, value_name = "PERCENT", default_value_t = 10, help_heading = MEASUREMENT)]
    pub(super) memory_growth: u32,
    /// Write the results to this file as one JSON object.
    ///
    /// The keys are explained below.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) json: Option<PathBuf>,
}

/// Reads a whole number above 0, also as 1e8.
fn count(text: &str) -> Result<u64, String> {
    /// Up to which every whole number is a double.
    const MOST: f64 = 9_007_199_254_740_992.0;
    let number = text.parse::<f64>().ok().filter(|n| n.fract() == 0.0 && (1.0..=MOST).contains(n));
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
