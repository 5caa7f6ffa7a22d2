//! The text report of a network over events.

use std::io::{self, Write};

use meissner_pipeline::bench::{DeadlineReport, EventReport, InputReport, PhaseReport, PhasesReport, Work};
use meissner_pipeline::latency::{Distribution, Quantiles};
use meissner_pipeline::text::grouped;

use crate::header::write_model;
use crate::report::summary;
use crate::text::{Table, duration};

/// Writes the report of a network over events.
pub(super) fn write(out: &mut impl Write, report: &EventReport) -> io::Result<()> {
    let input = &report.input;
    recording(out, input, input.recorded, None, "incremental")?;
    writeln!(out)?;
    if input.part.is_some() {
        writeln!(out, "part         {}", input.part)?;
    }
    counts(out, report)?;
    latencies(out, report)?;
    phases(out, &report.phases)?;
    summary::skips(out, &report.skips)?;
    work(out, &report.work)?;
    stages(out, report)?;
    memory(out, report)?;
    deadline(out, &report.deadline)
}

/// Writes the recording and the network. `events` is the number of events in the recording; `part` is a line about the
/// measured part.
pub(super) fn recording(
    out: &mut impl Write,
    input: &InputReport,
    events: Option<u64>,
    part: Option<&String>,
    mode: &str,
) -> io::Result<()> {
    let events = events.map_or_else(String::new, |events| format!(", {} events", grouped(events)));
    writeln!(out, "recording    {}", input.recording)?;
    writeln!(out, "             {}, {} pixels{events}", input.format, input.sensor)?;
    if let Some(part) = part {
        writeln!(out, "             {part}")?;
    }
    write_model(out, &input.card, mode, Some([input.sensor.width, input.sensor.height]))
}

/// Resident memory of the process, for the end of a line.
pub(super) fn peak(bytes: Option<u64>) -> String {
    let text = |bytes| format!("; the process at most {} resident, with the recording", mebibytes(bytes));
    bytes.map_or_else(String::new, text)
}

/// "pass" or "passes".
pub(super) fn passes(count: u32) -> String {
    format!("{count} {}", if count == 1 { "pass" } else { "passes" })
}

fn counts(out: &mut impl Write, report: &EventReport) -> io::Result<()> {
    let input = &report.input;
    let (events, accepted) = (grouped(input.events), grouped(input.accepted));
    writeln!(out, "events       {events} taken, {accepted} accepted")?;
    summary::dropped(out, &input.dropped)?;
    summary::refused(out, input.lines_refused)?;
    let (predictions, nodes_max) = (grouped(report.predictions), grouped(report.nodes_max as u64));
    writeln!(out, "predictions  {predictions}, windows of at most {nodes_max} events")?;
    if let Some(approximations) = &report.approximations {
        summary::approximations(out, approximations)?;
    }
    writeln!(
        out,
        "measured     {} after a warm-up of {} events, {} kernels, clock {:.3} us a measurement, not subtracted",
        passes(input.passes),
        grouped(report.warmup_events),
        input.isa,
        report.clock_us
    )
}

const QUANTILES: [&str; 7] = ["count", "mean", "p50", "p90", "p99", "p99.9", "max"];

/// The quantiles of a row.
pub(super) fn cells(distribution: &Distribution) -> impl Iterator<Item = String> {
    let Distribution { count, mean, quantiles: Quantiles { p50, p90, p99, p999, max }, .. } = *distribution;
    let times = [mean, p50, p90, p99, p999, max].map(duration);
    std::iter::once(grouped(count)).chain(times)
}

