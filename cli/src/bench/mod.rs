//! `meissner bench`: how long events take, when they take longer, and where the time goes.
//!
//! | file | job |
//! |---|---|
//! | `args` | what can be asked for, and in its help how it is measured |
//! | `pass` | one engine over all events, every call timed |
//! | `phases` | which events belong to a burst |
//! | `deadline` | the work of each period of stream time |
//! | `memory` | the process's memory |
//! | `part`, `moments` | the events that are measured, and when frames are taken of them |
//! | `frames/` | the same for a frame network |
//! | `compare/` | a network over events against a frame network |
//! | `report` | all results, as they are written as JSON |
//! | `table`, `plot` | the same for people |

mod args;
mod compare;
mod deadline;
mod frames;
mod memory;
mod moments;
mod part;
mod pass;
mod phases;
mod plot;
mod report;
mod table;

use std::io::{self, BufWriter, Write, stdout};
use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::{Event, Options};
use meissner_models::AnyDescription;

pub(crate) use args::BenchArgs;
pub(crate) use memory::{peak_resident_bytes, resident_bytes};

use crate::args::Every;
use crate::error::CliError;
use crate::header::header;
use crate::output;
use crate::progress::Progress;
use crate::text::Folded;
use deadline::Deadline;
use meissner_pipeline::latency::{Latency, microseconds};
use meissner_pipeline::lost::Lost;
use meissner_pipeline::model::describe_any;
use meissner_pipeline::provenance::{Header, InputCard};
use meissner_pipeline::source::Source;
use part::Part;
use pass::{Measured, Passes};
use phases::Phases;
use report::Report;

/// Measurements of nothing whose mean is the clock's overhead, and how often that mean is taken.
const CLOCK_READS: u32 = 2000;
const CLOCK_RUNS: usize = 50;

/// Period of the deadline report where none is asked for.
const PERIOD_US: i64 = 1000;

/// Measures what `args` ask for, and reports to standard output.
pub(crate) fn bench(args: &BenchArgs) -> Result<(), CliError> {
    match (describe_any(&args.input.network)?, &args.compare) {
        ((AnyDescription::Frames(_), _), _) => frames::bench(args),
        ((AnyDescription::Events(_), _), Some(name)) => compare::compare(args, name),
        ((AnyDescription::Events(_), _), None) => bench_events(args),
    }
}

/// A network over events.
fn bench_events(args: &BenchArgs) -> Result<(), CliError> {
    let input = &args.input;
    let model = input.model()?;
    let mut source = input.source(&model.card)?;
    let sensor = source.sensor(input.sensor)?;
    let described = InputCard::events(&source.name, &source.format, sensor, source.recorded());
    let provenance = Header::new("bench", described, model.card.clone());
    provenance.warn();
    if let Some(path) = &args.svg {
        output::check_writable(path)?;
    }
    let mut out = Folded::new(BufWriter::new(stdout().lock()), !args.json);
    let recording = source.name.clone();
    let mut heading = Vec::new();
    header(&mut heading, &model, "incremental", &source, sensor)?;
    let part = Part { from_us: args.from_us, for_us: args.for_us };
    if part.is_some() {
        writeln!(heading, "part         {part}")?;
    }
    let events = taken(&mut source, args)?;
    let lines_refused = source.lines_refused();

    let phases = Phases::new(&events, sensor, input.late.into(), args.burst_rate);
    let warmup = usize::try_from(args.warmup).unwrap_or(usize::MAX).min(events.len());
    let total = events.len() as u64 * (u64::from(args.repeat) + 2) + warmup as u64;
    let progress = Progress::new(Some(total), args.json);
    let network = Arc::new(model.network.clone());
    let every = args.every.unwrap_or(Every::Events(1));
    let approximations = input.approximations.clone();
    let mut passes =
        Passes { network, sensor, late: input.late.into(), approximations, every, progress, taken: 0 };

    let clock_us = clock_us();
    passes.latency(&events[..warmup], &phases, false, &mut Measured::new())?;
    let mut measured = Measured::new();
    let mut front = passes.latency(&events, &phases, false, &mut measured)?;
    for _ in 1..args.repeat {
        front = passes.latency(&events, &phases, false, &mut measured)?;
    }
    // Before the other passes, whose bookkeeping is not the engine's.
    let peak_resident_bytes = peak_resident_bytes();
    let staged = passes.latency(&events, &phases, true, &mut Measured::new())?;
    let deadline = Deadline::measure(&mut passes, &events, args.period_us.unwrap_or(PERIOD_US))?;
    passes.progress.finish();

    let lost = Lost { events: front.engine().counters().events, sensor, outside_crop: 0, lines_refused };
    let report = Report {
        warnings: lost.warn(&recording),
        lines_refused,
        header: provenance,
        recording,
        network: model.network.name().to_owned(),
        isa: Options::default().isa.name(),
        passes: args.repeat,
        warmup_events: warmup as u64,
        clock_us,
        deadline: deadline.report(),
        approximations: input.approximations.values().report(
            &front.chain,
            &front.engine().counters(),
            front.readout.stale(),
        ),
        ..Report::measured(
            &model,
            &front,
            staged.engine(),
            &measured,
            &phases,
            args.repeat,
            peak_resident_bytes,
        )
    };
    if let Some(path) = &args.svg {
        output::write(path, plot::svg(&report, &measured))?;
    }
    if args.json {
        serde_json::to_writer(&mut out, &report).map_err(io::Error::from)?;
        writeln!(out)?;
    } else {
        out.write_all(&heading)?;
        table::write(&mut out, &report)?;
    }
    Ok(out.flush()?)
}

/// The events of the part of `source` that `args` ask for.
fn taken(source: &mut Source, args: &BenchArgs) -> Result<Vec<Event>, CliError> {
    let limit = args.input.limit.and_then(|limit| usize::try_from(limit).ok()).unwrap_or(usize::MAX);
    Part { from_us: args.from_us, for_us: args.for_us }.take(source, limit).map_err(CliError::from)
}

/// What measuring nothing takes, in microseconds: the least mean of several runs, since an interruption can only add.
fn clock_us() -> f64 {
    let mean = |_| {
        let mut nothing = Duration::ZERO;
        for _ in 0..CLOCK_READS {
            let start = Instant::now();
            nothing += start.elapsed();
        }
        microseconds(nothing) / f64::from(CLOCK_READS)
    };
    (0..CLOCK_RUNS).map(mean).fold(f64::INFINITY, f64::min)
}

/// `parts` added up.
fn sum<'a>(parts: impl IntoIterator<Item = &'a Latency>) -> Latency {
    let mut sum = Latency::new();
    parts.into_iter().for_each(|part| sum.add(part));
    sum
}
