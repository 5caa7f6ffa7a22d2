//! The text report of a comparison.

use std::io::{self, Write};

use meissner_run::bench::{CompareReport, Ratios, SideReport};
use meissner_run::text::grouped;

use super::table::{framed, peak, recording, write_apart, write_latencies};
use crate::text::{Table, cell, mebibytes};

/// Writes the report of a comparison.
pub(super) fn write(out: &mut impl Write, report: &CompareReport) -> io::Result<()> {
    heading(out, report)?;
    compute(out, report)?;
    let moments = ways(report).map(|(name, way)| (name.to_owned(), &way.moment_us));
    write_latencies(out, "compute of a moment (us)", moments)?;
    let peak = peak(report.peak_resident_bytes);
    let state = ways(report).map(|(name, way)| format!("{} ({name})", mebibytes(way.state_bytes)));
    writeln!(out, "\nmemory       {} of state{peak}", state.join(", "))
}

fn ways(report: &CompareReport) -> [(&'static str, &SideReport); 3] {
    let ways = &report.ways;
    [
        ("events", &ways.events),
        ("frames, everything", &ways.frames_everything),
        ("frames, skipping", &ways.frames_skipping),
    ]
}

fn heading(out: &mut impl Write, report: &CompareReport) -> io::Result<()> {
    let CompareReport { input, made, against, .. } = report;
    recording(out, input, None, made.part.as_ref(), "incremental")?;
    writeln!(out, "against      {}, weights {}", against.network.name, against.trust())?;
    writeln!(out, "             {}", against.source())?;
    writeln!(out, "             {}", made.frames_of)?;
    writeln!(out, "             {}\n", made.field)?;
    framed(out, input, made)?;
    if report.evicted_from_frames > 0 {
        writeln!(out, "evicted      {} from full frames", grouped(report.evicted_from_frames))?;
    }
    writeln!(
        out,
        "moments      {}, one every {} us: {:.3} s of stream",
        grouped(report.moments),
        grouped(made.period_us.unsigned_abs()),
        made.stream_s
    )?;
    let passes = if input.passes == 1 { "1 pass" } else { "the fastest pass" };
    writeln!(out, "measured     {passes} of each way, one thread, {} kernels", input.isa)
}

fn compute(out: &mut impl Write, report: &CompareReport) -> io::Result<()> {
    let mut table = Table::new(&[
        "compute",
        "s",
        "s a second of stream",
        "events in (s)",
        "push (s)",
        "predict (s)",
        "frames",
        "predictions",
        "multiply-adds (M)",
    ]);
    for (name, way) in ways(report) {
        table.row([
            name.to_owned(),
            format!("{:.4}", way.compute_s),
            cell(way.compute_s_per_s, |s| format!("{s:.5}")),
            format!("{:.4}", way.events_s),
            cell(way.push_s, |s| format!("{s:.4}")),
            format!("{:.4}", way.predict_s),
            cell(way.frames, grouped),
            grouped(way.predictions),
            format!("{:.1}", way.multiply_adds as f64 / 1e6),
        ]);
    }
    write_apart(out, &table)?;
    writeln!(
        out,
        "  multiply-adds of the network over events are at full neighbourhoods: an upper bound there\n"
    )?;
    let mut table = Table::new(&["events in % of", "compute", "multiply-adds"]);
    let of = |ratios: &Ratios| [ratios.frames_everything, ratios.frames_skipping];
    let both = of(&report.ratio_percent).into_iter().zip(of(&report.multiply_adds_ratio_percent));
    for ((name, _), (compute, multiply_adds)) in ways(report)[1..].iter().zip(both) {
        let percent = |ratio: Option<f64>| cell(ratio, |ratio| format!("{ratio:.3}"));
        table.row([(*name).to_owned(), percent(compute), percent(multiply_adds)]);
    }
    table.write(out)?;
    let (differ, predictions) = (report.predictions_that_differ, report.ways.frames_skipping.predictions);
    writeln!(
        out,
        "  {} of {} predictions over frames differ in a bit between everything and skipping",
        grouped(differ),
        grouped(predictions)
    )
}
