//! One engine over recordings in a loop, with disturbances: [`meissner_verify::soak`].

use std::alloc::System;
use std::io::{self, Write};
use std::path::Path;

use meissner_engine::Sensor;
use meissner_run::bench::Part;
use meissner_run::interrupt;
use meissner_run::latency::Quantiles;
use meissner_run::losses::{InputLosses, LossWarning};
use meissner_run::memory::{peak_resident_bytes, resident_bytes};
use meissner_run::model::Model;
use meissner_run::provenance::{Header, InputCard, ModelCard};
use meissner_run::text::grouped;
use meissner_verify::soak::{Checkpoint, PartReport, Recording, Report, Settings, Soak, State};
use serde::Serialize;
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

use super::{SoakArgs, VerifyArgs};
use crate::error::CliError;
use crate::input::advice;
use crate::output;
use crate::progress::Progress;
use crate::stderr::tell;
use crate::text::{NONE, Table, cell, mebibytes};

/// The JSON object.
#[derive(Serialize)]
struct Document {
    header: Header,
    warnings: Vec<LossWarning>,
    #[serde(flatten)]
    report: Report,
}

/// Runs the loop, and writes the results.
pub(super) fn soak(args: &VerifyArgs) -> Result<(), CliError> {
    let weights = &args.weights;
    let model = Model::named(args.network(), weights.file(), weights.ignore_preparation)?;
    let (recordings, sensor) = recordings(args, model.card.network.stride)?;
    output::check_all_writable([&args.report.out])?;
    let document = run(args, &model, recordings, sensor)?;
    output::report(&args.report, &document, |out| write(out, &document.report, &model.card, sensor))?;
    match document.report.broken.len() {
        0 => Ok(()),
        broken => Err(CliError::Broken(broken)),
    }
}

/// The recordings, and a sensor large enough for all of them.
fn recordings(args: &VerifyArgs, stride: usize) -> Result<(Vec<Recording>, Sensor), CliError> {
    let named: Vec<Option<&Path>> = if args.recordings.is_empty() {
        vec![None]
    } else {
        args.recordings.iter().map(|path| Some(path.as_path())).collect()
    };
    let mut extent = Sensor::new(0, 0);
    let mut recordings = Vec::with_capacity(named.len());
    for recording in named {
        let source = args.read.open(recording, Part::default())?.every(stride);
        let sensor = source.sensor(args.read.sensor)?;
        extent = Sensor::new(extent.width.max(sensor.width), extent.height.max(sensor.height));
        let name = source.name.clone();
        let events = source.collect::<Result<Vec<_>, _>>()?;
        recordings.push(Recording::new(name, events)?);
    }
    Ok((recordings, extent))
}

fn run(
    args: &VerifyArgs,
    model: &Model,
    recordings: Vec<Recording>,
    sensor: Sensor,
) -> Result<Document, CliError> {
    let VerifyArgs { seed, every, long: SoakArgs { events, checkpoint_every, disturb_every, .. }, .. } =
        *args;
    // Clap requires the number with --soak.
    let events = events.unwrap_or(1);
    let checkpoints = events.div_ceil(checkpoint_every);
    let settings = Settings { seed, every: every.unwrap_or(1), disturb_every, checkpoint_every };
    let mut soak = Soak::new(model.network.clone(), sensor, recordings, settings)?;
    let mut state = State::open(args.long.state.as_deref())?;
    let until = |number: u64| events.min(number.saturating_mul(checkpoint_every));
    let is_finished = |number: &u64| soak.resume(&state, until(*number) - until(number - 1)).is_some();
    let finished = (1..=checkpoints).take_while(is_finished).last().unwrap_or(0);
    if finished > 0 {
        tell(format_args!("after checkpoint {finished} of {checkpoints}, as the state says"));
    }
    let progress = Progress::new(Some(events), args.report.format.json);
    interrupt::listen();
    for number in finished + 1..=checkpoints {
        while soak.events() < until(number) && !interrupt::requested() {
            soak.push()?;
            progress.set(soak.events());
        }
        let line = line(soak.checkpoint(&mut state, || [Some(live_bytes()), resident_bytes()])?);
        tell(format_args!("checkpoint {number} of {checkpoints}: {line}"));
        if interrupt::requested() {
            break;
        }
    }
    progress.finish();
    let losses = InputLosses::of_events(soak.counters(), sensor).with_advice(advice);
    let report = soak.report(args.long.memory_growth, peak_resident_bytes());
    let names = report.recordings.join(", ");
    let input = InputCard::events(&names, &"recordings in a loop", sensor, None);
    let header = Header::new("soak", input, model.card.clone());
    Ok(Document { header, warnings: losses.warn(&names), report })
}

/// A checkpoint in one line.
fn line(row: &Checkpoint) -> String {
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
fn write(out: &mut impl Write, report: &Report, card: &ModelCard, sensor: Sensor) -> io::Result<()> {
    writeln!(out, "recordings   {}", report.recordings.join(", "))?;
    writeln!(out, "             {sensor} pixels, {} more rounds", grouped(report.rounds))?;
    let mode = format!("incremental, {}", report.isa);
    crate::predictions::write_model(out, card, &mode, Some([sensor.width, sensor.height]))?;
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

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Bytes that are allocated and not freed, independent of the pages of the allocator.
pub(crate) fn live_bytes() -> u64 {
    let stats = ALLOCATOR.stats();
    stats.bytes_allocated.saturating_sub(stats.bytes_deallocated) as u64
}
