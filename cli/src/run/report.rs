//! What a report is told, whatever it makes of it.

use std::io;
use std::time::Duration;

use meissner_engine::Prediction;

use super::summary::Summary;

/// A prediction, and when it was read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading<'a> {
    /// The prediction.
    pub(crate) prediction: Prediction<'a>,
    /// Stream time since the first event in microseconds; none before it.
    pub(crate) elapsed_us: Option<i128>,
    /// Time spent in pushes and predictions since the last reading.
    pub(crate) update: Duration,
    /// Events taken so far.
    pub(crate) taken: u64,
}

/// Writes predictions as they are read, and the summary.
pub(crate) trait Report {
    /// A prediction has been read.
    fn reading(&mut self, reading: &Reading<'_>) -> io::Result<()>;

    /// The run has ended.
    fn summary(&mut self, summary: &Summary) -> io::Result<()>;
}
