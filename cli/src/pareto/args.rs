//! `meissner pareto`: what can be asked for.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use clap::Subcommand;
use meissner_engine::Sensor;
use meissner_kernels::Isa;

use crate::args::{ReadArgs, STATUS, sensor};
use crate::bench::start_us;
use crate::source::is_stdin;

/// How it measures, at the end of the long help.
const METHOD: &str = "\
How it measures:
  Each network is run exactly, then with each approximation that changes anything about it, and with some together. Errors
  are those of a setting against the same network's own exact form; the exact setting is measured as all others are, so
  that its time ratio shows how well times can be told apart here.
  Time: on one thread, with nothing beside it. A setting and the exact network take turns (1,000 events, or 10 windows,
  each) over the same events, --repeat times. The time of an event is the median over the repeats, which all compute the
  same, so that what interrupts one of them moves no figure; mean, p50 and p99 are over the events. The ratio is the
  setting's mean by that of the exact network in the same run. Times in the plot, on the front and in the last paragraph
  are the ratio times what the exact setting took, so that a machine that is slower for one setting moves no point.
  Networks over events: time is that of an event of the input: the filters, its push, and the prediction read after it. An
  event that a filter drops costs the filter, and the last prediction stands.
  Frame networks: time is that of a window of readings, from the reset on; push is that of its frames.
  Work: rows of events and cells (pixels of frame networks) that were computed, and multiply-adds at full neighbourhoods as
  `meissner inspect` has them; by Winograd as if directly.
  Numerical error: of everything predicted at the same moments, after each event, in the order of time, and for each tenth of
  the streams. max and RMS are in the outputs' units, the relative RMS is a share of the exact outputs' RMS. A stale readout is
  compared with what the exact network says at that moment.
  Wrong answers: with 95 % Wilson intervals, over several trainings the mean of their errors and bounds. For windows, which
  depend on each other where they are of one recording, they are too narrow. Of networks whose predictions depend on when
  others were read (tolerance, stale readout), answers are read with a prediction after each event.
  Front: the settings that no other beats in time and error; of equal ones all. Where there are labels, one front over all
  networks; else one for each network, whose errors are of its own outputs. The last paragraph names the fastest setting
  within some error of the exact one; what is less than 1.02 times as fast counts as no faster.

Settings of networks over events: tolerance; neighbours below the network's; span as a share of the network's; every Nth
  event (stride); a rate limit as a share of the mean rate of the events; the activity filter at 1250 us; a stale readout.
  Of frame networks: Winograd's convolutions and a tolerance where there is any layer for them, the last readings of a window
  alone.

