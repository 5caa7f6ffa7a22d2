//! The process that takes predictions and measures their latencies.

use std::io::{Write, stdout};
use std::time::Duration;

use meissner_iceoryx2::channel::{BUFFER, Channel, Receiver};
use meissner_iceoryx2::driver::{now_ns, predictions_of};
use meissner_iceoryx2::wire::PredictionHeader;
use meissner_packets::{PacketError, failed};
use meissner_run::interrupt;
use meissner_run::latency::Latency;
use serde::Serialize;
use serde_json::json;

use crate::NAP;

/// Counts of received predictions, and their latencies in microseconds.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Summary {
    predictions: u64,
    /// Predictions that are missing by their numbers.
    missing: u64,
    /// Starts of the inference.
    origins: u64,
    /// From the due time of the oldest event that a prediction is the first to cover until the
    /// driver published it; then hop by hop until the prediction arrived here.
    due_to_published: Latency,
    published_to_received: Latency,
    received_to_predicted: Latency,
    predicted_to_controller: Latency,
    due_to_controller: Latency,
    published_to_controller: Latency,
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
            latency.record(Duration::from_nanos(to.saturating_sub(from)));
        }
    }
}

/// Takes predictions until a run (`once`) or the program ends; with `lines`, prints each.
pub(crate) fn watch(name: &str, once: bool, lines: bool) -> Result<Summary, PacketError> {
    let predictions: Receiver<f32, PredictionHeader> =
        Channel::open(&predictions_of(name))?.receiver(BUFFER)?;
    let mut summary = Summary::default();
    // The start of the inference, and the number of its next prediction.
    let mut expected = None;
    eprintln!("ready");
    while !interrupt::requested() {
        predictions.wait(NAP)?;
        while let Some(prediction) = predictions.take()? {
            let (now, header) = (now_ns(), prediction.user_header());
            let next = match expected {
                Some((origin, next)) if origin == header.origin => next,
                // Predictions that another start has sent before had no receiver.
                _ => {
                    summary.origins += 1;
                    header.sequence
                }
            };
            summary.missing += header.sequence.saturating_sub(next);
            expected = Some((header.origin, header.sequence.saturating_add(1)));
            summary.add(header, now);
            if lines {
                let &PredictionHeader { run, sequence, taken, lost, t_us, nodes, end, .. } = header;
                let line = json!({
                    "run": run, "sequence": sequence, "taken": taken, "lost": lost, "t_us": t_us,
                    "nodes": nodes, "end": end == 1, "values": prediction.payload(),
                });
                writeln!(stdout(), "{line}").map_err(failed("output"))?;
            }
            if header.end == 1 && once {
                return Ok(summary);
            }
        }
    }
    Ok(summary)
}
