//! Results and errors of verification.

use meissner_engine::{EngineError, Event};
use meissner_reference::ReferenceError;
use meissner_run::RunError;

use crate::difference::Difference;
use crate::step::Stream;

/// Counts of everything that was verified without a difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Summary {
    /// Streams.
    pub cases: u64,
    /// Inputs: events or frames.
    pub inputs: u64,
    /// Comparisons.
    pub comparisons: u64,
    /// Rows that were compared, of all layers; of frame networks, values of predictions.
    pub rows: u64,
    /// Comparisons at which both sides refused to predict, because the same layer computed NaN.
    pub refused: u64,
}

/// A difference, and a minimal stream that shows it.
#[derive(Clone, Debug, thiserror::Error)]
#[error("after input {input} of a minimal stream: {difference}")]
pub struct Mismatch<I = Event> {
    /// The difference that the minimal stream shows.
    pub difference: Difference,
    /// Inputs of the minimal stream up to the difference.
    pub input: usize,
    /// The minimal stream.
    pub stream: Stream<I>,
    /// Steps of the stream before it was shrunk.
    pub found_in: usize,
}

/// Results differ, or nothing could be verified.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VerifyError {
    /// The engine over events differs from the batch.
    #[error(transparent)]
    Mismatch(#[from] Box<Mismatch<Event>>),
    /// The frame engine differs from one that computes everything.
    #[error(transparent)]
    FrameMismatch(#[from] Box<Mismatch<Vec<f32>>>),
    /// A line of a stream to replay cannot be read.
    #[error("line {line}: expected {expected}, found {found:?}")]
    Line {
        /// The line, from 1 on; 0 for the whole text.
        line: usize,
        /// The expected content.
        expected: &'static str,
        /// The start of the line.
        found: String,
    },
    /// A recording without events cannot be soaked.
    #[error("{0}: expected a recording with events, found none")]
    Empty(String),
    /// The engine refuses the network or the sensor, or a layer computed NaN.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A shipped network cannot be built.
    #[error(transparent)]
    Run(Box<RunError>),
    /// A network cannot be computed in f64.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
}

impl From<RunError> for VerifyError {
    fn from(error: RunError) -> Self {
        Self::Run(Box::new(error))
    }
}
