//! `meissner eval touch`: accuracies of networks over the events of a tactile skin, event by event.

use meissner_evaluate::events::{TouchContainers, TouchObjects};
use meissner_io::datasets::NeutouchSet;

use super::events::JudgeArgs;
use crate::error::CliError;
use crate::tasks::{EventNetworks, TouchData};

/// At the end of the long help.
const METHOD: &str = "\
`meissner eval digits --help` explains how it judges, the trainings and the JSON: they are the same. An event of a recording is a spike of a taxel. Its pixel is the place of the taxel in steps of 0.05 mm, and its time is the beginning of its bin of 20 ms.

Examples:
  meissner eval touch objects neutouch/ --every 100ms
  meissner eval touch containers neutouch/ --trainings runs/ --folds 5 --svg a.svg";

/// `meissner eval touch`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD)]
pub(super) struct TouchArgs {
    #[command(flatten)]
    data: TouchData,
    #[command(flatten)]
    networks: EventNetworks,
    #[command(flatten)]
    judge: JudgeArgs,
}

pub(super) fn eval(args: &TouchArgs) -> Result<(), CliError> {
    let TouchData { set, data } = &args.data;
    match set {
        NeutouchSet::Objects => {
            args.judge.eval::<TouchObjects>(data, &args.networks, "Objects by touch, event by event")
        }
        NeutouchSet::Containers => {
            args.judge.eval::<TouchContainers>(data, &args.networks, "Containers by touch, event by event")
        }
    }
}