State (--state): a line of JSON for each measurement, {\"key\": {\"system\", \"network\", \"weights\": fingerprint, \"setting\",
  \"data\": fingerprint, \"options\", \"version\"}, \"measurement\"}. What is there is not measured again. A last line that was
  not finished is cut off; any other that cannot be read is an error. Times of one file should be of one machine.

JSON (--json):
  {\"header\": what was measured on what (docs/json.md), \"system\", \"unit\", \"data\": {\"name\", \"recordings\", \"size\", \"timed\", \"fingerprint\"}, \"repeats\", \"isa\", \"notes\", \"compared\":
  the error that settings are compared by, \"networks\": [{\"network\", \"weights\", \"fingerprint\", \"settings\": [SETTING]}],
  \"fastest_within\": [{\"network\", \"within\", \"setting\", \"speed_up\", \"error\"}], \"words\": the last paragraph}
  SETTING: \"setting\", \"us\": time as compared, \"speed_up\", \"error\": as compared, \"interval_95\" (null without labels),
  \"on_front\", \"timed\", \"entered\": share that no filter dropped, \"push_us\" and \"push_predict_us\": {\"mean\", \"p50\", \"p99\"},
  \"exact_us\": mean of the exact network in the same runs, \"ratio\", \"rows\", \"multiply_adds\", \"numerical\": {\"max\", \"rms\",
  \"relative_rms\", \"max_by_tenth\", \"rms_by_tenth\"}, \"task\": [{\"of\", \"error\", \"interval_95\", \"trials\", \"trainings\"}]
  CSV (--csv): the same, a line for each setting, without the tenths.";

/// `meissner pareto`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct ParetoArgs {
    #[command(subcommand)]
    pub(super) what: What,
}

#[derive(Debug, Subcommand)]
pub(super) enum What {
    /// Networks over events that tell digits (N-MNIST): time against the share of wrong answers.
    Digits(DigitsArgs),
    /// Networks over events along a recording without labels: time against numerical error.
    Angle(AngleArgs),
    /// Frame networks that tell the direction of slip: time against the share of wrong answers on unseen objects.
    Slip(SlipArgs),
}

/// `meissner pareto digits`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
pub(super) struct DigitsArgs {
    /// Folder with folders train and test, or one of them, of recordings such as train/3/00123.bin.
    #[arg(value_name = "DATA")]
    pub(super) data: PathBuf,
    /// Name of a shipped network, or a description file (.toml, which needs --weights or --trainings); may be given
    /// several times [default: every shipped network for digits, with --trainings those of them that the folder has].
    #[arg(long = "network", value_name = "NAME|FILE.toml")]
    pub(super) networks: Vec<String>,
    /// Weights of the one network that is measured: safetensors, or a PyTorch state dict, trained on the split train.
    /// Without it those shipped with the network.
    #[arg(long, value_name = "FILE", conflicts_with = "trainings")]
    pub(super) weights: Option<PathBuf>,
    /// Folder of safetensors files, each a training of a network, as `eval digits` reads them. Where a network has folds,
    /// answers are those of its cross-validation over all recordings; else those on the split test.
    #[arg(long, value_name = "DIR")]
    pub(super) trainings: Option<PathBuf>,
    /// Number of folds of a cross-validation: they must then be those that prepare digits --folds N writes.
    #[arg(long, value_name = "N", requires = "trainings", value_parser = clap::value_parser!(u32).range(2..))]
    pub(super) folds: Option<u32>,
    #[command(flatten)]
    pub(super) common: Common,
}

/// `meissner pareto angle`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
pub(super) struct AngleArgs {
    /// Recording.
    #[arg(value_name = "RECORDING")]
    pub(super) recording: PathBuf,
    /// Name of a shipped network over events, or a description file (.toml, which needs --weights); may be given several
    /// times [default: graphres].
    #[arg(long = "network", value_name = "NAME|FILE.toml")]
    pub(super) networks: Vec<String>,
    /// Weights of the one network that is measured: safetensors, or a PyTorch state dict. Without it those shipped.
    #[arg(long, value_name = "FILE")]
    pub(super) weights: Option<PathBuf>,
    /// Measure weights that were trained on another preparation than the network computes: errors are against the same
    /// network without approximations, not against what the weights were trained for.
    #[arg(long)]
    pub(super) ignore_preparation: bool,
    /// Columns x rows of the sensor in pixels, in place of what the recording says.
    #[arg(long, value_name = "WxH", value_parser = sensor)]
    pub(super) sensor: Option<Sensor>,
    /// How the recording is read.
    #[command(flatten)]
    pub(super) read: ReadArgs,
    /// Leave out the events of the first SECONDS of the recording.
    #[arg(long, value_name = "SECONDS", value_parser = start_us)]
    pub(super) from_s: Option<i64>,
    #[command(flatten)]
    pub(super) common: Common,
}

/// `meissner pareto slip`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
pub(super) struct SlipArgs {
    /// Folder with a folder for each of the classes aw, cw, e, n, s, t, w, of recordings such as n/pen178.csv.
    #[arg(value_name = "DATA")]
    pub(super) data: PathBuf,
    /// Name of a shipped network, or a description file (.toml, which needs --trainings); may be given several times
    /// [default: every shipped network for slip, with --trainings those of them that the folder has].
    #[arg(long = "network", value_name = "NAME|FILE.toml")]
    pub(super) networks: Vec<String>,
    /// Folder of safetensors files, each a training of a network, as `eval slip` reads them; folds are passed over. Without
    /// it the weights shipped with the networks.
    #[arg(long, value_name = "DIR")]
    pub(super) trainings: Option<PathBuf>,
    #[command(flatten)]
    pub(super) common: Common,
}

/// What all systems have in common.
#[derive(Debug, clap::Args)]
pub(super) struct Common {
    /// Keep each finished measurement in this file, and measure nothing that it has.
    #[arg(long, value_name = "FILE.jsonl")]
    pub(super) state: Option<PathBuf>,
    /// Only settings with this text in "NETWORK, SETTING", and the exact one; may be given several times.
    #[arg(long, value_name = "TEXT")]
    pub(super) only: Vec<String>,
    /// Events that are timed in each repeat, about: digits takes whole recordings; windows for slip [default: 20000 events,
    /// 400 windows].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    timed_events: Option<u32>,
    /// Repeats of each measurement of time.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(super) repeat: u32,
    /// Threads that share the recordings whose answers are counted; the counts are the same for any number, and times are of
    /// one thread always [default: the machine's cores].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=512))]
    pub(super) threads: Option<u16>,
    /// Write one JSON object with everything to this file; - for standard output, in place of the text.
    #[arg(long, value_name = "FILE|-")]
    pub(super) json: Option<PathBuf>,
    /// Write a table to this file, a line for each setting.
    #[arg(long, value_name = "FILE")]
    pub(super) csv: Option<PathBuf>,
    /// Write a drawing to this file: time against error, with the front.
    #[arg(long, value_name = "FILE")]
    pub(super) svg: Option<PathBuf>,
}

impl Common {
    /// Events or windows to be timed.
    pub(super) fn timed_events(&self, default: usize) -> usize {
        self.timed_events.map_or(default, |events| events as usize)
    }

    /// What reaches a figure beside networks, settings and data.
    pub(super) fn options(&self, timed: usize) -> String {
        format!("{timed} timed, {} repeats, {}", self.repeat, Isa::best().name())
    }

    /// Whether `--only` leaves `name`.
    pub(super) fn asks_for(&self, name: &str) -> bool {
        self.only.is_empty() || self.only.iter().any(|part| name.contains(part.as_str()))
    }

    /// Whether JSON goes to standard output.
    pub(super) fn prints_json(&self) -> bool {
        self.json.as_deref().is_some_and(is_stdin)
    }
}