/// `first`, followed by the names of [`cells`].
pub(super) fn headings<'a>(first: &'a [&'a str]) -> Vec<&'a str> {
    first.iter().copied().chain(QUANTILES).collect()
}

fn latencies(out: &mut impl Write, report: &EventReport) -> io::Result<()> {
    let (all, PhasesReport { idle, burst, .. }) = (&report.latency_us, &report.phases);
    let (idle, burst) = (&idle.latency_us, &burst.latency_us);
    let mut table = Table::new(&headings(&["latency (us)"]));
    for (name, distributions) in [
        ("push", [&all.push, &idle.push, &burst.push]),
        ("predict", [&all.predict, &idle.predict, &burst.predict]),
        ("push + predict", [&all.push_predict, &idle.push_predict, &burst.push_predict]),
    ] {
        for (phase, distribution) in ["", ", idle", ", burst"].iter().zip(distributions) {
            if let Some(distribution) = distribution {
                table.row(std::iter::once(format!("{name}{phase}")).chain(cells(distribution)));
            }
        }
    }
    writeln!(out)?;
    table.write(out)?;
    summary::rate(out, report.events_per_s)
}

fn phases(out: &mut impl Write, phases: &PhasesReport) -> io::Result<()> {
    let mut table = Table::new(&["phase", "events", "rows an event"]);
    for (name, PhaseReport { events, rows_per_event, .. }) in
        [("idle", &phases.idle), ("burst", &phases.burst)]
    {
        let rows = rows_per_event.map_or_else(|| "-".to_owned(), |rows| format!("{rows:.2}"));
        table.row([name.to_owned(), grouped(*events), rows]);
    }
    writeln!(out)?;
    table.write(out)?;
    let rate = |rate: Option<f64>| rate.map_or_else(|| "no".to_owned(), |rate| grouped(rate.round() as u64));
    writeln!(
        out,
        "  a burst is from {} events/s on, over the {} ms before an event; mean rate {} events/s",
        rate(phases.burst_rate_events_per_s),
        phases.window_us / 1000,
        rate(phases.mean_rate_events_per_s)
    )
}

fn work(out: &mut impl Write, work: &Work) -> io::Result<()> {
    let mut table =
        Table::new(&["layer (work)", "rows an event", "multiply-adds a row", "multiply-adds an event"]);
    for layer in &work.layers {
        let rows = format!("{:.2}", layer.rows_per_event);
        let of_event = grouped(layer.multiply_adds_per_event.round() as u64);
        table.row([layer.name.clone(), rows, grouped(layer.multiply_adds_per_row), of_event]);
    }
    let all = grouped(work.multiply_adds_per_event.round() as u64);
    table.row(["all".to_owned(), format!("{:.2}", work.rows_per_event), String::new(), all]);
    writeln!(out)?;
    table.write(out)?;
    if let Some(rate) = work.multiply_adds_per_s {
        writeln!(
            out,
            "  {:.3} G multiply-adds/s in the stages of the layers, counting full neighbourhoods",
            rate / 1e9
        )?;
    }
    Ok(())
}

fn stages(out: &mut impl Write, report: &EventReport) -> io::Result<()> {
    let mut table = Table::new(&["stage", "us an event", "share (%)"]);
    for stage in &report.stages {
        table.row([
            stage.name.to_owned(),
            format!("{:.3}", stage.us_per_event),
            format!("{:.2}", stage.share * 100.0),
        ]);
    }
    writeln!(out)?;
    table.write(out)?;
    writeln!(out, "  in a pass of its own, with a clock around each stage")
}

/// `bytes` in units of 2^20.
pub(super) fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

fn memory(out: &mut impl Write, report: &EventReport) -> io::Result<()> {
    let peak = peak(report.memory.peak_resident_bytes);
    writeln!(out, "\nmemory       {} of state{peak}", mebibytes(report.memory.state_bytes))
}

/// Writes the deadline report.
pub(super) fn deadline(out: &mut impl Write, deadline: &DeadlineReport) -> io::Result<()> {
    let &DeadlineReport { period_us, periods, missed, excess_max_us, lag_max_us, .. } = deadline;
    let without = match deadline.periods_without_work {
        0 => String::new(),
        count => format!(", {} of them with neither events nor a window", grouped(count)),
    };
    writeln!(
        out,
        "\ndeadline     {} periods of {} us{without}",
        grouped(periods),
        grouped(period_us.unsigned_abs())
    )?;
    let share = if periods > 0 { missed as f64 / periods as f64 * 100.0 } else { 0.0 };
    match deadline.excess_mean_us {
        None => writeln!(out, "missed       none")?,
        Some(mean) => writeln!(
            out,
            "missed       {} ({share:.3} %), by {mean:.1} us in the mean, {excess_max_us:.1} us at most",
            grouped(missed)
        )?,
    }
    if let Some(load) = deadline.load {
        writeln!(
            out,
            "load         {:.2} % of stream time; the latest prediction came {lag_max_us:.1} us after its period's end",
            load * 100.0
        )?;
    }
    match deadline.sustained {
        Some(sustained) => {
            let rate = grouped(sustained.events_per_s.round() as u64);
            let all = if deadline.sustained_is_all_seen { ", the most that the recording has" } else { "" };
            let events = grouped(sustained.events_per_period);
            writeln!(
                out,
                "sustained    up to {events} events a period ({rate} events/s){all}: p99.9 below the period, \
                 over at least 1,000 periods with as many or fewer"
            )?;
        }
        None if deadline.bins.is_empty() => {}
        None => {
            writeln!(out, "sustained    no rate: the p99.9 exceeds the period even with the fewest events")?;
        }
    }
    let mut table = Table::new(&headings(&["events, work (us)", "missed"]));
    for bin in &deadline.bins {
        let name = match bin.events_most - bin.events_least {
            0 => grouped(bin.events_least),
            _ => format!("{} to {}", grouped(bin.events_least), grouped(bin.events_most)),
        };
        table.row([name, grouped(bin.missed)].into_iter().chain(cells(&bin.work_us)));
    }
    if let Some(work) = &deadline.work_us {
        table.row(["all".to_owned(), grouped(missed)].into_iter().chain(cells(work)));
    }
    writeln!(out)?;
    table.write(out)
}
