//! What is still done where a stream ends, however it does.
//!
//! | the stream ends with | state | what is due at the end | summary | exit status |
//! |---|---|---|---|---|
//! | its last event, the limit | written | predicted | written | 0 |
//! | a signal | written | predicted | written | 130 |
//! | input that cannot be read on, a refused line | written | predicted | written | 1 |
//! | lines most of which are refused | left as it was | predicted | written | 1 |
//! | an engine's error | left as it was | nothing | written | 1 |
//! | standard output that cannot be written | written | nothing | nothing | 1, or 0 where its reader went away |

use crate::error::CliError;
use meissner_pipeline::PipelineError;

/// How a stream has ended: the first error, where there is any.
#[derive(Debug)]
pub(super) struct Ending(Result<(), CliError>);

impl Ending {
    pub(super) fn new(ended: Result<(), CliError>) -> Self {
        Self(ended)
    }

    /// Whether the state is worth to be kept.
    pub(super) fn saves(&self) -> bool {
        !matches!(self.pipeline(), Some(PipelineError::Engine(_) | PipelineError::Lines { .. }))
    }

    /// Whether predictions can still be read and shown.
    pub(super) fn predicts(&self) -> bool {
        !matches!(self.pipeline(), Some(PipelineError::Engine(_)))
            && !matches!(self.0, Err(CliError::Output(_)))
    }

    fn pipeline(&self) -> Option<&PipelineError> {
        self.0.as_ref().err().and_then(CliError::pipeline)
    }

    /// Notes how one more thing went.
    pub(super) fn then(&mut self, next: Result<(), CliError>) {
        if self.0.is_ok() {
            self.0 = next;
        }
    }

    /// Writes the summary, where there is anywhere to write it to.
    pub(super) fn sum_up(
        mut self,
        summary: impl FnOnce() -> Result<(), std::io::Error>,
    ) -> Result<(), CliError> {
        if !matches!(self.0, Err(CliError::Output(_))) {
            self.then(summary().map_err(CliError::from));
        }
        self.0
    }
}
