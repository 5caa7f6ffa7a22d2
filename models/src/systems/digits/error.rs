//! What does not belong to the system.

use thiserror::Error;

/// A network or a number of folds is none of the digits.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum DigitsError {
    /// A network predicts something other than the digits.
    #[error("network {network}: expected the outputs {expected}, found {found}")]
    Outputs {
        /// The network.
        network: String,
        /// The classes.
        expected: String,
        /// Its outputs.
        found: String,
    },
    /// A cross-validation cannot have that many folds.
    #[error("folds: expected 2 to {recordings}, the number of recordings, found {found}")]
    Folds {
        /// How many recordings there are.
        recordings: usize,
        /// How many folds were asked for.
        found: usize,
    },
}
