//! `meissner soak`: what can be asked for.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use meissner_engine::Sensor;

use crate::args::{ReadArgs, STATUS, sensor};

/// How it measures, at the end of the long help.
const METHOD: &str = "\
What is done:
  Recordings follow one another round and round; each begins where the one before ended, after a random silence of 1 us to
  some 9 minutes, so that time goes on for ever. Events are pushed one at a time, as fast as they can be.
  Disturbances come between events, at random distances, from a shuffled deck: silences; silences in which time is moved
  on without an event; the state as bytes and a new engine that goes on from them; a snapshot in memory, events that the
  engine sees and is to forget, and the return to the snapshot; a reset. A prediction after the return of a state has
  the bits of the one before.
  Checkpoints: the prediction against the full recomputation over the accepted events since the last reset (of networks
  with frozen in-edges the last (blocks + 1) x capacity events, which is all that can reach it), bit for bit.
  Latencies: each push, and each prediction, timed singly. Disturbances and checkpoints are not timed.
  Memory: what the process has resident behind a checkpoint (Linux only).
What is judged:
  Bits: at every checkpoint and every return. Memory: the median over the last tenth of the checkpoints against the most
  in the warm-up, which is the first fifth, and more until the largest batch, up to a half; not judged with fewer than 20 checkpoints. A run that breaks either has exit
  status 1. Latencies are reported as ratios, the last tenth to the first, and not judged: they depend on what else the
  machine does.
All but times and memory depends on recordings, network and seed alone.";

/// `meissner soak`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
pub(crate) struct SoakArgs {
    /// Recordings, one after the other; without any, the small synthetic press and release that the program holds.
    ///
    /// Of several sensors the largest extent is taken.
    #[arg(value_name = "RECORDING")]
    pub(super) recordings: Vec<PathBuf>,
    /// Name of a shipped network over events, or a description file (.toml, which needs --weights).
    #[arg(long, value_name = "NAME|FILE.toml", default_value = crate::model::DEFAULT_NETWORK)]
    pub(super) network: String,
    /// Weights: safetensors, or a PyTorch state dict. Without it those shipped for the network.
    #[arg(long, value_name = "FILE")]
    pub(super) weights: Option<PathBuf>,
    /// Run weights that were trained on another preparation than the network computes.
    #[arg(long)]
    pub(super) ignore_preparation: bool,
    /// Columns x rows of the sensor in pixels, in place of what the recordings say; events outside it are dropped.
    #[arg(long, value_name = "WxH", value_parser = sensor)]
    pub(super) sensor: Option<Sensor>,
    /// How the recordings are read.
    #[command(flatten)]
    pub(super) read: ReadArgs,
    /// Events in all, such as 1e8; those that are dropped count.
    #[arg(long, value_name = "N", value_parser = count)]
    pub(super) events: u64,
    /// Events from one checkpoint to the next.
    #[arg(long, value_name = "N", default_value = "1e6", value_parser = count)]
    pub(super) checkpoint_every: u64,
    /// Events from one disturbance to the next, in the mean.
    #[arg(long, value_name = "N", default_value = "5e4", value_parser = count)]
    pub(super) disturb_every: u64,
    /// Events from one prediction to the next.
    #[arg(long, value_name = "N", default_value = "1", value_parser = count)]
    pub(super) every: u64,
    /// Seed of silences and disturbances.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) seed: u64,
    /// Growth of the resident memory after warm-up that is still flat, in percent.
    #[arg(long, value_name = "PERCENT", default_value_t = 10)]
    pub(super) memory_growth: u32,
    /// Write the results to this file as one JSON object.
    ///
    /// {"header": what ran on what (docs/json.md), "recordings", "rounds" (recordings begun after the first), "isa", "seed", "every", "events", "accepted", "disturbances": {"silences", "advances", "bytes", "snapshots",
    /// "resets", "returns_that_differ"}, "first" and "last" (tenth of the checkpoints): {"latency_us": {"push": {"p50", "p90",
    /// "p99", "p999", "max"}, "predict": the same}, "resident_bytes": median}, "ratio" (last to first): {"push":
    /// {"p50", "p99"}, "predict": the same}, "memory": {"warm_bytes", "end_bytes", "growth_percent"} or null where it is not
    /// judged, "peak_resident_bytes", "seconds", "broken": what is, as texts, "checkpoints": [{"events", "t_us", "nodes", "compared"
    /// (events of the batch), "equal", "bits" (of the prediction, hexadecimal), "latency_us", "resident_bytes",
    /// "seconds"}]}.
    #[arg(long, value_name = "FILE")]
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
