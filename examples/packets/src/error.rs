//! The error of this crate.

use meissner_engine::{EngineError, Sensor};
use meissner_io::IoError;
use meissner_live::LiveError;
use meissner_run::RunError;

/// An engine cannot start, or cannot go on.
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
    /// A state cannot be read or written.
    #[error(transparent)]
    File(#[from] IoError),
    /// A sensor changes its size within a stream.
    #[error("expected a sensor of {expected} in this stream, got {found}")]
    Sensor {
        /// The size of the packets before.
        expected: Sensor,
        /// The size of this one.
        found: Sensor,
    },
}
