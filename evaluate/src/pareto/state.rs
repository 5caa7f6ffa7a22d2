//! Finished measurements in a file, so that nothing is measured twice.

use meissner_run::journal::Journal;
use serde::{Deserialize, Serialize};

use super::measurement::Measurement;

/// Finished measurements, and the file that keeps them.
pub type State = Journal<Key, Measurement>;

/// Everything that determines a measurement, except the machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the keys of the file")]
pub struct Key {
    pub system: String,
    pub network: String,
    /// Fingerprint of network and weights.
    pub weights: String,
    pub setting: String,
    /// Fingerprint of the data.
    pub data: String,
    /// Timed events, windows, pictures or recordings, repeats, instruction set.
    pub options: String,
    pub version: String,
}
