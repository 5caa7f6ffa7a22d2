//! `meissner eval digits`: what can be asked for.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use crate::args::{Mode, STATUS};

/// How it judges, and examples, at the end of the long help.
const METHOD: &str = "\
How it judges:
  Every recording is a stream of its own: the engine is reset, takes its events one by one, and a prediction is read every
  N microseconds (--every-us) and at the end. Times count from the recording's first event. A prediction is the class with
  the largest output. Behind the end of a recording its last prediction stands, so that every recording counts at every
  time and the last accuracy is that at the end. An answer has settled at the first of these moments from which on it is
  right; the median is the time by which half of the recordings have settled, those that never do included.
  Whole trainings are judged on the split test, folds of a cross-validation on what they held out, of both splits.
  Intervals are 95 % Wilson intervals over the recordings, one for each seed; over several seeds the mean of their bounds
  is given, mean and sample standard deviation of the accuracy (- for one), and confusion matrices are summed.

Trainings (--trainings): every *.safetensors file of the folder is one, with metadata
  network     name of the network; digits-frozen runs with those of digits-past
  seed        whole number
  trained_on  \"train\": the split test is unseen; of a fold it may say anything or be missing
  held_out    JSON list of recordings, such as [\"train/3/00123\"]: the file is a fold; or not there: a whole training
  fold        whole number, or not there
  stride      it was trained on every N-th event of a recording, the first one included; or not there: on all
  The folds of a network and seed must hold out every recording exactly once, and give one accuracy together.

JSON (--json), shares from 0 to 1:
  {\"header\": what was judged on what (docs/json.md), \"data\": {\"folder\", \"recordings\", \"train\", \"test\", \"events\", \"notes\"}, \"classes\", \"mode\", \"every_us\",
  \"times_us\": [the times at which predictions are read], \"networks\": [{\"network\", \"weights\", \"outputs\", \"classes\", \"stride\",
  \"test\": JUDGED or null, \"cross_validation\": JUDGED or null}]}
  JUDGED: \"recordings\": judged per training, \"trainings\", \"accuracy\": {\"mean\", \"std\" (null for one training)},
  \"interval_95\": [low, high], \"settled_us\": the median, null where half or more never settle, \"confusion\": rows true,
  columns predicted, \"accuracy_at\": [{\"mean\", \"std\"}], \"interval_95_at\": [[low, high]], both for each of times_us,
  \"each\": [{\"seed\" (null where the weights name none), \"files\", \"recordings\", \"accuracy\", \"interval_95\", \"settled_us\",
  \"confusion\", \"accuracy_at\": [share], \"interval_95_at\"}]

Logits (--logits), at the end of each recording: for every whole training a tensor NETWORK.SEED, or NETWORK.shipped where
  the weights name no seed, of shape (recordings of the split test, 10); for the folds of a seed together a tensor
  NETWORK.SEED.folds of shape (recordings, 10). Metadata recordings and test: JSON lists of their names.

Examples:
  meissner eval digits nmnist/
  meissner eval digits nmnist/ --network own.toml --weights own.safetensors --svg digits.svg
  meissner eval digits nmnist/ --trainings runs/ --folds 10 --json - > digits.json
  meissner eval digits nmnist/ --network digits-past --every-us 5000 --logits logits.safetensors";

/// `meissner eval digits`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
pub(crate) struct DigitsArgs {
    /// Folder with folders train and test, or one of them, of recordings such as train/3/00123.bin.
    #[arg(value_name = "DATA")]
    pub(super) data: PathBuf,
    /// Name of a shipped network, or a description file (.toml, which needs --weights or --trainings); may be given
    /// several times [default: every shipped network for digits, with --trainings those of them that the folder has].
    #[arg(long = "network", value_name = "NAME|FILE.toml")]
    pub(super) networks: Vec<String>,
    /// Weights of the one network that is judged: safetensors, or a PyTorch state dict, trained on the split train.
    /// Without it those shipped with the network.
    #[arg(long, value_name = "FILE", conflicts_with = "trainings")]
    pub(super) weights: Option<PathBuf>,
    /// Folder of safetensors files, each a training of a network.
    #[arg(long, value_name = "DIR")]
    pub(super) trainings: Option<PathBuf>,
    /// Number of folds of a cross-validation: they must then be those that prepare digits --folds N writes.
    #[arg(long, value_name = "N", requires = "trainings", value_parser = clap::value_parser!(u32).range(2..))]
    pub(super) folds: Option<u32>,
    /// Take every N-th event of each recording, the first one included, whatever the weights say [default: what the
    /// weights say in their metadata, else 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) stride: Option<u32>,
    /// Microseconds from one prediction to the next.
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = clap::value_parser!(i64).range(100..=10_000_000))]
    pub(super) every_us: i64,
    /// How predictions are computed; both give the same.
    #[arg(long, value_enum, default_value_t = Mode::Incremental)]
    pub(super) mode: Mode,
    /// Threads that share the recordings; the results are the same for any number [default: the machine's cores].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=512))]
    pub(super) threads: Option<u16>,
    /// Write one JSON object with everything, each training's figures too, to this file; - for standard output, in place
    /// of the text.
    #[arg(long, value_name = "FILE|-")]
    pub(super) json: Option<PathBuf>,
    /// Write a drawing to this file: accuracies against time with their intervals, and a confusion matrix for each network.
    #[arg(long, value_name = "FILE")]
    pub(super) svg: Option<PathBuf>,
    /// Write the outputs at the end of each recording to this file (safetensors).
    #[arg(long, value_name = "FILE.safetensors")]
    pub(super) logits: Option<PathBuf>,
}
