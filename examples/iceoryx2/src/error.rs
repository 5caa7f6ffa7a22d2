//! Errors of the processes.

use std::error::Error as StdError;

use meissner_packets::PacketError;
use meissner_run::RunError;

/// An error of iceoryx2.
pub type Cause = Box<dyn StdError + Send + Sync>;

/// A process cannot start, or cannot go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A service of this name carries other types: another version of this program, or another
    /// program.
    #[error("service {service}: expected {expected}, got {found}")]
    OtherTypes {
        /// The service.
        service: String,
        /// Types of payload and header, with their sizes in bytes.
        expected: String,
        /// Those of the service.
        found: String,
    },
    /// A setting is out of range.
    #[error("{what}: expected {expected}, got {found}")]
    Setting {
        /// The setting.
        what: &'static str,
        /// Values that it can have.
        expected: String,
        /// The value.
        found: String,
    },
    /// iceoryx2 refuses a step.
    #[error("service {service}: cannot {step}")]
    Service {
        /// The service.
        service: String,
        /// The step.
        step: &'static str,
        /// The reason.
        source: Cause,
    },
    /// The source or the network.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The engine.
    #[error(transparent)]
    Packets(Box<PacketError>),
    /// A result cannot be shown.
    #[error("output")]
    Output(#[source] std::io::Error),
}

impl From<PacketError> for Error {
    fn from(error: PacketError) -> Self {
        Self::Packets(error.into())
    }
}

impl Error {
    /// iceoryx2 refuses `step` with `source`.
    pub fn service(service: &str, step: &'static str, source: impl Into<Cause>) -> Self {
        Self::Service { service: service.to_owned(), step, source: source.into() }
    }
}
