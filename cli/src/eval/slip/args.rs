//! `meissner eval slip`: what can be asked for.

use std::path::PathBuf;

use crate::args::STATUS;

/// How it judges, and examples, at the end of the long help.
const METHOD: &str = "\
How it judges:
  Recordings are cut into windows that follow each other and do not overlap, as the paper cuts them and as `prepare slip`
  writes them, whatever `sampling` a description has. A window's prediction is the class with the largest output.
  Accuracy is the share of windows that are predicted right. Precision, recall and F1 are means over the classes that are
  true or predicted at least once, each counting the same; a class that is never predicted has precision and F1 0. Each
  is given as mean and sample standard deviation over trainings (- for one); confusion matrices are summed over them.

Trainings (--trainings): every *.safetensors file of the folder is one, with metadata
  network           name of the network
  seed              whole number
  trained_on        \"Basic\": the other sets are unseen
  preparation       how its frames were made, as `prepare slip` writes it: it must fit the description; or not there
  A file with nothing more is a whole training, judged on the objects of all sets; Basic is marked as trained on. With one
  of these it is a fold of a cross-validation, judged on what it names alone:
  scheme            recordings or windows, or not there
  held_out          JSON list of recordings, such as [\"n/pen178\"]         (scheme recordings)
  held_out_windows  JSON list of [recording, window], counted from 0     (scheme windows)
  fold              whole number, or not there
  The folds of a network, seed and scheme give one accuracy together.

JSON (--json), shares from 0 to 1:
  {\"header\": what was judged on what (docs/json.md), \"data\": {\"folder\", \"recordings\", \"readings\", \"notes\"}, \"classes\", \"networks\": [{\"network\", \"weights\", \"outputs\", \"classes\", \"preparation\",
  \"sets\": [{\"set\", \"trained_on\", JUDGED}], \"cross_validation\": [{\"scheme\", \"of_basic\": windows of Basic, JUDGED}]}],
  \"references\": [{\"name\", \"about\", \"accuracy\": {set: share}}]}
  JUDGED: \"windows\": judged per training, \"trainings\", \"accuracy\", \"precision\", \"recall\", \"f1\": each {\"mean\", \"std\"
  (null for one training)}, \"confusion\": rows true, columns predicted, \"each\": [{\"seed\" (null where the weights name
  none), \"files\", \"windows\", \"accuracy\", \"precision\", \"recall\", \"f1\", \"confusion\"}]

Examples:
  meissner eval slip biotac_dos/
  meissner eval slip biotac_dos/ --network slip-lstm --threads 2 --svg slip.svg
  meissner eval slip biotac_dos/ --trainings runs/ --json - > slip.json
  meissner eval slip biotac_dos/ --network own.toml --trainings runs/ --logits logits.safetensors";

/// `meissner eval slip`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
pub(crate) struct SlipArgs {
    /// Folder with a folder for each of the classes aw, cw, e, n, s, t, w, of recordings such as n/pen178.csv.
    #[arg(value_name = "DATA")]
    pub(super) data: PathBuf,
    /// Name of a shipped network, or a description file (.toml, which needs --trainings); may be given several times
    /// [default: every shipped network for slip, with --trainings those of them that the folder has].
    #[arg(long = "network", value_name = "NAME|FILE.toml")]
    pub(super) networks: Vec<String>,
    /// Folder of safetensors files, each a training of a network. Without it the weights shipped with the networks.
    #[arg(long, value_name = "DIR")]
    pub(super) trainings: Option<PathBuf>,
    /// Threads that share the recordings; the results are the same for any number [default: the machine's cores].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=512))]
    pub(super) threads: Option<u16>,
    /// Write one JSON object with everything, each training's figures too, to this file; - for standard output, in place
    /// of the text.
    #[arg(long, value_name = "FILE|-")]
    pub(super) json: Option<PathBuf>,
    /// Write a drawing to this file: accuracies of all networks, and a confusion matrix for each network and set.
    #[arg(long, value_name = "FILE")]
    pub(super) svg: Option<PathBuf>,
    /// Write the outputs for all windows, in the order of `prepare slip`, to this file (safetensors): for every whole
    /// training a tensor NETWORK.SEED, or NETWORK.shipped where the weights name no seed, of shape (windows, 7).
    #[arg(long, value_name = "FILE.safetensors")]
    pub(super) logits: Option<PathBuf>,
}
