//! The report for people: a line for some of the predictions while the run goes on, then tables with units.

use std::io::{self, Write};

use super::lines::Lines;
use super::report::{Reading, Report};
use super::summary::Summary;
use crate::answer::Answers;
use crate::progress::Progress;
use crate::skips::Skips;
use crate::text::{Table, duration};
use meissner_pipeline::latency::{Quantiles, microseconds};
use meissner_pipeline::text::grouped;

/// Writes for people.
pub(crate) struct People<W> {
    lines: Lines<W>,
    answers: Answers,
}

impl<W: Write> People<W> {
    /// Writes the headings for `answers`.
    pub(crate) fn new(
        mut out: W,
        answers: Answers,
        total: Option<u64>,
        progress: Progress,
    ) -> io::Result<Self> {
        let headings = answers.headings();
        writeln!(
            out,
            "{:>5}  {:>11}{headings}  {:>8}  {:>9}  {:>11}",
            "done", "time (ms)", "nodes", "rows", "update (us)"
        )?;
        out.flush()?;
        Ok(Self { lines: Lines::new(out, total, progress), answers })
    }
}

impl<W: Write> Report for People<W> {
    fn reading(&mut self, reading: &Reading<'_>) -> io::Result<()> {
        let values = self.answers.columns(reading.prediction.values);
        let line = line(reading, &values, self.lines.total());
        self.lines.line(reading.taken, line)
    }

    fn summary(&mut self, summary: &Summary) -> io::Result<()> {
        let out = self.lines.end(summary.predictions)?;
        if let Some(left_out) = self.answers.left_out() {
            writeln!(out, "{left_out}")?;
        }
        counts(out, summary)?;
        latencies(out, summary)?;
        summary.skips.write(out)?;
        out.flush()
    }
}

/// A prediction.
fn line(reading: &Reading<'_>, values: &str, total: Option<u64>) -> String {
    let prediction = &reading.prediction;
    let done = total.map_or_else(String::new, |total| format!("{} %", reading.taken * 100 / total.max(1)));
    let time = reading.elapsed_us.map_or_else(|| "-".to_owned(), |us| format!("{:.3}", us as f64 / 1e3));
    let (nodes, rows) = (grouped(prediction.nodes as u64), grouped(prediction.rows.iter().sum()));
    let update_us = microseconds(reading.update);
    format!("{done:>5}  {time:>11}{values}  {nodes:>8}  {rows:>9}  {update_us:>11.1}")
}

fn counts(out: &mut impl Write, summary: &Summary) -> io::Result<()> {
    let (events, accepted) = (grouped(summary.events), grouped(summary.accepted));
    writeln!(out, "\nevents       {events} taken, {accepted} accepted")?;
    for (reason, &count) in summary.dropped.iter().filter(|&(_, &count)| count > 0) {
        writeln!(out, "dropped      {} {}", grouped(count), reason.replace('_', " "))?;
    }
    if summary.lines_refused > 0 {
        writeln!(out, "refused      {} lines that are no events", grouped(summary.lines_refused))?;
    }
    let Skips { events_clamped, events_expired, events_evicted, .. } = summary.skips;
    if events_clamped > 0 {
        writeln!(out, "clamped      {} late events entered at the newest time", grouped(events_clamped))?;
    }
    writeln!(
        out,
        "window       at most {} events; {} left by age, {} because it was full",
        grouped(summary.nodes_max as u64),
        grouped(events_expired),
        grouped(events_evicted)
    )?;
    writeln!(out, "predictions  {}", grouped(summary.predictions))?;
    summary
        .approximations
        .as_ref()
        .map_or(Ok(()), |approximations| crate::approximations::write(approximations, out))
}

fn latencies(out: &mut impl Write, summary: &Summary) -> io::Result<()> {
    quantiles(out, &[("push", summary.latency_us.push), ("predict", summary.latency_us.predict)])?;
    if let Some(rate) = summary.events_per_s {
        let rate = grouped(rate.round() as u64);
        writeln!(out, "  {rate} events/s, counting the time in pushes and predictions only")?;
    }
    Ok(())
}

/// Writes a row for each of `latencies` that was measured.
pub(crate) fn quantiles(out: &mut impl Write, latencies: &[(&str, Option<Quantiles>)]) -> io::Result<()> {
    let mut table = Table::new(&["latency (us)", "p50", "p90", "p99", "p99.9", "max"]);
    for &(name, quantiles) in latencies {
        if let Some(Quantiles { p50, p90, p99, p999, max }) = quantiles {
            let cells = [p50, p90, p99, p999, max].map(duration);
            table.row(std::iter::once(name.to_owned()).chain(cells));
        }
    }
    writeln!(out)?;
    table.write(out)
}
