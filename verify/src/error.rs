//! Results of verification: counts, differences, and errors.

use std::fmt;

use meissner_engine::{EngineError, Event, Outcome, WindowStatistics};
use meissner_kernels::Neighbour;
use meissner_reference::ReferenceError;
use meissner_run::RunError;

use crate::stream::Stream;

/// Counts of everything that was verified without a difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Summary {
    /// Streams.
    pub cases: u64,
    /// Inputs: events or frames.
    pub inputs: u64,
    /// Comparisons.
    pub comparisons: u64,
    /// Compared rows of all layers; for frame networks, compared values of predictions.
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

/// The first difference: `found` is from the engine, `expected` from the full recomputation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the fields are named by what they hold")]
#[non_exhaustive]
pub enum Difference {
    /// An input was accepted on one side only, or dropped for different reasons.
    #[error("outcome of the last input: found {found:?}, expected {expected:?}")]
    Outcome { found: Outcome, expected: Outcome },
    /// Windows of different length.
    #[error("events in the window: found {found}, expected {expected}")]
    Nodes { found: usize, expected: usize },
    /// A neighbourhood of the event graph.
    #[error(
        "event graph, neighbourhood of event {event} of the window: found {found:?}, expected {expected:?}"
    )]
    Neighbourhood {
        /// Index of the event in the window.
        event: usize,
        found: Vec<Neighbour>,
        expected: Vec<Neighbour>,
    },
    /// A layer with another number of rows or channels; the numbers are of values in all rows.
    #[error("layer {layer}: found {found} values, expected {expected}")]
    Size { layer: String, found: usize, expected: usize },
    /// A value of a layer.
    #[error(
        "layer {layer}, row {row}, channel {channel}: found {}, expected {}", Bits(*.found), Bits(*.expected)
    )]
    Row { layer: String, row: usize, channel: usize, found: f32, expected: f32 },
    /// A value of the prediction.
    #[error("prediction, value {index}: found {}, expected {}", Bits(*.found), Bits(*.expected))]
    Prediction { index: usize, found: f32, expected: f32 },
    /// Statistics of the window.
    #[error("window: found {found:?}, expected {expected:?}")]
    Window { found: Box<WindowStatistics>, expected: Box<WindowStatistics> },
    /// One side refuses to predict, or both refuse for different reasons.
    #[error("found {found}, expected {expected}")]
    Refusal { found: String, expected: String },
}

/// A value with its bits, because two values that print alike may have different bits.
struct Bits(f32);

impl fmt::Display for Bits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({:#010x})", self.0, self.0.to_bits())
    }
}

/// Bit patterns.
pub fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// The first index at which the bits of the values differ, and both values.
pub(crate) fn first_difference(found: &[f32], expected: &[f32]) -> Option<(usize, f32, f32)> {
    let mut pairs = found.iter().zip(expected).enumerate();
    pairs.find(|(_, (a, b))| a.to_bits() != b.to_bits()).map(|(i, (&a, &b))| (i, a, b))
}

impl Difference {
    /// The error `error` of a call that must succeed.
    pub(crate) fn failed(call: &str, error: &EngineError) -> Self {
        Self::Refusal { found: format!("{call}: {error}"), expected: "success".to_owned() }
    }

    /// Compares predictions or their errors. `Ok(false)` if both sides refuse for the same reason.
    pub(crate) fn of_predictions(
        found: &Result<Vec<f32>, EngineError>,
        expected: &Result<Vec<f32>, EngineError>,
    ) -> Result<bool, Self> {
        let text = |side: &Result<Vec<f32>, EngineError>| match side {
            Ok(values) => format!("a prediction of {} values", values.len()),
            Err(error) => error.to_string(),
        };
        match (found, expected) {
            (Ok(found), Ok(expected)) if found.len() == expected.len() => first_difference(found, expected)
                .map_or(Ok(true), |(index, found, expected)| {
                    Err(Self::Prediction { index, found, expected })
                }),
            (Err(found), Err(expected)) if found == expected => Ok(false),
            _ => Err(Self::Refusal { found: text(found), expected: text(expected) }),
        }
    }
}
