//! Runs networks over random streams and recordings, and shrinks the first stream on which results differ.

use std::sync::Arc;

use meissner_engine::frames::{FrameEngine, FrameNetwork};
use meissner_engine::{EngineError, Event, Network, Search, Sensor};
use meissner_models::random::Random;

use crate::checked::{CheckedEngine, poisoned};
use crate::checked_frames::CheckedFrames;
use crate::difference::Difference;
use crate::error::VerifyError;
use crate::incremental::{Checked, Incremental, IncrementalEvents};
use crate::mismatch::{Mismatch, Settings, Summary};
use crate::random_frames::random_frames;
use crate::random_stream::random_stream;
use crate::shrink::{Shrink, shrink};
use crate::step::{Step, Stream};

/// Comparisons that are spread over a recording unless [`Settings::every`] says otherwise.
const COMPARISONS: usize = 64;

/// Where and how a stream shows a difference.
struct Failure {
    /// Steps up to the difference.
    steps: usize,
    difference: Difference,
}

/// Verifies the engine of `network` on `cases` random streams of `seed`: on sensors of several sizes, or on `sensor`.
///
/// # Errors
/// [`VerifyError::Mismatch`] with a minimal stream, or [`VerifyError::Engine`] if the engine refuses the network.
pub fn verify(
    network: impl Into<Arc<Network>>,
    sensor: Option<Sensor>,
    cases: u64,
    seed: u64,
) -> Result<Summary, VerifyError> {
    verify_with(network, sensor, Settings { cases, seed, every: None }, poisoned, |_| {})
}

/// As [`verify`], for the engine that `engine` makes. `progress` is told how many cases are done.
///
/// # Errors
/// As [`verify`].
pub fn verify_with<E: IncrementalEvents>(
    network: impl Into<Arc<Network>>,
    sensor: Option<Sensor>,
    settings: Settings,
    engine: impl Fn(Arc<Network>, Sensor) -> Result<E, EngineError>,
    mut progress: impl FnMut(u64),
) -> Result<Summary, VerifyError> {
    let network = network.into();
    let mut summary = Summary::default();
    for case in 0..settings.cases {
        let mut random = random_of(settings.seed, case);
        let stream = random_stream(&network, sensor, &mut random);
        events(&network, &engine, Search::Exhaustive, stream, &mut summary)?;
        progress(case + 1);
    }
    Ok(summary)
}

/// Each case is determined by seed and number alone.
fn random_of(seed: u64, case: u64) -> Random {
    Random::new(Random::new(seed).bits() ^ Random::new(!case).bits())
}

/// Verifies the engine of `network` on a recording: the engine takes all events, and is compared every
/// [`Settings::every`] events. The batch searches neighbours with a k-d tree and orders them by their exact distance.
///
/// # Errors
/// As [`verify`].
pub fn verify_recording(
    network: impl Into<Arc<Network>>,
    sensor: Sensor,
    recording: &[Event],
    settings: Settings,
) -> Result<Summary, VerifyError> {
    let every = settings.every.unwrap_or(recording.len().div_ceil(COMPARISONS)).max(1);
    let mut steps = Vec::with_capacity(recording.len() + recording.len() / every);
    for (i, &event) in recording.iter().enumerate() {
        steps.push(Step::Push(event));
        if (i + 1) % every == 0 {
            steps.push(Step::Predict);
        }
    }
    let stream = Stream { sensor: Some(sensor), capacity: None, steps };
    let (network, mut summary) = (network.into(), Summary::default());
    let search = Search::Proposed(meissner_reference::PROPOSE);
    events(&network, poisoned, search, stream, &mut summary)?;
    Ok(summary)
}

/// Runs a stream that a mismatch was shrunk to, with the engine that `engine` makes.
///
/// # Errors
/// As [`verify`].
pub fn replay<E: IncrementalEvents>(
    network: impl Into<Arc<Network>>,
    stream: Stream,
    engine: impl Fn(Arc<Network>, Sensor) -> Result<E, EngineError>,
) -> Result<Summary, VerifyError> {
    let mut summary = Summary::default();
    events(&network.into(), engine, Search::Exhaustive, stream, &mut summary)?;
    Ok(summary)
}

/// Verifies one stream of events.
fn events<E: IncrementalEvents>(
    network: &Arc<Network>,
    engine: impl Fn(Arc<Network>, Sensor) -> Result<E, EngineError>,
    search: Search,
    stream: Stream,
    summary: &mut Summary,
) -> Result<(), VerifyError> {
    let sensor = stream.sensor.unwrap_or(Sensor::new(0, 0));
    let network = match stream.capacity {
        Some(capacity) => Arc::new(Network::clone(network).with_capacity(capacity)?),
        None => Arc::clone(network),
    };
    let make = || {
        let checked =
            CheckedEngine::of(engine(Arc::clone(&network), sensor)?, Arc::clone(&network), sensor, search)?;
        Ok(checked.with_bounded_memory())
    };
    run_stream(stream, make, summary)?
        .map_or(Ok(()), |mismatch| Err(VerifyError::Mismatch(Box::new(mismatch))))
}

