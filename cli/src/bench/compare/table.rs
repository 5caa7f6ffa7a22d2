//! The comparison for people.

use std::io::{self, Write};

use meissner_io::Format;

use super::super::table::{cells, headings, mebibytes};
use super::report::{Comparison, Ratios, WayReport};
use crate::text::Table;
use meissner_pipeline::text::grouped;

/// Writes everything; the recording is of `format`.
pub(super) fn write(out: &mut impl Write, report: &Comparison, format: Format) -> io::Result<()> {
    heading(out, report, format)?;
    compute(out, report)?;
    moments(out, report)?;
    let peak = report.peak_resident_bytes.map_or_else(String::new, |bytes| {
        format!("; the process at most {} resident, with the recording", mebibytes(bytes))
    });
    let state = ways(report).map(|(name, way)| format!("{} ({name})", mebibytes(way.state_bytes)));
    writeln!(out, "\nmemory       {} of state{peak}", state.join(", "))
}

fn ways(report: &Comparison) -> [(&'static str, &WayReport); 3] {
    let ways = &report.ways;
    [
        ("events", &ways.events),
        ("frames, everything", &ways.frames_everything),
        ("frames, skipping", &ways.frames_skipping),
    ]
}

fn heading(out: &mut impl Write, report: &Comparison, format: Format) -> io::Result<()> {
    let [width, height] = report.sensor;
    writeln!(out, "recording    {}", report.recording)?;
    writeln!(out, "             {format}, {width}x{height} pixels")?;
    if let Some(part) = &report.part {
        writeln!(out, "             {part}")?;
    }
    crate::header::write_model(out, &report.card, "incremental", Some(report.sensor))?;
    writeln!(out, "against      {}, weights {}", report.against.network.name, report.against.trust())?;
    writeln!(out, "             {}", report.against.source())?;
    writeln!(out, "             {}", report.frames_of)?;
    writeln!(out, "             {}\n", report.field)?;
    writeln!(
        out,
        "events       {} taken, {} accepted, {} of them in no frame",
        grouped(report.events),
        grouped(report.accepted),
        grouped(report.outside_frames)
    )?;
    for (reason, &count) in report.dropped.iter().filter(|&(_, &count)| count > 0) {
        writeln!(out, "dropped      {} {}", grouped(count), reason.replace('_', " "))?;
    }
    if report.evicted_from_frames > 0 {
        writeln!(out, "evicted      {} from full frames", grouped(report.evicted_from_frames))?;
    }
    writeln!(
        out,
        "moments      {}, one every {} us: {:.3} s of stream",
        grouped(report.moments),
        grouped(report.period_us.unsigned_abs()),
        report.stream_s
    )?;
    let passes = if report.passes == 1 { "1 pass" } else { "the fastest pass" };
    writeln!(out, "measured     {passes} of each way, one thread, {} kernels", report.isa)
}

fn compute(out: &mut impl Write, report: &Comparison) -> io::Result<()> {
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
        let or_none = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
        table.row([
            name.to_owned(),
            format!("{:.4}", way.compute_s),
            or_none(way.compute_s_per_s.map(|s| format!("{s:.5}"))),
            format!("{:.4}", way.events_s),
            or_none(way.push_s.map(|s| format!("{s:.4}"))),
            format!("{:.4}", way.predict_s),
            or_none(way.frames.map(grouped)),
            grouped(way.predictions),
            format!("{:.1}", way.multiply_adds as f64 / 1e6),
        ]);
    }
    writeln!(out)?;
    table.write(out)?;
    writeln!(
        out,
        "  multiply-adds of the network over events are at full neighbourhoods: an upper bound there\n"
    )?;
    let mut table = Table::new(&["events in % of", "compute", "multiply-adds"]);
    let of = |ratios: &Ratios| [ratios.frames_everything, ratios.frames_skipping];
    let both = of(&report.ratio_percent).into_iter().zip(of(&report.multiply_adds_ratio_percent));
    for ((name, _), (compute, multiply_adds)) in ways(report)[1..].iter().zip(both) {
        let percent = |ratio: Option<f64>| ratio.map_or_else(|| "-".to_owned(), |r| format!("{r:.3}"));
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

fn moments(out: &mut impl Write, report: &Comparison) -> io::Result<()> {
    let mut table = Table::new(&headings(&["compute of a moment (us)"]));
    for (name, way) in ways(report) {
        if let Some(distribution) = &way.moment_us {
            table.row(std::iter::once(name.to_owned()).chain(cells(distribution)));
        }
    }
    writeln!(out)?;
    table.write(out)
}
