//! The lines of a text report about approximations.

use std::io::{self, Write};

use meissner_pipeline::approximations::{ApproximationReport, FilteredEvents};
use meissner_pipeline::text::grouped;

/// Writes a line for each approximation of `report`.
pub(crate) fn write(report: &ApproximationReport, out: &mut impl Write) -> io::Result<()> {
    let mut lines = Vec::new();
    for FilteredEvents { name, passed, dropped } in &report.filters {
        let all = passed + dropped;
        let (name, dropped, all) = (name.replace('_', " "), grouped(*dropped), grouped(all));
        lines.push(format!("{name} dropped {dropped} of {all} events"));
    }
    if let Some(neighbours) = report.neighbours {
        lines.push(format!("at most {neighbours} neighbours an event"));
    }
    if let Some((tolerance, rows)) = report.tolerance.zip(report.rows_within_tolerance) {
        lines.push(format!("{} recomputed rows within {tolerance} kept their values", grouped(rows)));
    }
    if let Some(stale) = report.stale_predictions {
        lines.push(format!("{} predictions stood and were not computed", grouped(stale)));
    }
    lines.iter().try_for_each(|line| writeln!(out, "approximate  {line}"))
}
