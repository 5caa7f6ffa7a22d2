//! The error of this crate, and of the integrations.

use std::error::Error;

use meissner_engine::{EngineError, Sensor};
use meissner_io::IoError;
use meissner_live::LiveError;
use meissner_run::RunError;

/// The cause of an error.
pub type Cause = Box<dyn Error + Send + Sync>;

/// An engine or an integration cannot start, or cannot continue.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PacketError {
    /// The network or the source.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The engine refuses a sensor or a state, or its prediction is not a number.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The engine's thread has ended.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// A state cannot be read or written, or bytes are not events.
    #[error(transparent)]
    Io(#[from] IoError),
    /// A sensor changes its size within a stream.
    #[error("expected a sensor of {expected} in this stream, got {found}")]
    Sensor {
        /// The size of the packets before.
        expected: Sensor,
        /// The size of this one.
        found: Sensor,
    },
    /// A step of the transport, or a file.
    #[error("{what}")]
    Failed {
        /// The failing step.
        what: String,
        /// The cause.
        source: Cause,
    },
    /// A record does not account for every event, or has other bits.
    #[error("{0}")]
    Record(String),
    /// A packet or a setting is wrong.
    #[error("{what}: expected {expected}, got {found}")]
    Unexpected {
        /// The wrong part.
        what: String,
        /// The admissible values.
        expected: String,
        /// The found value.
        found: String,
    },
}

impl PacketError {
    /// `found` instead of `expected`.
    pub fn unexpected(what: &str, expected: &str, found: &str) -> Self {
        let [what, expected, found] = [what, expected, found].map(str::to_owned);
        Self::Unexpected { what, expected, found }
    }
}

/// Makes a failure of `what` from its cause.
pub fn failed<E: Into<Cause>>(what: impl Into<String>) -> impl FnOnce(E) -> PacketError {
    |source| PacketError::Failed { what: what.into(), source: source.into() }
}
