//! What does not belong to the system.

use meissner_engine::representations::RepresentationError;
use thiserror::Error;

/// A network or a recording is none of direction of slip.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SlipError {
    /// A network reads something other than electrodes.
    #[error(
        "network {network}: expected a network over readings of electrodes (frames = \"tactile-image\" or \
         \"electrodes\"), found frames = {found:?}"
    )]
    NotReadings {
        /// The network.
        network: String,
        /// The word for its frames.
        found: &'static str,
    },
    /// A network predicts something other than the directions of slip.
    #[error("network {network}: expected the outputs {expected}, found {found}")]
    Outputs {
        /// The network.
        network: String,
        /// The classes.
        expected: String,
        /// Its outputs.
        found: String,
    },
    /// An object that no set holds.
    #[error("recording {recording}: expected an object of {expected}, found {found:?}")]
    Object {
        /// The recording.
        recording: String,
        /// The objects.
        expected: String,
        /// The object.
        found: String,
    },
    /// A reading cannot enter a window.
    #[error(transparent)]
    Reading(#[from] RepresentationError),
}
