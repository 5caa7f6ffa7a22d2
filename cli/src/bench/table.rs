//! The text report of a network over events.

use std::io::{self, Write};

use meissner_run::bench::{
    DeadlineReport, EventReport, FrameInputReport, InputReport, PhaseReport, PhasesReport, SlicesReport, Work,
};
use meissner_run::latency::{Distribution, Latency, Quantiles};
use meissner_run::provenance::InputCard;
use meissner_run::text::grouped;

use crate::predictions::{summary, write_model};
use crate::text::{Table, cell, duration, mebibytes};

/// Writes the report of a network over events.
pub(super) fn write(out: &mut impl Write, report: &EventReport) -> io::Result<()> {
    let input = &report.input;
    let mode = if report.threads == 1 { "incremental" } else { "incremental, two threads" };
    recording(out, input, input.header.input.events, None, mode)?;
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
    slices(out, &report.slices)?;
    deadline(out, &report.deadline)
}

/// Writes the recording of so many events, `part`, a line about the measured part, and the network.
pub(super) fn recording(
    out: &mut impl Write,
    input: &InputReport,
    events: Option<u64>,
    part: Option<&String>,
    mode: &str,
) -> io::Result<()> {
    let events = events.map_or_else(String::new, |events| format!(", {} events", grouped(events)));
    let InputCard { name, format, sensor, .. } = &input.header.input;
    let [width, height] = sensor.unwrap_or_default();
    writeln!(out, "recording    {name}")?;
    writeln!(out, "             {format}, {width}x{height} pixels{events}")?;
    if let Some(part) = part {
        writeln!(out, "             {part}")?;
    }
    write_model(out, &input.card, mode, *sensor)
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

/// The quantiles of a row; none if nothing was recorded.
fn cells(latency: &Latency) -> impl Iterator<Item = String> {
    latency.distribution().into_iter().flat_map(|distribution| {
        let Distribution { count, mean, quantiles: Quantiles { p50, p90, p99, p999, max }, .. } =
            distribution;
        let times = [mean, p50, p90, p99, p999, max].map(duration);
        std::iter::once(grouped(count)).chain(times)
    })
}

/// Writes a table of the recorded latencies.
pub(super) fn write_latencies<'a>(
    out: &mut impl Write,
    heading: &str,
    rows: impl IntoIterator<Item = (String, &'a Latency)>,
) -> io::Result<()> {
    let mut table = Table::new(&[&[heading], &QUANTILES[..]].concat());
    for (name, latency) in rows.into_iter().filter(|(_, latency)| latency.count() > 0) {
        table.row(std::iter::once(name).chain(cells(latency)));
    }
    write_apart(out, &table)
}

/// Writes a table after an empty line.
pub(super) fn write_apart(out: &mut impl Write, table: &Table) -> io::Result<()> {
    writeln!(out)?;
    table.write(out)
}

/// Writes the events from which frames were made.
pub(super) fn framed(out: &mut impl Write, input: &InputReport, made: &FrameInputReport) -> io::Result<()> {
    let [events, accepted, outside] = [input.events, input.accepted, made.outside_frames].map(grouped);
    writeln!(out, "events       {events} taken, {accepted} accepted, {outside} of them in no frame")?;
    summary::dropped(out, &input.dropped)
}

fn latencies(out: &mut impl Write, report: &EventReport) -> io::Result<()> {
    let phases = [
        ("", &report.latency_us),
        (", idle", &report.phases.idle.latency_us),
        (", burst", &report.phases.burst.latency_us),
    ];
    let rows = ["push", "predict", "push + predict"].into_iter().enumerate().flat_map(|(i, name)| {
        phases.map(|(phase, of)| (format!("{name}{phase}"), [&of.push, &of.predict, &of.push_predict][i]))
    });
    write_latencies(out, "latency (us)", rows)?;
    summary::rate(out, report.events_per_s)
}

fn phases(out: &mut impl Write, phases: &PhasesReport) -> io::Result<()> {
    let mut table = Table::new(&["phase", "events", "rows an event"]);
    for (name, PhaseReport { events, rows_per_event, .. }) in
        [("idle", &phases.idle), ("burst", &phases.burst)]
    {
        let rows = cell(*rows_per_event, |rows| format!("{rows:.2}"));
        table.row([name.to_owned(), grouped(*events), rows]);
    }
    write_apart(out, &table)?;
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
    write_apart(out, &table)?;
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
    write_apart(out, &table)?;
    writeln!(out, "  in a pass of its own, with a clock around each stage")
}

/// Writes the latency of slices.
fn slices(out: &mut impl Write, slices: &SlicesReport) -> io::Result<()> {
    let name = format!("{} events, predict", grouped(slices.events as u64));
    write_latencies(out, "slices (us)", [(name, &slices.latency_us)])?;
    summary::rate(out, slices.events_per_s)
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
        let times = deadline.real_time.map(summary::times_real_time);
        let times = times.map_or_else(String::new, |times| format!(", {times} in the mean"));
        writeln!(
            out,
            "load         {:.2} % of stream time{times}; the latest prediction came {lag_max_us:.1} us after its period's \
             end",
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
    let mut table = Table::new(&[&["events, work (us)", "missed"], &QUANTILES[..]].concat());
    for bin in &deadline.bins {
        let name = match bin.events_most - bin.events_least {
            0 => grouped(bin.events_least),
            _ => format!("{} to {}", grouped(bin.events_least), grouped(bin.events_most)),
        };
        table.row([name, grouped(bin.missed)].into_iter().chain(cells(&bin.work_us)));
    }
    if deadline.work_us.count() > 0 {
        table.row(["all".to_owned(), grouped(missed)].into_iter().chain(cells(&deadline.work_us)));
    }
    write_apart(out, &table)
}
