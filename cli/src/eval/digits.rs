//! `meissner eval digits`: accuracies of networks over events for digits, event by event.

use meissner_evaluate::digits::Digits;

use super::events::JudgeArgs;
use crate::args::STATUS;
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

JSON (--json), shares from 0 to 1:
  {\"header\": the command and its input (docs/json.md), \"data\": {\"folder\", \"recordings\", \"train\", \"test\", \"events\", \"notes\"}, \"classes\", \"mode\", \"every_us\", \"times_us\": [the times at which predictions are read], \"networks\": [{\"network\", \"weights\", \"outputs\", \"classes\", \"stride\", \"test\": JUDGED or null, \"cross_validation\": JUDGED or null}]}
  JUDGED: \"recordings\": judged per training, \"trainings\", \"accuracy\": {\"mean\", \"std\" (null for one training)}, \"interval_95\": [low, high], \"settled_us\": the median, null where half or more never settle, \"confusion\": rows true, columns predicted, summed over the trainings, \"accuracy_at\": [{\"mean\", \"std\"}], \"interval_95_at\": [[low, high]], both for each of times_us, \"each\": [{\"seed\" (null where the weights name none), \"files\", \"recordings\", \"accuracy\", \"interval_95\", \"settled_us\", \"confusion\", \"accuracy_at\": [share], \"interval_95_at\"}]

Logits (--logits), at the end of each recording:
  For every whole training a tensor NETWORK.SEED, or NETWORK.shipped where the weights name no seed, of shape (recordings of the split test, 10). For the folds of a seed together a tensor NETWORK.SEED.folds of shape (recordings, 10). Metadata recordings and test: JSON lists of their names.

Examples:
  meissner eval digits nmnist/
  meissner eval digits nmnist/ --network own.toml --weights own.safetensors
  meissner eval digits nmnist/ --trainings runs/ --folds 10 --json - > out.json
  meissner eval digits nmnist/ --network digits-past --every 5ms --svg out.svg";

/// `meissner eval digits`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
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
