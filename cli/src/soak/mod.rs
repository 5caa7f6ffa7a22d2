//! `meissner soak`: one engine over recordings round and round, for very long, disturbed all the while.
//!
//! | file | job |
//! |---|---|
//! | `args` | what can be asked for |
//! | `endless` | recordings one after the other for ever, stamps shifted so that time goes on |
//! | `disturbance` | what is done to the engine between events, dealt from a seed |
//! | `subject` | the engine, timed, and the record of what it accepted |
//! | `report` | what came of it, as it is written as JSON |
//! | `verdict` | which promises are broken |
//! | `table` | the same for people |
//!
//! All but times and memory depends on recordings, network and seed alone.

mod args;
mod disturbance;
mod endless;
mod report;
mod subject;
mod table;
mod verdict;

use std::io::{BufWriter, Write, stdout};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use meissner_engine::{Options, Sensor};

pub(crate) use args::SoakArgs;

use crate::bench::{peak_resident_bytes, resident_bytes};
use crate::error::CliError;
use crate::output;
use crate::progress::Progress;
use crate::tell::tell;
use crate::text::Folded;
use disturbance::Deck;
use endless::{Endless, Tape};
use meissner_models::random::Random;
use meissner_pipeline::interrupt;
use meissner_pipeline::lost::Lost;
use meissner_pipeline::model::Model;
use meissner_pipeline::provenance::{Header, InputCard};
use report::{Checkpoint, Part, Report};
use subject::{Subject, Timed};

/// Runs the subcommand.
pub(crate) fn soak(args: &SoakArgs) -> Result<(), CliError> {
    let model = Model::named(&args.network, args.weights.as_deref(), args.ignore_preparation)?;
    let (tapes, sensor) = tapes(args, model.card.stride())?;
    if let Some(path) = &args.json {
        output::check_writable(path)?;
    }
    let report = run(args, &model, tapes, sensor)?;
    if let Some(path) = &args.json {
        output::write(path, output::json(&report)?)?;
    }
    let mut out = Folded::new(BufWriter::new(stdout().lock()), true);
    table::write(&mut out, &report)?;
    out.flush()?;
    match report.broken.len() {
        0 => Ok(()),
        broken => Err(CliError::Broken(broken)),
    }
}

/// The recordings, and a sensor that holds all of them.
fn tapes(args: &SoakArgs, stride: usize) -> Result<(Vec<Tape>, Sensor), CliError> {
    let named: Vec<Option<&Path>> = if args.recordings.is_empty() {
        vec![None]
    } else {
        args.recordings.iter().map(|path| Some(path.as_path())).collect()
    };
    let mut extent = Sensor::new(0, 0);
    let mut tapes = Vec::with_capacity(named.len());
    for recording in named {
        let source = args.read.open(recording, args.sensor.is_some(), true)?.every(stride);
        let sensor = source.sensor(args.sensor)?;
        extent = Sensor::new(extent.width.max(sensor.width), extent.height.max(sensor.height));
        let name = source.name.clone();
        let events = source.collect::<Result<Vec<_>, _>>()?;
        let found = format!("{name}, which has none");
        tapes.push(Tape::new(name, events).ok_or(CliError::Option {
            option: "RECORDING",
            expected: "recordings with events".to_owned(),
            found,
        })?);
    }
    Ok((tapes, extent))
}

fn run(args: &SoakArgs, model: &Model, tapes: Vec<Tape>, sensor: Sensor) -> Result<Report, CliError> {
    let start = Instant::now();
    let network = Arc::new(model.network.clone());
    let mut stream = Endless::new(tapes, Random::new(args.seed));
    let mut deck = Deck::new(Random::new(!args.seed), args.disturb_every);
    let mut subject = Subject::new(Arc::clone(&network), sensor)?;
    let checkpoints = args.events.div_ceil(args.checkpoint_every);
    let part = checkpoints.div_ceil(10);
    let (mut first, mut last) = (Part::new(), Part::new());
    let mut rows = Vec::with_capacity(checkpoints as usize);
    let progress = Progress::new(Some(args.events), false);
    let mut done = 0;
    interrupt::listen();
    for number in 0..checkpoints {
        let mut timed = Timed::new();
        let until = args.events.min((number + 1).saturating_mul(args.checkpoint_every));
        while done < until && !interrupt::requested() {
            if let Some(disturbance) = deck.after_an_event() {
                subject.disturb(disturbance, &mut stream)?;
            }
            let event = stream.next();
            done += 1;
            subject.push(event, done.is_multiple_of(args.every), &mut timed)?;
            progress.set(done);
        }
        let checked = subject.check()?;
        let row = Checkpoint::new(done, &checked, &timed, resident_bytes(), start.elapsed());
        progress.suspend(|| {
            tell(format_args!("checkpoint {} of {checkpoints}: {}", number + 1, table::line(&row)));
        });
        if number < part {
            first.add(&row, &timed);
        }
        if number >= checkpoints - part {
            last.add(&row, &timed);
        }
        rows.push(row);
        if interrupt::requested() {
            break;
        }
    }
    progress.finish();
    let input = InputCard::events(&stream.names().join(", "), &"recordings round and round", sensor, None);
    let counters = subject.counters();
    let lost = Lost { events: counters, sensor, outside_crop: 0, lines_refused: 0 };
    let report = Report {
        recordings: stream.names(),
        rounds: stream.rounds(),
        header: Header::new("soak", input, model.card.clone()),
        card: model.card.clone(),
        sensor: [sensor.width, sensor.height],
        isa: Options::default().isa.name(),
        seed: args.seed,
        every: args.every,
        events: done,
        accepted: counters.accepted,
        warnings: lost.warn(&stream.names().join(", ")),
        disturbances: subject.disturbances(),
        first: first.report(),
        last: last.report(),
        ratio: None,
        memory: None,
        peak_resident_bytes: peak_resident_bytes(),
        seconds: start.elapsed().as_secs_f64(),
        broken: Vec::new(),
        checkpoints: rows,
    };
    Ok(verdict::judged(report, args.memory_growth))
}
