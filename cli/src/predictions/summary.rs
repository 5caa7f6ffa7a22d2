//! Summaries as text: counts, and tables with units.

use std::collections::BTreeMap;
use std::io::{self, Write};

use meissner_run::approximations::{ApproximationReport, FilteredEvents};
use meissner_run::error::{RunError, chain};
use meissner_run::latency::{Latencies, Quantiles};
use meissner_run::play::PlaySummary;
use meissner_run::run::{
    ElectrodeCounts, EventCounts, EventSummary, FrameSummary, InputCounts, Pixels, VideoCounts,
};
use meissner_run::text::grouped;
use meissner_run::work_counts::WorkCounts;

use super::rows::OUTSIDE;
use crate::text::{NONE, Table, duration, mebibytes};

/// Reasons for which the queue drops events. All other reasons are those of the engine.
const QUEUE_REASONS: [&str; 4] = ["oldest", "newest", "thinned", "filtered"];

/// Writes the summary of a network over events.
pub(super) fn events(out: &mut impl Write, summary: &EventSummary) -> io::Result<()> {
    let (events, accepted) = (grouped(summary.events), grouped(summary.accepted));
    writeln!(out, "\nevents       {events} taken, {accepted} accepted")?;
    dropped(out, &summary.dropped)?;
    restarts(out, summary.restarts)?;
    refused(out, summary.lines_refused)?;
    let skips = &summary.skips;
    if skips.events_clamped > 0 {
        let clamped = grouped(skips.events_clamped);
        writeln!(out, "clamped      {clamped} late events entered at the newest time")?;
    }
    writeln!(
        out,
        "window       at most {} events; {} left by age, {} because it was full",
        grouped(summary.nodes_max as u64),
        grouped(skips.events_expired),
        grouped(skips.events_evicted)
    )?;
    writeln!(out, "predictions  {}", grouped(summary.predictions))?;
    outside_training(out, summary.outside_training)?;
    unlike_training(out, "windows", summary.unlike_training)?;
    if let Some(approximations) = &summary.approximations {
        self::approximations(out, approximations)?;
    }
    quantiles(out, &summary.latency_us)?;
    rate(out, summary.events_per_s)?;
    real_time(out, summary.real_time)?;
    self::skips(out, skips)
}

/// Writes dropped events, a line for each reason.
pub(crate) fn dropped(out: &mut impl Write, dropped: &BTreeMap<&'static str, u64>) -> io::Result<()> {
    for (reason, &count) in dropped.iter().filter(|&(_, &count)| count > 0) {
        writeln!(out, "dropped      {} {}", grouped(count), reason.replace('_', " "))?;
    }
    Ok(())
}

/// Writes restarts of the sensor's clock, if there were any.
fn restarts(out: &mut impl Write, restarts: u64) -> io::Result<()> {
    if restarts == 0 {
        return Ok(());
    }
    writeln!(out, "restarts     {} of the sensor's clock; each reset the network", grouped(restarts))
}

/// Writes refused lines, if there were any.
pub(crate) fn refused(out: &mut impl Write, lines: u64) -> io::Result<()> {
    if lines == 0 {
        return Ok(());
    }
    writeln!(out, "refused      {} lines or records that are no events", grouped(lines))
}

/// Writes the number of events per second of pushes and predictions.
pub(crate) fn rate(out: &mut impl Write, events_per_s: Option<f64>) -> io::Result<()> {
    let Some(rate) = events_per_s else { return Ok(()) };
    let rate = grouped(rate.round() as u64);
    writeln!(out, "  {rate} events/s, counting the time in pushes and predictions only")
}

/// Writes the speed of a network relative to its stream, and whether that is fast enough.
fn real_time(out: &mut impl Write, times: Option<f64>) -> io::Result<()> {
    let Some(times) = times else { return Ok(()) };
    writeln!(out, "  {} in the mean", times_real_time(times))
}

