//! The report of a frame network for people.

use std::io::{self, Write};

use meissner_io::Format;

use super::super::table::{cells, deadline, headings, mebibytes};
use super::report::{FrameReport, WayReport};
use crate::text::Table;
use meissner_pipeline::text::grouped;

/// Writes everything; the recording is of `format`.
pub(super) fn write(out: &mut impl Write, report: &FrameReport, format: Format) -> io::Result<()> {
    heading(out, report, format)?;
    latencies(out, report)?;
    for (name, way) in ways(report) {
        pixels(out, name, way)?;
    }
    let FrameReport { skipping, everything, .. } = report;
    let peak = report.peak_resident_bytes.map_or_else(String::new, |bytes| {
        format!("; the process at most {} resident, with the recording", mebibytes(bytes))
    });
    writeln!(
        out,
        "\nmemory       {} of state with skipping, {} without{peak}",
        mebibytes(skipping.state_bytes),
        mebibytes(everything.state_bytes)
    )?;
    deadline(out, &report.deadline)
}

fn ways(report: &FrameReport) -> [(&'static str, &WayReport); 2] {
    [("skipping", &report.skipping), ("everything", &report.everything)]
}

fn heading(out: &mut impl Write, report: &FrameReport, format: Format) -> io::Result<()> {
    let [width, height] = report.sensor;
    writeln!(out, "recording    {}", report.recording)?;
    writeln!(out, "             {format}, {width}x{height} pixels, {} events", grouped(report.events))?;
    if let Some(part) = &report.part {
        writeln!(out, "             {part}")?;
    }
    crate::header::write_model(out, &report.card, "with skipping and without", Some(report.sensor))?;
    writeln!(out, "frames       {}", report.frames_of)?;
    writeln!(
        out,
        "             {}, one every {} us\n",
        report.field,
        grouped(report.period_us.unsigned_abs())
    )?;
    let (accepted, outside) = (grouped(report.accepted), grouped(report.outside_frames));
    writeln!(
        out,
        "events       {} taken, {accepted} accepted, {outside} of them in no frame",
        grouped(report.events)
    )?;
    for (reason, &count) in report.dropped.iter().filter(|&(_, &count)| count > 0) {
        writeln!(out, "dropped      {} {}", grouped(count), reason.replace('_', " "))?;
    }
    if report.evicted > 0 {
        writeln!(out, "evicted      {} because the window was full", grouped(report.evicted))?;
    }
    let passes = if report.passes == 1 { "pass" } else { "passes" };
    writeln!(out, "frames       {}, over {:.3} s of stream", grouped(report.frames), report.stream_s)?;
    writeln!(
        out,
        "measured     {} {passes} a way after a warm-up of {} frames, {} kernels, clock {:.3} us a measurement, not \
         subtracted",
        report.passes, report.warmup_frames, report.isa, report.clock_us
    )
}

fn latencies(out: &mut impl Write, report: &FrameReport) -> io::Result<()> {
    let mut table = Table::new(&headings(&["latency of a frame (us)"]));
    for (name, way) in ways(report) {
        let latency = &way.latency_us;
        for (part, distribution) in [
            ("events in", &latency.frame),
            ("push", &latency.push),
            ("predict", &latency.predict),
            ("push + predict", &latency.push_predict),
        ] {
            if let Some(distribution) = distribution {
                table.row(std::iter::once(format!("{part}, {name}")).chain(cells(distribution)));
            }
        }
    }
    writeln!(out)?;
    table.write(out)?;
    for (name, way) in ways(report) {
        if let Some(rate) = way.frames_per_s {
            writeln!(
                out,
                "  {name}: {:.3} s of compute, {rate:.1} frames/s, {:.3} G multiply-adds/s",
                way.compute_s,
                way.multiply_adds_per_s.unwrap_or(0.0) / 1e9
            )?;
        }
    }
    Ok(())
}

fn pixels(out: &mut impl Write, name: &str, way: &WayReport) -> io::Result<()> {
    let heading = format!("layer ({name})");
    let mut table = Table::new(&[
        &heading,
        "pixels computed",
        "(%)",
        "skipped",
        "(%)",
        "absorbed",
        "(%)",
        "multiply-adds (M)",
    ]);
    for layer in &way.layers {
        let counts = [layer.computed, layer.skipped, layer.absorbed];
        let share = |count: u64| match layer.pixels {
            0 => "-".to_owned(),
            all => format!("{:.2}", count as f64 / all as f64 * 100.0),
        };
        let shares = counts.iter().flat_map(|&count| [grouped(count), share(count)]);
        let millions = format!("{:.1}", layer.multiply_adds as f64 / 1e6);
        table.row(std::iter::once(layer.name.clone()).chain(shares).chain([millions]));
    }
    let millions = format!("{:.1}", way.multiply_adds as f64 / 1e6);
    let blank = std::iter::repeat_n(String::new(), 6);
    table.row(std::iter::once("all".to_owned()).chain(blank).chain([millions]));
    writeln!(out)?;
    table.write(out)?;
    if way.layers.iter().any(|layer| layer.skipped + layer.absorbed > 0) {
        writeln!(
            out,
            "  blocks of pixels are computed: some that could be skipped or absorbed are in both columns"
        )?;
    }
    Ok(())
}