/// Verifies a frame network on `settings.cases` random sequences of frames: an engine that skips values that no change
/// reaches against one that computes every value of every frame. `progress` is told how many cases are done.
///
/// # Errors
/// [`VerifyError::FrameMismatch`] with a minimal sequence, or [`VerifyError::Engine`] if the engine refuses the network.
pub fn verify_frames(
    network: impl Into<Arc<FrameNetwork>>,
    settings: Settings,
    progress: impl FnMut(u64),
) -> Result<Summary, VerifyError> {
    verify_frames_with(network, settings, FrameEngine::new, progress)
}

/// As [`verify_frames`], for the engine that `engine` makes.
///
/// # Errors
/// As [`verify_frames`].
pub fn verify_frames_with<E: Incremental<Input = Vec<f32>>>(
    network: impl Into<Arc<FrameNetwork>>,
    settings: Settings,
    engine: impl Fn(Arc<FrameNetwork>) -> Result<E, EngineError>,
    mut progress: impl FnMut(u64),
) -> Result<Summary, VerifyError> {
    let (network, mut summary) = (network.into(), Summary::default());
    for case in 0..settings.cases {
        let steps = random_frames(network.input().values(), &mut random_of(settings.seed, case));
        frames(&network, &engine, Stream { sensor: None, capacity: None, steps }, &mut summary)?;
        progress(case + 1);
    }
    Ok(summary)
}

/// As [`replay`], for a frame network.
///
/// # Errors
/// As [`verify_frames`].
pub fn replay_frames<E: Incremental<Input = Vec<f32>>>(
    network: impl Into<Arc<FrameNetwork>>,
    stream: Stream<Vec<f32>>,
    engine: impl Fn(Arc<FrameNetwork>) -> Result<E, EngineError>,
) -> Result<Summary, VerifyError> {
    let mut summary = Summary::default();
    frames(&network.into(), engine, stream, &mut summary)?;
    Ok(summary)
}

/// Verifies one sequence of frames.
fn frames<E: Incremental<Input = Vec<f32>>>(
    network: &Arc<FrameNetwork>,
    engine: impl Fn(Arc<FrameNetwork>) -> Result<E, EngineError>,
    stream: Stream<Vec<f32>>,
    summary: &mut Summary,
) -> Result<(), VerifyError> {
    let make = || CheckedFrames::of(engine(Arc::clone(network))?, Arc::clone(network));
    run_stream(stream, make, summary)?
        .map_or(Ok(()), |mismatch| Err(VerifyError::FrameMismatch(Box::new(mismatch))))
}

/// Verifies `stream` on a new engine, and counts it. If results differ, the stream is shrunk.
fn run_stream<C: Checked>(
    stream: Stream<C::Input>,
    make: impl Fn() -> Result<C, EngineError>,
    summary: &mut Summary,
) -> Result<Option<Mismatch<C::Input>>, EngineError>
where
    C::Input: Shrink,
{
    let mut checked = make()?;
    let Some(failure) = run(&mut checked, &stream.steps) else {
        let (rows, refused) = checked.counts();
        summary.cases += 1;
        summary.inputs += stream.steps.iter().filter_map(Step::input).count() as u64;
        summary.comparisons += 1 + stream.steps.iter().filter(|step| compares(step)).count() as u64;
        summary.rows += rows;
        summary.refused += refused;
        return Ok(None);
    };
    let found_in = stream.steps.len();
    let mut difference = failure.difference;
    let mut steps = stream.steps;
    steps.truncate(failure.steps);
    let steps = shrink(steps, |steps| {
        // The engine was made before with the same arguments.
        let failure = run(&mut make().ok()?, steps)?;
        difference = failure.difference;
        Some(failure.steps)
    });
    // The last stream that was tried need not be the one that is kept.
    let last = run(&mut make()?, &steps);
    difference = last.map_or(difference, |failure| failure.difference);
    let input = steps.iter().filter_map(Step::input).count();
    Ok(Some(Mismatch { difference, input, stream: Stream { steps, ..stream }, found_in }))
}

/// Whether everything is compared after `step`.
fn compares<I>(step: &Step<I>) -> bool {
    !matches!(step, Step::Push(_) | Step::Advance(_))
}

/// Runs `steps`, comparing after every step but inputs and moves of time, and at the end. The first difference.
fn run<C: Checked>(checked: &mut C, steps: &[Step<C::Input>]) -> Option<Failure> {
    for (i, step) in steps.iter().enumerate() {
        let done = checked.step(step).and_then(|()| if compares(step) { checked.compare() } else { Ok(()) });
        if let Err(difference) = done {
            return Some(Failure { steps: i + 1, difference });
        }
    }
    checked.compare().err().map(|difference| Failure { steps: steps.len(), difference })
}
