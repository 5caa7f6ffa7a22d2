//! How an engine differs from the full recomputation.

use std::fmt;

use meissner_engine::{EngineError, Outcome};
use meissner_kernels::Neighbour;

/// The first difference that was found: `found` is the engine's, `expected` that of the admission rules or of the full
/// recomputation.
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
        /// The event, by its place in the window.
        event: usize,
        found: Vec<Neighbour>,
        expected: Vec<Neighbour>,
    },
    /// A layer with another number of rows or channels, as values in all rows.
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
    /// One side refuses to predict, or both for different reasons.
    #[error("found {found}, expected {expected}")]
    Refusal { found: String, expected: String },
}

/// A value with its bits, in which two values that print alike may differ.
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

/// The first place at which values have different bits, and both values.
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
