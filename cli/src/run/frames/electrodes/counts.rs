//! What was read from electrodes, and what of it was suspicious.

use std::io::{self, Write};

use serde::Serialize;

use meissner_pipeline::text::grouped;

#[derive(Debug, Serialize)]
pub(in crate::run::frames) struct ElectrodeCounts {
    /// Rows that were readings.
    pub(super) readings: u64,
    /// Lines that were none; the window began anew behind each.
    pub(super) lines_refused: u64,
    pub(super) values_out_of_range: u64,
    /// Readings too early or too late after the one before.
    pub(super) rows_off_rate: u64,
    /// Readings so late after the one before that the window began anew.
    pub(super) gaps: u64,
    /// Readings earlier than the one before; the window began anew with each.
    pub(super) times_backwards: u64,
    pub(super) times_repeated: u64,
    /// Readings of a window.
    pub(super) steps: usize,
    /// How often a decision was made or changed; none where the values are not of classes.
    pub(super) decisions: Option<u64>,
}

impl ElectrodeCounts {
    pub(in crate::run::frames) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "readings     {}, in windows of {}", grouped(self.readings), self.steps)?;
        let warnings = [
            (self.lines_refused, "lines are no readings; the window begins anew behind each"),
            (self.values_out_of_range, "values beyond the sensor's range of 0 to 4095"),
            (self.rows_off_rate, "readings off their time at 100 Hz by more than 20 %"),
            (self.gaps, "gaps of more than 50 ms between readings; the window begins anew behind each"),
            (self.times_backwards, "readings earlier than the one before; the window begins anew with each"),
            (self.times_repeated, "readings with the time of the one before"),
        ];
        for (count, warning) in warnings.into_iter().filter(|&(count, _)| count > 0) {
            writeln!(out, "warning      {} {warning}", grouped(count))?;
        }
        let Some(decisions) = self.decisions else { return Ok(()) };
        writeln!(out, "decisions    {} made or changed", grouped(decisions))
    }
}
