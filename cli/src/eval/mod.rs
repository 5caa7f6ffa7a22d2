//! `meissner eval`: networks on labelled data sets, judged as the papers judge them.

mod slip;

use clap::Subcommand;

use crate::args::STATUS;
use crate::error::CliError;
use slip::SlipArgs;
pub(crate) use slip::TrainingError;

/// `meissner eval`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct EvalArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Direction of slip from 24 electrodes, on objects that training has seen and on others.
    Slip(SlipArgs),
}

/// Does what `args` ask for.
pub(crate) fn eval(args: &EvalArgs) -> Result<(), CliError> {
    match &args.what {
        What::Slip(args) => slip::eval(args),
    }
}
