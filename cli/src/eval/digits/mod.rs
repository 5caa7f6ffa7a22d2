//! `meissner eval digits`: networks over events that tell digits, event by event: how often they are right, and how early.
//!
//! | file | job |
//! |---|---|
//! | `args` | what can be asked for, and in its help how it is judged |
//! | `runs` | recordings through a network |
//! | `judge`, `figures` | outcomes against labels |
//! | `report` | all results, as they are written as JSON |
//! | `table`, `plot` | the same for people |

mod args;
mod figures;
mod judge;
mod plot;
mod report;
mod runs;
mod table;

use std::collections::BTreeMap;
use std::io::{BufWriter, IsTerminal, Write, stderr, stdout};
use std::time::Instant;

use meissner_engine::{Admission, LatePolicy};
use meissner_io::datasets::Split;
use meissner_models::TensorFile;
use meissner_models::systems::digits::{CLASSES, SENSOR};
use serde_json::json;

use crate::args::Mode;
use crate::digits::{Asked, DigitsData, candidates};
use crate::error::CliError;
use crate::output;
use crate::tell::tell;
use crate::text::Folded;
use crate::threads;
pub(super) use args::DigitsArgs;
use judge::Judge;
use meissner_pipeline::lost::{Lost, Warning};
use meissner_pipeline::provenance::{Header, InputCard};
use meissner_pipeline::source::is_stdin;
use report::{DataReport, Report};

/// Judges what `args` ask for, and reports to standard output.
pub(super) fn eval(args: &DigitsArgs) -> Result<(), CliError> {
    let (candidates, more_notes) = candidates(Asked {
        networks: &args.networks,
        weights: args.weights.as_deref(),
        trainings: args.trainings.as_deref(),
        stride: args.stride.map(|stride| stride as usize),
    })?;
    let data = DigitsData::read(&args.data)?;
    let pool = threads::pool(args.threads)?;
    let times = times(&data, args.every_us);
    let judge = Judge {
        folder: &args.data,
        data: &data,
        pool: &pool,
        mode: args.mode,
        every_us: args.every_us,
        times: times.len(),
    };
    let folds = args.folds.map(|folds| folds as usize);
    let plans = candidates.into_iter().map(|candidate| judge.plan(candidate, folds));
    let plans = plans.collect::<Result<Vec<_>, _>>()?;
    let json_file = args.json.as_deref().filter(|path| !is_stdin(path));
    for path in [json_file, args.svg.as_deref(), args.logits.as_deref()].into_iter().flatten() {
        output::check_writable(path)?;
    }

    let start = Instant::now();
    let mut networks = Vec::new();
    let mut logits = Vec::new();
    for plan in &plans {
        let judgement = judge.judge(plan, |training| {
            if stderr().is_terminal() {
                tell(format_args!("{:>8.1} s  {}", start.elapsed().as_secs_f64(), training.label));
            }
        })?;
        networks.push(judgement.report);
        logits.extend(judgement.logits);
    }
    let spent_s = start.elapsed().as_secs_f64();

    let stride = args.stride.map_or(1, |stride| stride as usize);
    let warnings = lost(&data, stride, &args.data.display().to_string());
    let notes = data.notes.iter().cloned().chain(more_notes).collect();
    let input = InputCard::events(&args.data.display().to_string(), &"N-MNIST", SENSOR, Some(data.events()));
    let report = Report {
        header: Header::of_many("eval digits", input),
        data: DataReport {
            folder: args.data.display().to_string(),
            recordings: data.recordings.len(),
            train: data.of(Split::Train).len(),
            test: data.of(Split::Test).len(),
            events: data.events(),
            notes,
            warnings,
        },
        classes: CLASSES,
        mode: match args.mode {
            Mode::Incremental => "incremental",
            Mode::Batch => "batch",
        },
        every_us: args.every_us,
        times_us: times,
        networks,
    };
    if let Some(path) = &args.svg {
        output::write(path, plot::svg(&report))?;
    }
    if let Some(path) = &args.logits {
        output::write(path, logits_file(&data, &logits))?;
    }
    let mut out = Folded::new(BufWriter::new(stdout().lock()), !args.json.as_deref().is_some_and(is_stdin));
    match &args.json {
        Some(path) if is_stdin(path) => out.write_all(&output::json(&report)?)?,
        path => {
            if let Some(path) = path {
                output::write(path, output::json(&report)?)?;
            }
            table::write(&mut out, &report)?;
            writeln!(out, "\njudged in {spent_s:.1} s on {} threads", pool.current_num_threads())?;
        }
    }
    Ok(out.flush()?)
}

/// The times at which predictions are read, up to the first at or behind the end of every recording.
fn times(data: &DigitsData, every_us: i64) -> Vec<i64> {
    let length = |events: &[meissner_engine::Event]| {
        let (first, last) = (events.first(), events.iter().map(|event| event.t_us).max());
        last.zip(first).map_or(0, |(last, first)| last - first.t_us)
    };
    let longest = data.recordings.iter().map(|recording| length(&recording.events)).max().unwrap_or(0);
    // Times of a recording span 23 bits.
    let count = (longest + every_us - 1) / every_us;
    (1..=count.max(1)).map(|i| i * every_us).collect()
}

/// What networks lose of the recordings.
fn lost(data: &DigitsData, stride: usize, name: &str) -> Vec<Warning> {
    let mut gate = Admission::new(SENSOR, LatePolicy::Drop);
    for recording in &data.recordings {
        gate.reset();
        for &event in recording.events.iter().step_by(stride) {
            // What is accepted is counted, too.
            let _ = gate.admit(event);
        }
    }
    Lost { events: *gate.counters(), sensor: SENSOR, outside_crop: 0, lines_refused: 0 }.warn(name)
}

/// The outputs at the end of each recording, as safetensors.
fn logits_file(data: &DigitsData, logits: &[(String, Vec<f32>)]) -> Vec<u8> {
    let names: Vec<&str> = data.recordings.iter().map(|recording| recording.name.as_str()).collect();
    let test: Vec<&str> = data.of(Split::Test).into_iter().map(|i| names[i]).collect();
    let metadata = [("recordings", json!(names)), ("test", json!(test))];
    let metadata = metadata.map(|(key, value)| (key.to_owned(), value.to_string()));
    let mut file = TensorFile::new(BTreeMap::from(metadata));
    for (name, values) in logits {
        file.f32(name, &[values.len() / CLASSES.len(), CLASSES.len()], values);
    }
    file.into_bytes()
}
