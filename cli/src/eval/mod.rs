//! `meissner eval`: networks on labelled data sets, judged as the papers judge them.
//!
//! | file | job |
//! |---|---|
//! | `slip/`, `digits/` | the systems |
//! | `text` | figures as text |

mod digits;
mod slip;
mod text;

use clap::Subcommand;

use crate::args::STATUS;
use crate::error::CliError;
use digits::DigitsArgs;
use slip::SlipArgs;

/// `meissner eval`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct EvalArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Direction of slip from 24 electrodes, on seen and unseen objects.
    Slip(SlipArgs),
    /// Digits under a moving event camera (N-MNIST), over time.
    Digits(DigitsArgs),
}

/// Does what `args` ask for.
pub(crate) fn eval(args: &EvalArgs) -> Result<(), CliError> {
    match &args.what {
        What::Slip(args) => slip::eval(args),
        What::Digits(args) => digits::eval(args),
    }
}
