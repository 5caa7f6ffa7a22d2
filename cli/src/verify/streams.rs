//! Compares incremental results with full recomputation over random streams, recordings, or a
//! stream to replay.

use std::io::{self, Write};
use std::iter;
use std::path::Path;
use std::sync::Arc;

use meissner_engine::Event;
use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_models::{AnyDescription, Weights, drawn_file};
use meissner_run::RunError;
use meissner_run::bench::Part;
use meissner_run::model::{Model, describe_any, frame_network, weights};
use meissner_run::provenance::{Header, InputCard, ModelCard};
use meissner_run::text::grouped;
use meissner_verify::{
    Difference, Mismatch, Stream, Summary, VerifyError, poisoned, random_frames, random_streams,
    verify_frames, verify_stream,
};
use serde::Serialize;

use super::VerifyArgs;
use crate::args::READING;
use crate::error::CliError;
use crate::given::Given;
use crate::output;
use crate::predictions::write_model;
use crate::progress::Progress;

/// Arguments that fit only networks over events, like [`READING`].
pub(crate) const FOR_EVENTS: &[&str] = &["RECORDING", "--every", "--sensor", "--strict"];
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

/// The sources without a difference, and the first source with one. Nothing runs after it.
#[derive(Default, Serialize)]
pub(crate) struct Verified {
    checks: Vec<Check>,
    pub(crate) mismatch: Option<Found>,
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
pub(crate) struct Found {
    name: String,
    file: String,
    pub(crate) steps: usize,
    pub(crate) input: usize,
    pub(crate) layer: Option<String>,
    pub(crate) row: Option<usize>,
    difference: String,
}

impl Verified {
    /// Adds the result of the source `name`.
    pub(crate) fn note(
        &mut self,
        args: &VerifyArgs,
        name: String,
        result: Result<Summary, VerifyError>,
    ) -> Result<(), CliError> {
        match result {
            Ok(summary) => self.checks.push(Check { name, summary }),
            Err(VerifyError::Mismatch(mismatch)) => {
                self.differ(args, name, &mismatch, Stream::<Event>::to_text)?;
            }
            Err(VerifyError::FrameMismatch(mismatch)) => {
                self.differ(args, name, &mismatch, Stream::<Vec<f32>>::to_text)?;
            }
            Err(error) => return Err(error.into()),
        }
        Ok(())
    }

    /// Adds a mismatch, and writes its minimal stream, unless it was replayed.
    fn differ<I>(
        &mut self,
        args: &VerifyArgs,
        name: String,
        mismatch: &Mismatch<I>,
        to_text: impl Fn(&Stream<I>, &str) -> String,
    ) -> Result<(), CliError> {
        if args.streams.replay.is_none() {
            let remarks = format!("found by `meissner verify {}`\n{mismatch}", args.network());
            output::write(&args.streams.failure, to_text(&mismatch.stream, &remarks))?;
        }
        let (layer, row) = match &mismatch.difference {
            Difference::Row { layer, row, .. } => (Some(layer.clone()), Some(*row)),
            Difference::Size { layer, .. } => (Some(layer.clone()), None),
            _ => (None, None),
        };
        self.mismatch = Some(Found {
            name,
            file: args.streams.replay.as_ref().unwrap_or(&args.streams.failure).display().to_string(),
            steps: mismatch.stream.steps.len(),
            input: mismatch.input,
            layer,
            row,
            difference: mismatch.to_string(),
        });
        Ok(())
    }
}

/// Verifies, and writes the results.
pub(super) fn streams(args: &VerifyArgs, given: &Given) -> Result<(), CliError> {
    let (description, shipped) = describe_any(args.network())?;
    let weights = if args.weights.file().is_none() && !shipped {
        let drawn =
            Weights::from_bytes(&drawn_file(&description, args.seed)).expect("a file that was just written");
        (drawn, format!("drawn from seed {}", args.seed))
    } else {
        weights(args.network(), shipped, args.weights.file())?
    };
    output::check_all_writable([&args.report.out])?;
    if args.streams.replay.is_none() {
        output::check_writable(&args.streams.failure)?;
    }
    let weights = (&weights.0, weights.1);
    let (card, result) = match &description {
        AnyDescription::Events(description) => {
            let model = Model::of(description, weights, args.weights.ignore_preparation)?;
            let result = verify_events(args, &model)?;
            (model.card, result)
        }
        AnyDescription::Frames(description) => {
            if let Some(option) = given.first(FOR_EVENTS).or(given.first(READING)) {
                let (fits, network) = ("networks over events".to_owned(), args.network().to_owned());
                let option = option.to_owned();
                return Err(CliError::Misfit { option, fits, network, kind: "a frame network" });
            }
            let (network, card) =
                frame_network(description, weights, Convolution::Direct, args.weights.ignore_preparation)?;
            let result = verify_frame_network(args, &network)?;
            (card, result)
        }
    };
    report(args, &card, &result)
}

/// A name and the streams that are verified under it.
type Source<'a, I> = (String, Box<dyn Iterator<Item = Stream<I>> + 'a>);

