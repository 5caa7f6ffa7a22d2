//! The counters of an engine over events, with the names of the JSON reports.

use std::collections::BTreeMap;

use meissner_engine::{Counters, EventCounters};
use serde::Serialize;

/// The counters of an engine over events.
#[derive(Debug, Default, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct WorkCounts {
    /// Rows computed, over all layers.
    pub rows_recomputed: u64,
    /// Of these, rows whose values did not change.
    pub rows_unchanged: u64,
    /// Of these, rows that changed by at most the tolerance, and kept their values.
    pub rows_within_tolerance: u64,
    /// Rows that predictions used without computing them again.
    pub rows_kept: u64,
    /// Predictions whose inputs had not changed.
    pub predictions_reused: u64,
    /// Readout cells computed.
    pub readout_cells_recomputed: u64,
    /// Of these, cells whose maxima did not change.
    pub readout_cells_unchanged: u64,
    /// Pooled neighbourhoods checked.
    pub neighbourhoods_checked: u64,
    /// Of these, neighbourhoods that did not change.
    pub neighbourhoods_unchanged: u64,
    /// Late events that entered at the newest time.
    pub events_clamped: u64,
    /// Events that left because they were older than the span.
    pub events_expired: u64,
    /// Events that left earlier because the window was full.
    pub events_evicted: u64,
    pub layers: Vec<LayerSkips>,
}

/// The counters of one layer.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct LayerSkips {
    pub name: String,
    pub recomputed: u64,
    pub unchanged: u64,
    pub within_tolerance: u64,
    pub kept: u64,
}

impl WorkCounts {
    /// The counters of a network with these `layers`.
    pub fn new(counters: &Counters, layers: &[impl AsRef<str>]) -> Self {
        let layers: Vec<LayerSkips> = layers
            .iter()
            .zip(&counters.layers)
            .map(|(name, layer)| LayerSkips {
                name: name.as_ref().to_owned(),
                recomputed: layer.recomputed,
                unchanged: layer.unchanged,
                within_tolerance: layer.within_tolerance,
                kept: layer.kept,
            })
            .collect();
        let (events, predictions) = (&counters.events, &counters.predictions);
        Self {
            rows_recomputed: layers.iter().map(|layer| layer.recomputed).sum(),
            rows_unchanged: layers.iter().map(|layer| layer.unchanged).sum(),
            rows_within_tolerance: layers.iter().map(|layer| layer.within_tolerance).sum(),
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

/// Dropped events by reason.
pub fn dropped(events: &EventCounters) -> BTreeMap<&'static str, u64> {
    events.dropped().iter().map(|&(reason, count)| (reason.name(), count)).collect()
}
