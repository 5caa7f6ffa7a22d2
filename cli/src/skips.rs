//! What the engine did and did not need to do: for the JSON reports, and as a table for people.

use std::collections::BTreeMap;
use std::io::{self, Write};

use meissner_engine::{Counters, EventCounters};
use serde::Serialize;

use crate::text::Table;
use meissner_pipeline::text::grouped;

/// The engine's counters.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Skips {
    /// Rows computed, over all layers.
    pub(crate) rows_recomputed: u64,
    /// Of these, rows that came out as they were: the wave stopped there.
    pub(crate) rows_unchanged: u64,
    /// Of these, rows that came out within the tolerance of what they were, and kept that.
    pub(crate) rows_within_tolerance: u64,
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
    /// Of these, rows that came out within the tolerance of what they were, and kept that.
    pub(crate) within_tolerance: u64,
    /// Rows that predictions used without computing them again.
    pub(crate) kept: u64,
}

impl Skips {
    pub(crate) fn new(counters: &Counters, layers: &[&str]) -> Self {
        let layers: Vec<LayerSkips> = layers
            .iter()
            .zip(&counters.layers)
            .map(|(&name, layer)| LayerSkips {
                name: name.to_owned(),
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

    /// Writes a row for each layer, and what was skipped beside.
    pub(crate) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let mut table =
            Table::new(&["layer (rows)", "recomputed", "of these unchanged", "kept from before", "kept (%)"]);
        let mut row = |name: &str, recomputed: u64, unchanged: u64, kept: u64| {
            let all = recomputed + kept;
            let share =
                if all > 0 { format!("{:.2}", kept as f64 / all as f64 * 100.0) } else { "-".to_owned() };
            table.row([name.to_owned(), grouped(recomputed), grouped(unchanged), grouped(kept), share]);
        };
        for layer in &self.layers {
            row(&layer.name, layer.recomputed, layer.unchanged, layer.kept);
        }
        row("all", self.rows_recomputed, self.rows_unchanged, self.rows_kept);
        writeln!(out)?;
        table.write(out)?;
        writeln!(
            out,
            "\n  {} predictions reused; {} of {} readout cells and {} of {} pooled neighbourhoods came out unchanged",
            grouped(self.predictions_reused),
            grouped(self.readout_cells_unchanged),
            grouped(self.readout_cells_recomputed),
            grouped(self.neighbourhoods_unchanged),
            grouped(self.neighbourhoods_checked)
        )
    }
}

/// Dropped events by reason.
pub(crate) fn dropped(counters: &Counters) -> BTreeMap<&'static str, u64> {
    dropped_of(&counters.events)
}

/// The same of events alone.
pub(crate) fn dropped_of(events: &EventCounters) -> BTreeMap<&'static str, u64> {
    events.dropped().iter().map(|&(reason, count)| (reason.name(), count)).collect()
}
