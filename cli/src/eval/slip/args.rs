//! `meissner eval slip`: what can be asked for.

use std::path::PathBuf;

use crate::args::{MEASUREMENT, NETWORK, OUTPUT, STATUS};

/// How it judges, and examples, at the end of the long help.
const METHOD: &str = "\
How it judges:
  Recordings are cut into windows that follow each other and do not overlap, as the paper cuts them and as `prepare slip` writes them, whatever `sampling` a description has. A window's prediction is the class with the largest output. Accuracy is the share of windows that are predicted right. Precision, recall and F1 are means over the classes that are true or predicted at least once, each counting the same; a class that is never predicted has precision and F1 0. Each is given as mean and sample standard deviation over trainings (- for one). Confusion matrices are shares over all trainings. Numbers of windows are those of one training.

Trainings (--trainings): every *.safetensors file of the folder is one, with metadata
  network           name of the network
  seed              whole number
  trained_on        \"Basic\": the other sets are unseen
  preparation       how its frames were made, as `prepare slip` writes it: it must
                    fit the description; or not there
  A file with nothing more is a whole training, judged on the objects of all sets; Basic is marked as trained on. With one of these it is a fold of a cross-validation, judged only on the windows that it names:
  scheme            recordings or windows, or not there
  held_out          JSON list of recordings, such as [\"n/pen178\"]
                    (scheme recordings)
  held_out_windows  JSON list of [recording, window], counted from 0
                    (scheme windows)
  fold              whole number, or not there
  The folds of a network, seed and scheme give one accuracy together.

JSON (--json), shares from 0 to 1:
  {\"header\": what was judged on what (docs/json.md), \"data\": {\"folder\", \"recordings\", \"readings\", \"notes\"}, \"classes\", \"networks\": [{\"network\", \"weights\", \"outputs\", \"classes\", \"preparation\", \"sets\": [{\"set\", \"trained_on\", JUDGED}], \"cross_validation\": [{\"scheme\", \"of_basic\": windows of Basic, JUDGED}]}], \"references\": [{\"name\", \"about\", \"accuracy\": {set: share}}]}
  JUDGED: \"windows\": judged per training, \"trainings\", \"accuracy\", \"precision\", \"recall\", \"f1\": each {\"mean\", \"std\" (null for one training)}, \"confusion\": rows true, columns predicted, summed over the trainings, \"each\": [{\"seed\" (null where the weights name none), \"files\", \"windows\", \"accuracy\", \"precision\", \"recall\", \"f1\", \"confusion\"}]

Logits (--logits), for all windows, in the order of `prepare slip`:
  For every whole training a tensor NETWORK.SEED, or NETWORK.shipped where the weights name no seed, of shape (windows, 7).

Examples:
  meissner eval slip biotac_dos/
  meissner eval slip biotac_dos/ --network slip-lstm --threads 2 --svg slip.svg
  meissner eval slip biotac_dos/ --trainings runs/ --json - > slip.json
  meissner eval slip biotac_dos/ --network own.toml --trainings runs/";

/// `meissner eval slip`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
pub(crate) struct SlipArgs {
    /// Folder of the data set, with a folder for each class.
    ///
    /// The classes are aw, cw, e, n, s, t and w; recordings are files such as n/pen178.csv.
    #[arg(value_name = "DATA")]
    pub(super) data: PathBuf,
    /// Network to judge [default: every shipped network for slip].
    ///
    /// The name of a shipped network, or a description file, which needs --trainings. It may be given several times.
    /// With --trainings the default is those of the shipped networks that the folder has.
    #[arg(long = "network", value_name = "NETWORK", help_heading = NETWORK)]
    pub(super) networks: Vec<String>,
    /// Folder of safetensors files, each a training of a network.
    ///
    /// Their metadata are explained below. Without it, the weights that are shipped with the networks are judged.
    #[arg(long, value_name = "DIR", help_heading = NETWORK)]
    pub(super) trainings: Option<PathBuf>,
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
    /// Draw accuracies and confusion matrices into this file.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) svg: Option<PathBuf>,
    /// Write the outputs for all windows (safetensors).
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) logits: Option<PathBuf>,
}
