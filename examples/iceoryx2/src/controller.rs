//! The process that takes predictions, and measures how long they took.

use std::time::Duration;

use meissner_run::interrupt;
use meissner_run::latency::Latency;
use serde::Serialize;

use crate::Error;
use crate::channel::{BUFFER, Channel, Receiver};
use crate::driver::{between, now_ns};
use crate::node::predictions_of;
use crate::wire::PredictionHeader;

/// Longest wait until an end is noticed.
const NAP: Duration = Duration::from_millis(100);

/// What was received, and how long it took, in microseconds.
#[derive(Debug, Default, Serialize)]
pub struct Summary {
    /// Predictions.
    pub predictions: u64,
    /// Predictions that are missing by their numbers.
    pub missing: u64,
    /// Starts of the inference.
    pub origins: u64,
    /// From when the oldest event that a prediction is the first to cover was due until the driver
    /// published it.
    pub due_to_published: Latency,
    /// From there until the inference had received it.
    pub published_to_received: Latency,
    /// From there until the prediction was ready.
    pub received_to_predicted: Latency,
    /// From there until it was here.
    pub predicted_to_controller: Latency,
    /// From when the event was due until the prediction was here.
    pub due_to_controller: Latency,
    /// From when the event was published until the prediction was here.
    pub published_to_controller: Latency,
}

impl Summary {
    fn add(&mut self, header: &PredictionHeader, now: u64) {
        let &PredictionHeader { due_ns, published_ns, received_ns, predicted_ns, .. } = header;
        self.predictions += 1;
        for (latency, from, to) in [
            (&mut self.due_to_published, due_ns, published_ns),
            (&mut self.published_to_received, published_ns, received_ns),
            (&mut self.received_to_predicted, received_ns, predicted_ns),
            (&mut self.predicted_to_controller, predicted_ns, now),
            (&mut self.due_to_controller, due_ns, now),
            (&mut self.published_to_controller, published_ns, now),
        ] {
            latency.record(between(from, to));
        }
    }
}

/// Takes predictions of this name, and shows each, until a run ends (`once`), or until the program
/// is asked to end.
///
/// # Errors
/// The service cannot be opened or breaks, or a prediction cannot be shown.
pub fn watch(
    name: &str,
    once: bool,
    ready: impl FnOnce(),
    mut show: impl FnMut(&PredictionHeader, &[f32]) -> std::io::Result<()>,
) -> Result<Summary, Error> {
    let predictions: Receiver<f32, PredictionHeader> =
        Channel::open(&predictions_of(name))?.receiver(BUFFER)?;
    let mut summary = Summary::default();
    // The start of the inference, and the number of its next prediction.
    let mut expected = None;
    ready();
    while !interrupt::requested() {
        predictions.wait(NAP)?;
        while let Some(prediction) = predictions.take()? {
            let (now, header) = (now_ns(), prediction.user_header());
            let next = match expected {
                Some((origin, next)) if origin == header.origin => next,
                // What another start has sent before was for nobody.
                _ => {
                    summary.origins += 1;
                    header.sequence
                }
            };
            summary.missing += header.sequence.saturating_sub(next);
            expected = Some((header.origin, header.sequence.saturating_add(1)));
            summary.add(header, now);
            show(header, prediction.payload()).map_err(Error::Output)?;
            if header.end == 1 && once {
                return Ok(summary);
            }
        }
    }
    Ok(summary)
}
