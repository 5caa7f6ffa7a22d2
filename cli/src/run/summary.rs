//! What a run amounts to: counts, latencies, and what was skipped, in the names of the JSON summary.

use std::collections::BTreeMap;

use meissner_engine::Counters;
use serde::Serialize;

use super::latency::{Latency, Quantiles};

/// The whole run.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    /// Events taken from the recording.
    pub(crate) events: u64,
    /// Of these, events that entered the window.
    pub(crate) accepted: u64,
    /// The others, by reason.
    pub(crate) dropped: BTreeMap<&'static str, u64>,
    /// Predictions read.
    pub(crate) predictions: u64,
    /// Most events in the window after any push.
    pub(crate) nodes_max: usize,
    /// Time of a push, in microseconds; none where there was none.
    pub(crate) push_us: Option<Quantiles>,
    /// Time of a prediction, in microseconds, with moving time on to it where it is due between events.
    pub(crate) predict_us: Option<Quantiles>,
    /// Events taken, per second spent in pushes and predictions.
    pub(crate) events_per_s: Option<f64>,
    /// What was done and what was not needed.
    pub(crate) skips: Skips,
}

/// The engine's counters.
#[derive(Debug, Serialize)]
pub(crate) struct Skips {
    /// Rows computed, over all layers.
    pub(crate) rows_recomputed: u64,
    /// Of these, rows that came out as they were: the wave stopped there.
    pub(crate) rows_unchanged: u64,
    /// Rows that predictions used without computing them again.
    pub(crate) rows_kept: u64,
    /// Predictions for which nothing that they read had changed.
    pub(crate) predictions_reused: u64,
    /// Readout cells computed.
    pub(crate) readout_cells_recomputed: u64,
    /// Of these, cells whose maxima did not move.
    pub(crate) readout_cells_unchanged: u64,
    /// Pooled neighbourhoods looked at.
    pub(crate) neighbourhoods_checked: u64,
    /// Of these, neighbourhoods that came out the same.
    pub(crate) neighbourhoods_unchanged: u64,
    /// Late events that entered at the newest time.
    pub(crate) events_clamped: u64,
    /// Events that left because they were older than the span.
    pub(crate) events_expired: u64,
    /// Events that left before that, because the window was full.
    pub(crate) events_evicted: u64,
    /// Each layer.
    pub(crate) layers: Vec<LayerSkips>,
}

/// What one layer did.
#[derive(Debug, Serialize)]
pub(crate) struct LayerSkips {
    /// Its name.
    pub(crate) name: String,
    /// Rows computed.
    pub(crate) recomputed: u64,
    /// Of these, rows that came out as they were.
    pub(crate) unchanged: u64,
    /// Rows that predictions used without computing them again.
    pub(crate) kept: u64,
}

impl Summary {
    pub(crate) fn new(
        counters: &Counters,
        layers: &[&str],
        nodes_max: usize,
        push: &Latency,
        predict: &Latency,
    ) -> Self {
        let seconds = (push.total() + predict.total()).as_secs_f64();
        let events = counters.events.pushed;
        Self {
            events,
            accepted: counters.events.accepted,
            dropped: counters
                .events
                .dropped()
                .iter()
                .map(|&(reason, count)| (reason.name(), count))
                .collect(),
            predictions: counters.predictions.read,
            nodes_max,
            push_us: push.quantiles(),
            predict_us: predict.quantiles(),
            events_per_s: (events > 0 && seconds > 0.0).then(|| events as f64 / seconds),
            skips: Skips::new(counters, layers),
        }
    }
}

impl Skips {
    fn new(counters: &Counters, layers: &[&str]) -> Self {
        let layers: Vec<LayerSkips> = layers
            .iter()
            .zip(&counters.layers)
            .map(|(&name, layer)| LayerSkips {
                name: name.to_owned(),
                recomputed: layer.recomputed,
                unchanged: layer.unchanged,
                kept: layer.kept,
            })
            .collect();
        let (events, predictions) = (&counters.events, &counters.predictions);
        Self {
            rows_recomputed: layers.iter().map(|layer| layer.recomputed).sum(),
            rows_unchanged: layers.iter().map(|layer| layer.unchanged).sum(),
            rows_kept: layers.iter().map(|layer| layer.kept).sum(),
            predictions_reused: predictions.reused,
            readout_cells_recomputed: predictions.cells_recomputed,
            readout_cells_unchanged: predictions.cells_unchanged,
            neighbourhoods_checked: predictions.neighbourhoods_checked,
            neighbourhoods_unchanged: predictions.neighbourhoods_unchanged,
            events_clamped: events.clamped,
            events_expired: events.expired,
            events_evicted: events.evicted,
            layers,
        }
    }
}
