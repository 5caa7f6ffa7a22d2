//! Errors of live inference.

use meissner_engine::EngineError;
use thiserror::Error;

/// A live engine cannot start, has ended, or computed a result that is not a number.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LiveError {
    /// A value of the queue's options is out of range.
    #[error("{what}: expected {expected}, found {found}")]
    Option {
        /// Name of the value.
        what: &'static str,
        /// The admissible range.
        expected: String,
        /// The value found.
        found: String,
    },
    /// The newest computation of a prediction failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The worker's thread could not be started.
    #[error("the worker's thread cannot be started")]
    Thread(#[source] std::io::Error),
    /// The worker's thread cannot be pinned to the requested core.
    #[error("the worker cannot be pinned to core {core}: expected one of {cores:?}")]
    Core {
        /// The core.
        core: usize,
        /// The cores that this process may use.
        cores: Vec<usize>,
    },
    /// The worker panicked.
    #[error("the worker panicked: {message}")]
    Panicked {
        /// Message of the panic.
        message: String,
    },
    /// Events are no longer accepted: the worker has ended.
    #[error("the worker has ended: of {offered} events, {taken} were taken")]
    Closed {
        /// Number of events in the call.
        offered: usize,
        /// Number of these events that were counted before the end.
        taken: usize,
    },
}
