//! Errors of verification.

use meissner_engine::{EngineError, Event};
use meissner_pipeline::PipelineError;
use meissner_reference::ReferenceError;

use crate::mismatch::Mismatch;

/// Results differ, or nothing could be verified.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VerifyError {
    /// The engine over events differs from the batch.
    #[error(transparent)]
    Mismatch(Box<Mismatch<Event>>),
    /// The frame engine differs from one that computes everything.
    #[error(transparent)]
    FrameMismatch(Box<Mismatch<Vec<f32>>>),
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
    Pipeline(Box<PipelineError>),
    /// A network cannot be computed in f64.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
}

impl From<PipelineError> for VerifyError {
    fn from(error: PipelineError) -> Self {
        Self::Pipeline(Box::new(error))
    }
}
