//! The table of what the engine computed and what it skipped.

use std::io::{self, Write};

use meissner_pipeline::skips::Skips;
use meissner_pipeline::text::grouped;

use crate::text::Table;

/// Writes a row for each layer, and the other counters.
pub(crate) fn write(skips: &Skips, out: &mut impl Write) -> io::Result<()> {
    let mut table =
        Table::new(&["layer (rows)", "recomputed", "of these unchanged", "kept from before", "kept (%)"]);
    let mut row = |name: &str, recomputed: u64, unchanged: u64, kept: u64| {
        let all = recomputed + kept;
        let share = if all > 0 { format!("{:.2}", kept as f64 / all as f64 * 100.0) } else { "-".to_owned() };
        table.row([name.to_owned(), grouped(recomputed), grouped(unchanged), grouped(kept), share]);
    };
    for layer in &skips.layers {
        row(&layer.name, layer.recomputed, layer.unchanged, layer.kept);
    }
    row("all", skips.rows_recomputed, skips.rows_unchanged, skips.rows_kept);
    writeln!(out)?;
    table.write(out)?;
    writeln!(
        out,
        "\n  {} predictions reused; {} of {} readout cells and {} of {} pooled neighbourhoods came out unchanged",
        grouped(skips.predictions_reused),
        grouped(skips.readout_cells_unchanged),
        grouped(skips.readout_cells_recomputed),
        grouped(skips.neighbourhoods_unchanged),
        grouped(skips.neighbourhoods_checked)
    )
}
