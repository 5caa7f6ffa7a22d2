//! `meissner verify`: incremental against full recomputation, bit for bit, for any network. The work is done by
//! [`meissner_verify`].

mod args;
#[cfg(test)]
mod tests;

use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use meissner_engine::Event;
use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_io::IoError;
use meissner_models::{AnyDescription, Weights, drawn_file};
use meissner_pipeline::PipelineError;
use meissner_pipeline::model::{Model, describe_any, frame_network, weights};
use meissner_pipeline::provenance::{Header, InputCard, ModelCard};
use meissner_pipeline::text::grouped;
use meissner_verify::{
    Difference, Mismatch, Stream, Summary, VerifyError, poisoned, replay, replay_frames, verify_frames,
    verify_recording, verify_with,
};
use serde::Serialize;

pub(crate) use args::VerifyArgs;

use crate::error::CliError;
use crate::header;
use crate::output;
use crate::progress::Progress;
use crate::text::Folded;

/// Name of the random streams.
const RANDOM: &str = "random streams";

/// The JSON object.
#[derive(Serialize)]
struct Document<'a> {
    header: Header,
    seed: u64,
    #[serde(flatten)]
    result: &'a Verified,
}

/// Sources without a difference, and the first with one, after which nothing is run.
#[derive(Default, Serialize)]
struct Verified {
    checks: Vec<Check>,
    mismatch: Option<Found>,
}

/// A source without a difference.
#[derive(Serialize)]
struct Check {
    name: String,
    #[serde(flatten)]
    summary: Summary,
}

/// A difference, and its minimal stream.
#[derive(Serialize)]
struct Found {
    name: String,
    file: String,
    steps: usize,
    input: usize,
    layer: Option<String>,
    row: Option<usize>,
    difference: String,
}

impl Verified {
    /// Notes the result of the source `name`. The minimal stream of a mismatch is written, unless it was replayed.
    fn note(
        &mut self,
        args: &VerifyArgs,
        name: &str,
        result: Result<Summary, VerifyError>,
    ) -> Result<(), CliError> {
        let (found, text) = match result {
            Ok(summary) => {
                self.checks.push(Check { name: name.to_owned(), summary });
                return Ok(());
            }
            Err(VerifyError::Mismatch(mismatch)) => {
                (found(args, name, &mismatch), mismatch.stream.to_text(&remarks(args, &mismatch)))
            }
            Err(VerifyError::FrameMismatch(mismatch)) => {
                (found(args, name, &mismatch), mismatch.stream.to_text(&remarks(args, &mismatch)))
            }
            Err(error) => return Err(error.into()),
        };
        if args.replay.is_none() {
            output::write(&args.out, text)?;
        }
        self.mismatch = Some(found);
        Ok(())
    }
}

fn found<I>(args: &VerifyArgs, name: &str, mismatch: &Mismatch<I>) -> Found {
    let (layer, row) = match &mismatch.difference {
        Difference::Row { layer, row, .. } => (Some(layer.clone()), Some(*row)),
        Difference::Size { layer, .. } => (Some(layer.clone()), None),
        _ => (None, None),
    };
    Found {
        name: name.to_owned(),
        file: args.replay.as_ref().unwrap_or(&args.out).display().to_string(),
        steps: mismatch.stream.steps.len(),
        input: mismatch.input,
        layer,
        row,
        difference: mismatch.to_string(),
    }
}

fn remarks<I>(args: &VerifyArgs, mismatch: &Mismatch<I>) -> String {
    format!("found by `meissner verify {}`\n{mismatch}", args.network)
}

/// Runs the subcommand.
pub(crate) fn verify(args: &VerifyArgs) -> Result<(), CliError> {
    let (description, shipped) = describe_any(&args.network)?;
    let weights = if args.weights.is_none() && !shipped {
        let drawn =
            Weights::from_bytes(&drawn_file(&description, args.seed)).expect("a file that was just written");
        (drawn, format!("drawn from seed {}", args.seed))
    } else {
        weights(&args.network, shipped, args.weights.as_deref())?
    };
    if args.replay.is_none() {
        output::check_writable(&args.out)?;
    }
    let weights = (&weights.0, weights.1);
    let (card, result) = match &description {
        AnyDescription::Events(description) => {
            let model = Model::of(description, weights, args.ignore_preparation)?;
            let result = verify_events(args, &model)?;
            (model.card, result)
        }
        AnyDescription::Frames(description) => {
            if let Some(option) = args.for_events() {
                let (fits, network) = ("networks over events".to_owned(), args.network.clone());
                return Err(CliError::Misfit { option, fits, network, kind: "a frame network" });
            }
            let (network, card) =
                frame_network(description, weights, Convolution::Direct, args.ignore_preparation)?;
            let result = verify_frame_network(args, network)?;
            (card, result)
        }
    };
    report(args, card, &result)
}