/// A speed relative to the stream, and its judgement.
pub(crate) fn times_real_time(times: f64) -> String {
    let digits = if times < 9.95 { 2 } else { 0 };
    let verdict = if times < 1.0 { "too slow for the recording" } else { "keeps up with the recording" };
    format!("{times:.digits$} times real time: {verdict}")
}

/// Writes the number of predictions outside the range of the training, if there were any.
fn outside_training(out: &mut impl Write, predictions: Option<u64>) -> io::Result<()> {
    let Some(count @ 1..) = predictions else { return Ok(()) };
    writeln!(
        out,
        "outside      {} predictions have a value outside the range of the training ({OUTSIDE} in the table)",
        grouped(count)
    )
}

/// Writes the number of predictions of windows or frames unlike those of the training, if there
/// were any.
fn unlike_training(out: &mut impl Write, inputs: &str, predictions: Option<u64>) -> io::Result<()> {
    let Some(count @ 1..) = predictions else { return Ok(()) };
    let count = grouped(count);
    writeln!(
        out,
        "unlike       {count} predictions are of {inputs} unlike those of the training ({OUTSIDE} in the table)"
    )
}

/// Writes a line for each approximation of `report`.
pub(crate) fn approximations(out: &mut impl Write, report: &ApproximationReport) -> io::Result<()> {
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

/// Writes what the engine computed and skipped: a row for each layer, and the other counters.
pub(crate) fn skips(out: &mut impl Write, skips: &WorkCounts) -> io::Result<()> {
    let mut table =
        Table::new(&["layer (rows)", "recomputed", "of these unchanged", "kept from before", "kept (%)"]);
    let mut row = |name: &str, recomputed: u64, unchanged: u64, kept: u64| {
        let all = recomputed + kept;
        let share =
            if all > 0 { format!("{:.2}", kept as f64 / all as f64 * 100.0) } else { NONE.to_owned() };
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

/// Writes a row for each of `latencies` that was measured.
fn quantiles(out: &mut impl Write, latencies: &Latencies) -> io::Result<()> {
    let mut table = Table::new(&["latency (us)", "p50", "p90", "p99", "p99.9", "max"]);
    for &(name, quantiles) in &latencies.0 {
        if let Some(Quantiles { p50, p90, p99, p999, max }) = quantiles {
            let cells = [p50, p90, p99, p999, max].map(duration);
            table.row(std::iter::once(name.to_owned()).chain(cells));
        }
    }
    writeln!(out)?;
    table.write(out)
}

/// Writes the summary of a frame network.
pub(super) fn frames(out: &mut impl Write, summary: &FrameSummary) -> io::Result<()> {
    writeln!(out)?;
    match &summary.input {
        InputCounts::Events(counts) => event_counts(out, counts)?,
        InputCounts::Electrodes(counts) => electrode_counts(out, counts)?,
        InputCounts::Pictures { pictures } => writeln!(out, "pictures     {}", grouped(*pictures))?,
        InputCounts::Video(counts) => video_counts(out, counts)?,
        _ => {}
    }
    writeln!(out, "frames       {} pushed", grouped(summary.frames))?;
    writeln!(out, "predictions  {}", grouped(summary.predictions))?;
    outside_training(out, summary.outside_training)?;
    unlike_training(out, "frames", summary.unlike_training)?;
    quantiles(out, &summary.latency_us)?;
    if let Some(rate) = summary.frames_per_s {
        writeln!(out, "  {rate:.1} frames/s, counting the time in preparing, pushing and predicting only")?;
    }
    real_time(out, summary.real_time)?;
    let mut table = Table::new(&["layer (pixels)", "computed", "skipped", "absorbed", "computed (%)"]);
    let mut row = |name: &str, &Pixels { computed, skipped, absorbed, .. }: &Pixels| {
        let share = match computed + skipped + absorbed {
            0 => NONE.to_owned(),
            all => format!("{:.2}", computed as f64 / all as f64 * 100.0),
        };
        table.row([name.to_owned(), grouped(computed), grouped(skipped), grouped(absorbed), share]);
    };
    summary.layers.iter().for_each(|layer| row(&layer.name, &layer.pixels));
    row("all", &summary.pixels);
    writeln!(out)?;
    table.write(out)
}

fn event_counts(out: &mut impl Write, counts: &EventCounts) -> io::Result<()> {
    writeln!(out, "events       {} taken, {} accepted", grouped(counts.events), grouped(counts.accepted))?;
    dropped(out, &counts.dropped)?;
    let notes = [
        (counts.lines_refused, "lines that are no events"),
        (counts.clamped, "late events entered at the newest time"),
        (counts.outside_crop, "events beside the part of the sensor that frames show"),
        (counts.evicted, "events left their window early because it was full"),
        (counts.empty_frames, "frames without events"),
        (counts.empty_frames_left_out, "frames without events left out, beyond the longest silence"),
        (counts.resets, "resets of the state in a silence"),
        (counts.restarts, "restarts of the sensor's clock; each reset the network"),
    ];
    write_counts(out, "", &notes)
}

fn electrode_counts(out: &mut impl Write, counts: &ElectrodeCounts) -> io::Result<()> {
    writeln!(out, "readings     {}, in windows of {}", grouped(counts.readings), counts.steps)?;
    let warnings = [
        (counts.lines_refused, "lines are no readings; a new window begins after each"),
        (counts.values_out_of_range, "values outside the sensor's range of 0 to 4095"),
        (counts.rows_off_rate, "readings off their time at 100 Hz by more than 20 %"),
        (counts.gaps, "gaps of more than 50 ms between readings; a new window begins after each"),
        (counts.times_backwards, "readings earlier than the one before; a new window begins with each"),
        (counts.times_repeated, "readings with the time of the one before"),
    ];
    write_counts(out, "warning", &warnings)?;
    let Some(decisions) = counts.decisions else { return Ok(()) };
    writeln!(out, "decisions    {} made or changed", grouped(decisions))
}

fn video_counts(out: &mut impl Write, counts: &VideoCounts) -> io::Result<()> {
    writeln!(out, "pictures     {}", grouped(counts.pictures))?;
    let late = "late: they had waited for longer than a picture lasts, and a newer one was there";
    write_counts(out, "dropped", &[(counts.pictures_late, late)])?;
    write_counts(out, "left out", &[(counts.bytes_left_out, "bytes at the end, which are no whole picture")])
}

/// Writes the `counts` that are not 0.
fn write_counts(out: &mut impl Write, key: &str, counts: &[(u64, &str)]) -> io::Result<()> {
    for &(count, words) in counts.iter().filter(|&&(count, _)| count > 0) {
        writeln!(out, "{key:<12} {} {words}", grouped(count))?;
    }
    Ok(())
}

/// Writes the summaries of the inputs of a play: a row for each, and dropped events and errors.
pub(super) fn plays(out: &mut impl Write, ended: &[Result<PlaySummary, RunError>]) -> io::Result<()> {
    let mut table =
        Table::new(&["input", "events", "accepted", "fresh (%)", "event to report, p50", "p99", "max (us)"]);
    for (input, summary) in ended.iter().enumerate() {
        let Ok(summary) = summary else { continue };
        let latencies = &summary.latency_us.0;
        let event =
            latencies.iter().find(|&&(name, _)| name == "event").and_then(|&(_, quantiles)| quantiles);
        let [p50, p99, max] = event.map_or_else(
            || std::array::from_fn(|_| NONE.to_owned()),
            |event| [event.p50, event.p99, event.max].map(duration),
        );
        let fresh = summary.reports.fresh as f64 / summary.reports.made.max(1) as f64 * 100.0;
        let counts = [summary.events, summary.accepted].map(grouped);
        let [events, accepted] = counts;
        table.row([input.to_string(), events, accepted, format!("{fresh:.2}"), p50, p99, max]);
    }
    writeln!(out)?;
    table.write(out)?;
    writeln!(out)?;
    for (input, summary) in ended.iter().enumerate() {
        match summary {
            Ok(summary) => {
                refused(out, summary.lines_refused)?;
                play_dropped(out, summary, &format!("from input {input} "))?;
                outside_training(out, summary.outside_training)?;
                unlike_training(out, "windows", summary.unlike_training)?;
                restarts(out, summary.restarts)?;
                if summary.verified.is_some_and(|verified| !verified.equal) {
                    writeln!(out, "verified     input {input} DIFFERS from the batch")?;
                }
            }
            Err(error) => writeln!(out, "failed       input {input}: {}", chain(error))?,
        }
    }
    let summaries = || ended.iter().flatten();
    let equal = summaries().filter(|summary| summary.verified.is_some_and(|verified| verified.equal)).count();
    if summaries().any(|summary| summary.verified.is_some()) {
        writeln!(
            out,
            "verified     the last predictions of {equal} of {} inputs equal the batch",
            ended.len()
        )?;
    }
    let declared: u64 = summaries().map(|summary| summary.bytes).sum();
    write!(out, "memory       engines and queues {}", mebibytes(declared))?;
    match summaries().last().and_then(|summary| summary.peak_resident_bytes) {
        Some(bytes) => {
            writeln!(out, "; the process at most {}, recordings included", mebibytes(bytes))
        }
        None => writeln!(out),
    }
}

/// Writes a line for each reason for which events of `summary` were dropped.
fn play_dropped(out: &mut impl Write, summary: &PlaySummary, from: &str) -> io::Result<()> {
    for (reason, &count) in summary.dropped.iter().filter(|&(_, &count)| count > 0) {
        let by_queue = if QUEUE_REASONS.contains(reason) { "by the queue: " } else { "" };
        writeln!(out, "dropped      {} {from}{by_queue}{}", grouped(count), reason.replace('_', " "))?;
    }
    Ok(())
}

/// Writes the summary of a play.
pub(super) fn play(out: &mut impl Write, summary: &PlaySummary) -> io::Result<()> {
    let PlaySummary { queue, reports, .. } = summary;
    let counts = [summary.events, summary.offered, summary.delivered, summary.accepted];
    let [events, offered, delivered, accepted] = counts.map(grouped);
    writeln!(
        out,
        "\nevents       {events} taken, {offered} offered, {delivered} delivered, {accepted} accepted"
    )?;
    refused(out, summary.lines_refused)?;
    play_dropped(out, summary, "")?;
    restarts(out, summary.restarts)?;
    writeln!(
        out,
        "queue        {}: at most {} of {} events waited; the reader waited {:.1} ms, and was {:.1} ms behind at most",
        queue.overload.replace('_', " "),
        grouped(queue.high_water),
        grouped(queue.capacity),
        queue.blocked_us / 1e3,
        summary.reader_lag_max_us / 1e3,
    )?;
    let counts = [reports.made, reports.due, reports.fresh, reports.behind, reports.old];
    let [made, due, fresh, behind, old] = counts.map(grouped);
    writeln!(out, "reports      {made} of {due} made: {fresh} fresh, {behind} behind, {old} old")?;
    outside_training(out, summary.outside_training)?;
    unlike_training(out, "windows", summary.unlike_training)?;
    writeln!(
        out,
        "deadline     passed by {} of them, by {:.1} us at most; asked for {:.1} us late at most",
        grouped(reports.past_deadline),
        reports.past_deadline_max_us,
        reports.asked_late_max_us
    )?;
    writeln!(out, "drained      {:.1} ms after the end", summary.drain_us / 1e3)?;
    if let Some(bytes) = summary.peak_resident_bytes {
        writeln!(out, "memory       at most {}, the recording included", mebibytes(bytes))?;
    }
    if let Some(verified) = &summary.verified {
        let events = grouped(verified.events as u64);
        let verdict = if verified.equal { "equals" } else { "DIFFERS from" };
        let ms = verified.batch_us / 1e3;
        writeln!(
            out,
            "verified     the last prediction {verdict} the batch over {events} accepted events ({ms:.0} ms)"
        )?;
    }
    if let Some(approximations) = &summary.approximations {
        self::approximations(out, approximations)?;
    }
    quantiles(out, &summary.latency_us)
}
