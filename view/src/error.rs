//! Errors of a session.

use meissner_engine::EngineError;
use meissner_engine::representations::RepresentationError;
use meissner_models::ModelError;
use meissner_models::systems::contact_area::ContactError;
use thiserror::Error;

/// The reason why a session cannot carry out a request.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ViewError {
    /// A command is not one of [`Command`](crate::command::Command).
    #[error("command: {0}")]
    Command(#[from] serde_json::Error),
    /// A number of a command is out of range.
    #[error("command {command}: expected {expected}, found {found}")]
    Value {
        /// The command.
        command: &'static str,
        /// The expected value.
        expected: &'static str,
        /// The given value.
        found: f64,
    },
    /// There is no such network, or it reads no events.
    #[error("network {name}: expected one of {known}")]
    Network {
        /// The name.
        name: String,
        /// The known networks.
        known: String,
    },
    /// The weights of a network do not fit.
    #[error("network {name}")]
    Weights {
        /// The name.
        name: String,
        /// Why.
        source: ModelError,
    },
    /// The engine refuses.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A picture does not fit, or a force is not finite.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// A reading does not fit.
    #[error(transparent)]
    Reading(#[from] RepresentationError),
    /// An item is of another kind or size than the network reads.
    #[error("an item of another kind or size than the network reads")]
    Shape,
    /// Another reason, from a caller's own networks.
    #[error("network {name}: {reason}")]
    Other {
        /// The name.
        name: String,
        /// Why.
        reason: String,
    },
}