/// Random streams and recordings, or a stream to replay.
fn verify_events(args: &VerifyArgs, model: &Model) -> Result<Verified, CliError> {
    let network = Arc::new(model.network.clone());
    let mut verified = Verified::default();
    if let Some(path) = &args.replay {
        let stream = Stream::<Event>::parse(&read(path)?)?;
        let again = replay(network, stream, poisoned);
        verified.note(args, &path.display().to_string(), again)?;
        return Ok(verified);
    }
    let mut recordings = Vec::with_capacity(args.recordings.len());
    for path in &args.recordings {
        let source =
            args.read.open(Some(path), args.sensor.is_some(), true)?.every(model.card.network.stride);
        let (name, sensor) = (source.name.clone(), source.sensor(args.sensor)?);
        recordings.push((name, sensor, source.collect::<Result<Vec<Event>, _>>()?));
    }
    let sensor = args.sensor.or(recordings.first().map(|(_, sensor, _)| *sensor));
    let tasks = Progress::tasks(args.cases + recordings.len() as u64, args.json);
    tasks.start(RANDOM.to_owned());
    let random = verify_with(Arc::clone(&network), sensor, args.settings(), poisoned, |_| tasks.done());
    verified.note(args, RANDOM, random)?;
    for (name, sensor, events) in recordings {
        if verified.mismatch.is_some() {
            break;
        }
        tasks.start(name.clone());
        let result = verify_recording(Arc::clone(&network), sensor, &events, args.settings());
        verified.note(args, &name, result)?;
        tasks.done();
    }
    tasks.finish();
    Ok(verified)
}

/// Random sequences of frames, or a sequence to replay.
fn verify_frame_network(args: &VerifyArgs, network: Arc<FrameNetwork>) -> Result<Verified, CliError> {
    let mut verified = Verified::default();
    if let Some(path) = &args.replay {
        let stream = Stream::<Vec<f32>>::parse(&read(path)?, network.input().values())?;
        let again = replay_frames(network, stream, FrameEngine::new);
        verified.note(args, &path.display().to_string(), again)?;
        return Ok(verified);
    }
    let tasks = Progress::tasks(args.cases, args.json);
    tasks.start(RANDOM.to_owned());
    let random = verify_frames(network, args.settings(), |_| tasks.done());
    tasks.finish();
    verified.note(args, RANDOM, random)?;
    Ok(verified)
}

fn read(path: &Path) -> Result<String, CliError> {
    let failed = |source| IoError::File { action: "read", path: path.to_owned(), source };
    Ok(fs::read_to_string(path).map_err(|source| PipelineError::File(failed(source)))?)
}

fn report(args: &VerifyArgs, card: ModelCard, result: &Verified) -> Result<(), CliError> {
    let mut out = Folded::new(io::stdout().lock(), !args.json);
    let names = result.checks.iter().map(|check| check.name.as_str());
    let names: Vec<&str> = names.chain(result.mismatch.as_ref().map(|found| found.name.as_str())).collect();
    if args.json {
        let header = Header::new("verify", InputCard::other(&names.join(", "), "streams"), card);
        out.write_all(&output::json(&Document { header, seed: args.seed, result })?)?;
    } else {
        header::write_model(&mut out, &card, "incremental against full recomputation, bit for bit", None)?;
        writeln!(out)?;
        for Check { name, summary } in &result.checks {
            let [cases, inputs, comparisons, rows] =
                [summary.cases, summary.inputs, summary.comparisons, summary.rows].map(grouped);
            writeln!(
                out,
                "{name}: equal over {cases} streams of {inputs} inputs, at {comparisons} comparisons of {rows} rows"
            )?;
            if summary.refused > 0 {
                let refused = grouped(summary.refused);
                writeln!(out, "{name}: at {refused} comparisons the same layer computed NaN on both sides")?;
            }
        }
    }
    out.flush()?;
    result.mismatch.as_ref().map_or(Ok(()), |Found { name, file, difference, .. }| {
        let (network, name) = (args.network.clone(), name.clone());
        Err(CliError::Differs { network, name, file: file.clone(), difference: difference.clone() })
    })
}
