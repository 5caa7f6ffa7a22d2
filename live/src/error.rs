//! What can go wrong between the threads.

use meissner_engine::EngineError;
use thiserror::Error;

/// A live engine cannot start, has ended, or found that a result is not a number.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LiveError {
    /// A value of the queue's options is out of range.
    #[error("{what}: expected {expected}, found {found}")]
    Option {
        /// Which value.
        what: &'static str,
        /// The admissible range.
        expected: String,
        /// What came.
        found: String,
    },
    /// The newest computation of a prediction failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The worker's thread cannot be started.
    #[error("the worker's thread cannot be started")]
    Thread(#[source] std::io::Error),
    /// The worker panicked.
    #[error("the worker panicked: {message}")]
    Panicked {
        /// What it said.
        message: String,
    },
    /// Nobody takes events any more: the worker has ended.
    #[error("the worker has ended: of {offered} events, {taken} were taken")]
    Closed {
        /// Events of the call.
        offered: usize,
        /// Of these, events that were accounted for before the end.
        taken: usize,
    },
}
