//! `meissner verify`: incremental against full recomputation, bit for bit. [`meissner_verify`] does
//! the work.
//!
//! | file | contents |
//! |---|---|
//! | `args` | the arguments of the three forms |
//! | `streams` | random streams, recordings, and a stream to replay |
//! | `stress` | `--stress`: streams, weights, states and images that strain the arithmetic |
//! | `soak` | `--soak`: one engine over recordings in a loop, with frequent disturbances |

mod args;
mod soak;
mod streams;
mod stress;

pub(crate) use args::{OF_STRESS, VerifyArgs};
#[cfg(test)]
pub(crate) use streams::FOR_EVENTS;

use crate::error::CliError;
use crate::given::Given;

/// Runs the form that `args` name.
pub(crate) fn verify(args: &VerifyArgs, given: &Given) -> Result<(), CliError> {
    if let Some(option) = given.first(OF_STRESS).filter(|_| !args.stress) {
        return Err(CliError::usage(option, "--stress with it", args.network()));
    }
    match (args.stress, args.soak) {
        (true, _) => stress::stress(args),
        (_, true) => soak::soak(args),
        _ => streams::streams(args, given),
    }
}
