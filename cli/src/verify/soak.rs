//! One engine over recordings in a loop, with frequent disturbances. [`meissner_verify::soak`] does
//! the work.

mod table;

use std::path::Path;

use meissner_engine::Sensor;
use meissner_run::bench::Part;
use meissner_run::interrupt;
use meissner_run::losses::{InputLosses, LossWarning};
use meissner_run::memory::{peak_resident_bytes, resident_bytes};
use meissner_run::model::Model;
use meissner_run::provenance::{Header, InputCard};
use meissner_verify::soak::{Recording, Report, Settings, Soak};
use serde::Serialize;

use super::VerifyArgs;
use super::args::SoakArgs;
use crate::error::CliError;
use crate::input::advice;
use crate::progress::Progress;
use crate::stderr::tell;
use crate::{memory, output};

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
    let model = Model::named(args.network(), weights.file.as_deref(), weights.ignore_preparation)?;
    let (recordings, sensor) = recordings(args, model.card.network.stride)?;
    output::check_all_writable([&args.report.out])?;
    let document = run(args, &model, recordings, sensor)?;
    output::report(&args.report, &document, |out| table::write(out, &document.report, &model.card, sensor))?;
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
    let settings = Settings { seed, every: every.unwrap_or(1), disturb_every, checkpoints };
    let mut soak = Soak::new(model.network.clone(), sensor, recordings, settings)?;
    let progress = Progress::new(Some(events), args.report.format.json);
    interrupt::listen();
    for number in 1..=checkpoints {
        let until = events.min(number.saturating_mul(checkpoint_every));
        while soak.events() < until && !interrupt::requested() {
            soak.push()?;
            progress.set(soak.events());
        }
        let line = table::line(soak.checkpoint(|| [Some(memory::live_bytes()), resident_bytes()])?);
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
