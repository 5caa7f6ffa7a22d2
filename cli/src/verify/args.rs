//! Arguments of `meissner verify`.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use meissner_engine::Sensor;

use crate::args::{INPUT, MEASUREMENT, NETWORK, OUTPUT, PREDICTIONS, ReadArgs, STATUS, sensor};

/// The method, at the end of the long help.
const METHOD: &str = "\
Method:
  Networks over events: the engine takes a stream, and at every comparison the batch recomputes the window from scratch. Neighbourhoods, every row of every layer and the prediction must have the same bits.
  Random streams: they contain hot spots, single pixels, equal times, sparse events, bursts and silences, times and pixels on the borders of cells, full windows, late events, events outside the sensor, clock advances without an event, resets, and states that are restored from memory and from bytes. Many streams reduce the capacity of the window to fill it. Half of the streams are compared after every event.
  Recordings: the engine takes all events of a recording and is compared with the batch after every --every events. The random streams then use the sensor of the first recording.
  Frame networks: the input is random sequences of frames, many of which are equal or zero. An engine that skips unchanged values must predict the same bits as one that computes everything.
  Mismatch: the stream is reduced as long as the results differ: steps are removed, and times and pixels are rounded. The minimal stream is written to --out, and the exit status is 1. The network, the recordings and the seed determine everything.";

/// The keys that `--json` prints.
const JSON: &str = "\
JSON (--json):
  {\"header\": origin of the results (docs/json.md), \"seed\", \"checks\": [{\"name\": random streams or a recording, \"cases\": streams, \"inputs\": events or frames, \"comparisons\", \"rows\": compared rows of all layers (of frame networks, values of predictions), \"refused\": comparisons at which both sides refused because the same layer computed NaN}], \"mismatch\": null or {\"name\", \"file\" with the minimal stream, \"steps\" of that stream, \"input\": inputs up to the difference, \"layer\" and \"row\" or null, \"difference\": a sentence with both values}}.";

/// `meissner verify`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{JSON}\n\n{STATUS}"))]
pub(crate) struct VerifyArgs {
    /// Name of a shipped network, or a description file (.toml).
    ///
    /// `meissner networks` lists the shipped networks.
    #[arg(value_name = "NETWORK")]
    pub(super) network: String,
    /// Recordings to verify as well, for networks over events.
    #[arg(value_name = "RECORDING")]
    pub(super) recordings: Vec<PathBuf>,
    /// Size of the sensor in pixels [default: the recording's, or several sizes].
    #[arg(long, value_name = "WxH", value_parser = sensor, help_heading = INPUT)]
    pub(super) sensor: Option<Sensor>,
    /// How the recordings are read.
    #[command(flatten)]
    pub(super) read: ReadArgs,
    /// Run only the minimal stream of an earlier mismatch.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["recordings", "sensor"], help_heading = INPUT)]
    pub(super) replay: Option<PathBuf>,
    /// Weights [default: those shipped with the network, or drawn from the seed].
    ///
    /// The file is safetensors, or a state dict that PyTorch saved.
    #[arg(long, value_name = "FILE", help_heading = NETWORK)]
    pub(super) weights: Option<PathBuf>,
    /// Run weights that were trained on another preparation of the input.
    ///
    /// Without this option, such weights are refused.
    #[arg(long, help_heading = NETWORK)]
    pub(super) ignore_preparation: bool,
    /// Number of events of a recording between comparisons [default: 64 comparisons].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = PREDICTIONS)]
    pub(super) every: Option<u32>,
    /// Number of random streams.
    #[arg(long, value_name = "N", default_value_t = 100, help_heading = MEASUREMENT)]
    pub(super) cases: u64,
    /// Seed for the random streams and for drawn weights.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = MEASUREMENT)]
    pub(super) seed: u64,
    /// File for the minimal stream of a mismatch.
    ///
    /// A text of events (t,x,y,p) with the other steps as comments. It is written only at a mismatch, and replaces an
    /// existing file.
    #[arg(long, value_name = "FILE", default_value = "meissner-verify-failure.csv", help_heading = OUTPUT)]
    pub(super) out: PathBuf,
    /// Print one JSON object.
    ///
    /// The keys are explained below.
    #[arg(long, help_heading = OUTPUT)]
    pub(super) json: bool,
}

impl VerifyArgs {
    /// The first given option that has no effect on a frame network.
    pub(super) fn for_events(&self) -> Option<&'static str> {
        let own = [
            ("RECORDING", !self.recordings.is_empty()),
            ("--sensor", self.sensor.is_some()),
            ("--every", self.every.is_some()),
            ("--strict", self.read.strict),
        ];
        own.into_iter().chain(self.read.given()).find(|&(_, given)| given).map(|(option, _)| option)
    }
}
