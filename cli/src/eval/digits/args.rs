//! `meissner eval digits`: what can be asked for.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use crate::args::{MEASUREMENT, Mode, NETWORK, OUTPUT, PREDICTIONS, STATUS};
use meissner_pipeline::time;

/// How it judges, and examples, at the end of the long help.
const METHOD: &str = "\
How it judges:
  Every recording is a stream of its own: the engine is reset, takes its events one by one, and a prediction is read every TIME (--every) and at the end. Times count from the recording's first event. A prediction is the class with the largest output. After the end of a recording its last prediction stands, so that every recording counts at every time and the last accuracy is that at the end. An answer has settled at the first of these moments from which on it is right; the median is the time by which half of the recordings have settled, those that never do included.
  Whole trainings are judged on the split test, folds of a cross-validation on the recordings that they held out, of both splits.
  Intervals are 95 % Wilson intervals over the recordings, one for each seed. Over several seeds the mean of their bounds is given, mean and sample standard deviation of the accuracy (- for one), and confusion matrices are summed.

Trainings (--trainings): every *.safetensors file of the folder is one, with metadata
  network     name of the network; digits-frozen runs with those of digits-past
  seed        whole number
  trained_on  \"train\": the split test is unseen; of a fold it may say anything or
              be missing
  held_out    JSON list of recordings, such as [\"train/3/00123\"]: the file is a
              fold; or not there: a whole training
  fold        whole number, or not there
  stride      it was trained on every N-th event of a recording, the first one
              included; or not there: on all
  The folds of a network and seed must hold out every recording exactly once, and give one accuracy together.

JSON (--json), shares from 0 to 1:
  {\"header\": what was judged on what (docs/json.md), \"data\": {\"folder\", \"recordings\", \"train\", \"test\", \"events\", \"notes\"}, \"classes\", \"mode\", \"every_us\", \"times_us\": [the times at which predictions are read], \"networks\": [{\"network\", \"weights\", \"outputs\", \"classes\", \"stride\", \"test\": JUDGED or null, \"cross_validation\": JUDGED or null}]}
  JUDGED: \"recordings\": judged per training, \"trainings\", \"accuracy\": {\"mean\", \"std\" (null for one training)}, \"interval_95\": [low, high], \"settled_us\": the median, null where half or more never settle, \"confusion\": rows true, columns predicted, summed over the trainings, \"accuracy_at\": [{\"mean\", \"std\"}], \"interval_95_at\": [[low, high]], both for each of times_us, \"each\": [{\"seed\" (null where the weights name none), \"files\", \"recordings\", \"accuracy\", \"interval_95\", \"settled_us\", \"confusion\", \"accuracy_at\": [share], \"interval_95_at\"}]

Logits (--logits), at the end of each recording:
  For every whole training a tensor NETWORK.SEED, or NETWORK.shipped where the weights name no seed, of shape (recordings of the split test, 10); for the folds of a seed together a tensor NETWORK.SEED.folds of shape (recordings, 10). Metadata recordings and test: JSON lists of their names.

Examples:
  meissner eval digits nmnist/
  meissner eval digits nmnist/ --network own.toml --weights own.safetensors
  meissner eval digits nmnist/ --trainings runs/ --folds 10 --json - > out.json
  meissner eval digits nmnist/ --network digits-past --every 5ms --svg out.svg";

/// `meissner eval digits`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
pub(crate) struct DigitsArgs {
    /// Folder of the data set, with folders train and test.
    ///
    /// One of the two is enough. Recordings are files such as train/3/00123.bin.
    #[arg(value_name = "DATA")]
    pub(super) data: PathBuf,
    /// Network to judge [default: every shipped network for digits].
    ///
    /// The name of a shipped network, or a description file, which needs --weights or --trainings. It may be given
    /// several times. With --trainings the default is those of the shipped networks that the folder has.
    #[arg(long = "network", value_name = "NETWORK", help_heading = NETWORK)]
    pub(super) networks: Vec<String>,
    /// Weights of the only network [default: those shipped with it].
    ///
    /// The file is safetensors, or a state dict that PyTorch saved. They must be trained on the split train.
    #[arg(long, value_name = "FILE", conflicts_with = "trainings", help_heading = NETWORK)]
    pub(super) weights: Option<PathBuf>,
    /// Folder of safetensors files, each a training of a network.
    ///
    /// Their metadata are explained below.
    #[arg(long, value_name = "DIR", help_heading = NETWORK)]
    pub(super) trainings: Option<PathBuf>,
    /// Number of folds of the cross-validation in --trainings.
    ///
    /// The folds must be those that `meissner prepare digits --folds N` writes.
    #[arg(long, value_name = "N", requires = "trainings", value_parser = clap::value_parser!(u32).range(2..),
          help_heading = NETWORK)]
    pub(super) folds: Option<u32>,
    /// Take every Nth event of each recording [default: as the weights say].
    ///
    /// The first event is taken. Weights say in their metadata with which stride they were trained; where they do not,
    /// every event is taken.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = NETWORK)]
    pub(super) stride: Option<u32>,
    /// Time from one prediction to the next.
    ///
    /// It is 100us to 10s.
    #[arg(long = "every", value_name = "TIME", default_value = "10ms", value_parser = every_us,
          help_heading = PREDICTIONS)]
    pub(super) every_us: i64,
    /// Recompute what an event changes, or every row at every prediction.
    ///
    /// Both give the same values, bit for bit.
    #[arg(long, value_enum, default_value_t = Mode::Incremental, help_heading = PREDICTIONS)]
    pub(super) mode: Mode,
    /// Threads that share the recordings [default: the machine's cores].
    ///
    /// The results are the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=512), help_heading = MEASUREMENT)]
    pub(super) threads: Option<u16>,
    /// Write one JSON object to this file; - for standard output.
    ///
    /// It has each training's figures too. On standard output it takes the place of the text.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) json: Option<PathBuf>,
    /// Draw accuracies against time and confusion matrices into this file.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) svg: Option<PathBuf>,
    /// Write the outputs at the end of each recording (safetensors).
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) logits: Option<PathBuf>,
}

/// Reads a time from one prediction to the next.
fn every_us(text: &str) -> Result<i64, String> {
    let us = time::span_us(text)?;
    let fits = (100..=10_000_000).contains(&us);
    if fits { Ok(us) } else { Err("expected a time from 100us to 10s".to_owned()) }
}
