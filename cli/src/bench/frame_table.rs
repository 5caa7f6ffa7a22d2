//! The text reports of a frame network, and of its comparison with a network over events.

use std::io::{self, Write};

use meissner_run::bench::{CompareReport, FrameLatencies, FrameModeReport, FrameReport, Ratios, SideReport};
use meissner_run::text::grouped;

use super::table::{deadline, framed, passes, peak, recording, write_apart, write_latencies};
use crate::text::{Table, cell, mebibytes};

/// Writes the report of a frame network.
pub(super) fn write(out: &mut impl Write, report: &FrameReport) -> io::Result<()> {
    heading(out, report)?;
    latencies(out, report)?;
    for (name, way) in ways(report) {
        pixels(out, name, way)?;
    }
    let FrameReport { skipping, everything, .. } = report;
    let peak = peak(report.peak_resident_bytes);
    writeln!(
        out,
        "\nmemory       {} of state with skipping, {} without{peak}",
        mebibytes(skipping.state_bytes),
        mebibytes(everything.state_bytes)
    )?;
    deadline(out, &report.deadline)
}

fn ways(report: &FrameReport) -> [(&'static str, &FrameModeReport); 2] {
    [("skipping", &report.skipping), ("everything", &report.everything)]
}

fn heading(out: &mut impl Write, report: &FrameReport) -> io::Result<()> {
    let FrameReport { input, made, .. } = report;
    recording(out, input, Some(input.events), made.part.as_ref(), "with skipping and without")?;
    writeln!(out, "frames       {}", made.frames_of)?;
    let period_us = grouped(made.period_us.unsigned_abs());
    writeln!(out, "             {}, one every {period_us} us\n", made.field)?;
    framed(out, input, made)?;
    if report.evicted > 0 {
        writeln!(out, "evicted      {} because the window was full", grouped(report.evicted))?;
    }
    writeln!(out, "frames       {}, over {:.3} s of stream", grouped(report.frames), made.stream_s)?;
    writeln!(
        out,
        "measured     {} a way after a warm-up of {} frames, {} kernels, clock {:.3} us a measurement, not subtracted",
        passes(input.passes),
        report.warmup_frames,
        input.isa,
        report.clock_us
    )
}

fn latencies(out: &mut impl Write, report: &FrameReport) -> io::Result<()> {
    let rows = ways(report).into_iter().flat_map(|(way, report)| {
        let FrameLatencies { frame, calls, .. } = &report.latency_us;
        let parts = [
            ("events in", frame),
            ("push", &calls.push),
            ("predict", &calls.predict),
            ("push + predict", &calls.push_predict),
        ];
        parts.map(|(part, latency)| (format!("{part}, {way}"), latency))
    });
    write_latencies(out, "latency of a frame (us)", rows)?;
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

fn pixels(out: &mut impl Write, name: &str, way: &FrameModeReport) -> io::Result<()> {
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
    write_apart(out, &table)?;
    if way.layers.iter().any(|layer| layer.skipped + layer.absorbed > 0) {
        writeln!(
            out,
            "  blocks of pixels are computed: some that could be skipped or absorbed are in both columns"
        )?;
    }
    Ok(())
}

/// Writes the report of a comparison.
pub(super) fn write_comparison(out: &mut impl Write, report: &CompareReport) -> io::Result<()> {
    heading_of_comparison(out, report)?;
    compute(out, report)?;
    let moments = compared_ways(report).map(|(name, way)| (name.to_owned(), &way.moment_us));
    write_latencies(out, "compute of a moment (us)", moments)?;
    let peak = peak(report.peak_resident_bytes);
    let state = compared_ways(report).map(|(name, way)| format!("{} ({name})", mebibytes(way.state_bytes)));
    writeln!(out, "\nmemory       {} of state{peak}", state.join(", "))
}

fn compared_ways(report: &CompareReport) -> [(&'static str, &SideReport); 3] {
    let ways = &report.ways;
    [
        ("events", &ways.events),
        ("frames, everything", &ways.frames_everything),
        ("frames, skipping", &ways.frames_skipping),
    ]
}

fn heading_of_comparison(out: &mut impl Write, report: &CompareReport) -> io::Result<()> {
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
    for (name, way) in compared_ways(report) {
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
    for ((name, _), (compute, multiply_adds)) in compared_ways(report)[1..].iter().zip(both) {
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