/// The stream in a file, for `--replay`.
fn replayed<'a, I: 'a>(
    path: &Path,
    parse: impl FnOnce(&str) -> Result<Stream<I>, VerifyError>,
) -> Result<Source<'a, I>, CliError> {
    let bytes = meissner_io::read_whole(path).map_err(RunError::File)?;
    let text = String::from_utf8(bytes).map_err(|error| {
        RunError::file("read", path, io::Error::new(io::ErrorKind::InvalidData, error.utf8_error()))
    })?;
    let refused = |source| CliError::Replay { path: path.to_owned(), source: Box::new(source) };
    let stream = parse(&text).map_err(refused)?;
    Ok((path.display().to_string(), Box::new(iter::once(stream))))
}

/// Random streams and recordings, or a stream to replay.
fn verify_events(args: &VerifyArgs, model: &Model) -> Result<Verified, CliError> {
    let network = Arc::new(model.network.clone());
    let mut sources: Vec<Source<'_, Event>> = Vec::with_capacity(1 + args.recordings.len());
    if let Some(path) = &args.streams.replay {
        sources.push(replayed(path, Stream::<Event>::parse)?);
    } else {
        let (every, mut first) = (args.every.map(|every| every as usize), None);
        for path in &args.recordings {
            let source = args.read.open(Some(path), Part::default())?.every(model.card.network.stride);
            let (name, sensor) = (source.name.clone(), source.sensor(args.read.sensor)?);
            first = first.or(Some(sensor));
            let events = source.collect::<Result<Vec<Event>, _>>()?;
            let stream = move || Stream::of_recording(Some(sensor), events, every);
            sources.push((name, Box::new(iter::once_with(stream))));
        }
        let random = random_streams(&network, args.read.sensor.or(first), args.streams.cases, args.seed);
        sources.insert(0, (RANDOM.to_owned(), Box::new(random)));
    }
    run(args, sources, |stream, summary| verify_stream(&network, stream, poisoned, summary))
}

/// Random sequences of frames, or a sequence to replay.
fn verify_frame_network(args: &VerifyArgs, network: &Arc<FrameNetwork>) -> Result<Verified, CliError> {
    let values = network.input().values();
    let source = match &args.streams.replay {
        Some(path) => replayed(path, |text| Stream::<Vec<f32>>::parse(text, values))?,
        None => (RANDOM.to_owned(), Box::new(random_frames(values, args.streams.cases, args.seed)) as Box<_>),
    };
    run(args, vec![source], |stream, summary| verify_frames(network, stream, FrameEngine::new, summary))
}

/// Verifies the sources one after another, up to the first difference.
fn run<I>(
    args: &VerifyArgs,
    sources: Vec<Source<'_, I>>,
    verify: impl Fn(Stream<I>, &mut Summary) -> Result<(), VerifyError>,
) -> Result<Verified, CliError> {
    let count: usize = sources.iter().map(|(_, streams)| streams.size_hint().0).sum();
    let tasks = Progress::tasks(count as u64, args.report.format.json);
    let mut verified = Verified::default();
    for (name, mut streams) in sources {
        tasks.start(name.clone());
        let mut summary = Summary::default();
        let result = streams.try_for_each(|stream| verify(stream, &mut summary).inspect(|()| tasks.done()));
        verified.note(args, name, result.map(|()| summary))?;
        if verified.mismatch.is_some() {
            break;
        }
    }
    tasks.finish();
    Ok(verified)
}

pub(crate) fn report(args: &VerifyArgs, card: &ModelCard, result: &Verified) -> Result<(), CliError> {
    let names = result.checks.iter().map(|check| check.name.as_str());
    let names: Vec<&str> = names.chain(result.mismatch.as_ref().map(|found| found.name.as_str())).collect();
    let header = Header::new("verify", InputCard::other(&names.join(", "), "streams"), card.clone());
    output::report(&args.report, &Document { header, seed: args.seed, result }, |out| {
        write_model(out, card, "incremental against full recomputation, bit for bit", None)?;
        writeln!(out)?;
        result.checks.iter().try_for_each(|check| check.write(out))
    })?;
    result.mismatch.as_ref().map_or(Ok(()), |Found { name, file, difference, .. }| {
        let (network, name) = (args.network().to_owned(), name.clone());
        Err(CliError::Differs { network, name, file: file.clone(), difference: difference.clone() })
    })
}

impl Check {
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let Self { name, summary } = self;
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
        Ok(())
    }
}
