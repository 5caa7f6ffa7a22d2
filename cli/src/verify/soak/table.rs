//! Results of a soak as text.

use std::io::{self, Write};

use meissner_engine::Sensor;
use meissner_run::latency::Quantiles;
use meissner_run::provenance::ModelCard;
use meissner_run::text::grouped;
use meissner_verify::soak::{Checkpoint, PartReport, Report};

use crate::text::{NONE, Table, cell, mebibytes};

/// A checkpoint in one line.
pub(super) fn line(row: &Checkpoint) -> String {
    let p50 = |quantiles: Option<Quantiles>| cell(quantiles, |q| format!("{:.2}", q.p50));
    format!(
        "{} events in {:.0} s, {} with the batch over {}, {} live, {} resident, push {} us, predict {} us in the median",
        grouped(row.events),
        row.seconds,
        if row.equal { "equal" } else { "NOT EQUAL" },
        grouped(row.compared as u64),
        resident(row.live_bytes),
        resident(row.resident_bytes),
        p50(row.latency_us.push),
        p50(row.latency_us.predict),
    )
}

/// Writes everything except the individual checkpoints.
pub(super) fn write(
    out: &mut impl Write,
    report: &Report,
    card: &ModelCard,
    sensor: Sensor,
) -> io::Result<()> {
    writeln!(out, "recordings   {}", report.recordings.join(", "))?;
    writeln!(out, "             {sensor} pixels, {} more rounds", grouped(report.rounds))?;
    let mode = format!("incremental, {}", report.isa);
    crate::header::write_model(out, card, &mode, Some([sensor.width, sensor.height]))?;
    let (events, accepted) = (grouped(report.events), grouped(report.accepted));
    writeln!(
        out,
        "events       {events}, {accepted} accepted, in {:.0} s; seed {}",
        report.seconds, report.seed
    )?;
    let done = &report.disturbances;
    writeln!(
        out,
        "disturbed    {} silences, {} moves of time, {} states as bytes, {} snapshots, {} resets\n",
        done.silences, done.advances, done.bytes, done.snapshots, done.resets
    )?;
    let mut table = Table::new(&["us", "p50", "p90", "p99", "p99.9", "max", "resident"]);
    for (name, part) in [("first tenth", &report.first), ("last tenth", &report.last)] {
        cells(name, part).into_iter().for_each(|row| table.row(row));
    }
    table.write(out)?;
    writeln!(out)?;
    let equal = report.checkpoints.iter().filter(|row| row.equal).count();
    writeln!(out, "bits         equal to the batch at {equal} of {} checkpoints", report.checkpoints.len())?;
    match &report.memory {
        Some(memory) => writeln!(
            out,
            "memory       live {:+.1} % after warm-up: {} to {}; resident at most {}",
            memory.growth_percent,
            mebibytes(memory.warm_bytes),
            mebibytes(memory.end_bytes),
            resident(report.peak_resident_bytes)
        )?,
        None => writeln!(out, "memory       not judged: too few checkpoints")?,
    }
    for (name, ratio) in [("push", report.ratio.push), ("predict", report.ratio.predict)] {
        if let Some(ratio) = ratio {
            let (p50, p99) = (ratio.p50, ratio.p99);
            writeln!(out, "latency      {name}: last tenth to first, median {p50:.2}, p99 {p99:.2}")?;
        }
    }
    report.broken.iter().try_for_each(|broken| writeln!(out, "broken: {broken}"))
}

fn cells(name: &str, part: &PartReport) -> Vec<Vec<String>> {
    let calls = [("push", part.latency_us.push), ("predict", part.latency_us.predict)];
    let row = |(call, quantiles): (&str, Option<Quantiles>)| {
        let mut cells = vec![format!("{name}, {call}")];
        match quantiles {
            Some(q) => cells.extend([q.p50, q.p90, q.p99, q.p999, q.max].map(|us| format!("{us:.2}"))),
            None => cells.extend([(); 5].map(|()| NONE.to_owned())),
        }
        cells.push(resident(part.resident_bytes));
        cells
    };
    calls.map(row).to_vec()
}

fn resident(bytes: Option<u64>) -> String {
    bytes.map_or_else(|| "unknown".to_owned(), mebibytes)
}
