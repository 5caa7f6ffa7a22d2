//! `meissner eval digits`: accuracies of networks over events for digits, event by event.

use meissner_evaluate::events::Digits;

use super::events::JudgeArgs;
use crate::error::CliError;
use crate::tasks::DigitsTask;

/// At the end of the long help.
const METHOD: &str = "\
How it judges:
  Every recording is a separate stream. The engine is reset, the events are pushed one by one, and a prediction is read every TIME (--every) and at the end. Times count from the first event of the recording. A prediction is the class with the largest output. The last prediction of a recording stays valid after its end: every recording counts at every time, and the last accuracy is the accuracy at the end. An answer settles at the first of these times from which all predictions are right. The median is the time by which half of all recordings have settled; some may never settle.
  Whole trainings are judged on the split test. Folds of a cross-validation are judged on the recordings of both splits that they held out.
  Intervals are 95 % Wilson intervals over the recordings, one for each seed. For several seeds, the bounds are means over the seeds, accuracies have a mean and a sample standard deviation (- for one seed), and confusion matrices are sums.

Trainings (--trainings): every *.safetensors file of the folder is a training, with metadata
  network     name of the network; digits-frozen uses those of digits-past
  seed        whole number
  trained_on  \"train\": the split test is unseen; folds need no trained_on
  held_out    JSON list of recordings, such as [\"train/3/00123\"]: the file is a
              fold; without this key, it is a whole training
  fold        whole number (optional)
  stride      N if the network was trained on every N-th event of a recording,
              starting with the first; without this key: on all events
  The folds of a network and seed must hold out every recording exactly once, and give one accuracy together.

Logits (--logits), at the end of each recording:
  For every whole training a tensor NETWORK.SEED, or NETWORK.shipped where the weights name no seed, of shape (recordings of the split test, 10). For the folds of a seed together a tensor NETWORK.SEED.folds of shape (recordings, 10). Metadata recordings and test: JSON lists of their names.

Examples:
  meissner eval digits nmnist/
  meissner eval digits nmnist/ --network own.toml --weights own.safetensors
  meissner eval digits nmnist/ --trainings runs/ --folds 10 --json > out.json
  meissner eval digits nmnist/ --network digits-past --every 5ms --svg out.svg";

/// `meissner eval digits`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD)]
pub(super) struct DigitsArgs {
    #[command(flatten)]
    task: DigitsTask,
    #[command(flatten)]
    judge: JudgeArgs,
}

pub(super) fn eval(args: &DigitsArgs) -> Result<(), CliError> {
    let DigitsTask { data, networks } = &args.task;
    args.judge.eval::<Digits>(data, networks, "Digits, event by event")
}
