//! Settings and results of verification.

use std::fmt;

use meissner_engine::Event;

use crate::difference::Difference;
use crate::step::Stream;

/// How much is verified.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Number of random streams.
    pub cases: u64,
    /// Seed of the streams.
    pub seed: u64,
    /// Events of a recording from one comparison to the next; `None` spreads 64 comparisons over it.
    pub every: Option<usize>,
}

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
#[derive(Clone, Debug)]
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

impl<I> fmt::Display for Mismatch<I> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "after input {} of a minimal stream: {}", self.input, self.difference)
    }
}

impl<I: fmt::Debug> std::error::Error for Mismatch<I> {}
