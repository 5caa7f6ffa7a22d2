//! Runs an engine next to its full recomputation, and shrinks the first stream with a difference.

use std::sync::Arc;

use meissner_engine::frames::FrameNetwork;
use meissner_engine::{BatchEngine, EngineError, Network, Search, Sensor};

use crate::checked::{CheckedEngine, CheckedFrames, poisoned};
use crate::error::{Difference, Mismatch, Summary, VerifyError};
use crate::incremental::{Checked, Incremental, IncrementalEvents};
use crate::random_stream::random_streams;
use crate::shrink::{Shrink, shrink};
use crate::stream::{Step, Stream};

/// Verifies the engine of `network` on `cases` random streams of `seed`, on `sensor` or several.
///
/// # Errors
/// As [`verify_stream`].
pub fn verify(
    network: impl Into<Arc<Network>>,
    sensor: Option<Sensor>,
    cases: u64,
    seed: u64,
) -> Result<Summary, VerifyError> {
    let (network, mut summary) = (network.into(), Summary::default());
    for stream in random_streams(&network, sensor, cases, seed) {
        verify_stream(&network, stream, poisoned, &mut summary)?;
    }
    Ok(summary)
}

/// Verifies the engine that `engine` makes on `stream`, and adds to `summary`. The batch compares
/// all pairs of events in small windows and searches large ones with a k-d tree.
///
/// # Errors
/// [`VerifyError::Mismatch`] with a minimal stream, or [`VerifyError::Engine`].
pub fn verify_stream<E: IncrementalEvents>(
    network: &Arc<Network>,
    stream: Stream,
    engine: impl Fn(Arc<Network>, Sensor) -> Result<E, EngineError>,
    summary: &mut Summary,
) -> Result<(), VerifyError> {
    let sensor = stream.sensor.unwrap_or(Sensor::new(0, 0));
    let network = match stream.capacity {
        Some(capacity) => Arc::new(Network::clone(network).with_capacity(capacity)?),
        None => Arc::clone(network),
    };
    let make = || {
        let engine = engine(Arc::clone(&network), sensor)?;
        let batch = BatchEngine::new(Arc::clone(&network), sensor)?;
        let search = Search::Proposed(meissner_reference::PROPOSE);
        Ok(CheckedEngine::of(engine, batch.with_search(search).with_bounded_memory()))
    };
    run_stream(stream, make, summary)
}

/// Verifies the frame engine that `engine` makes against one that computes every value of every
/// frame, and adds to `summary`.
///
/// # Errors
/// [`VerifyError::FrameMismatch`] with a minimal sequence, or [`VerifyError::Engine`].
pub fn verify_frames<E: Incremental<Input = Vec<f32>>>(
    network: &Arc<FrameNetwork>,
    stream: Stream<Vec<f32>>,
    engine: impl Fn(Arc<FrameNetwork>) -> Result<E, EngineError>,
    summary: &mut Summary,
) -> Result<(), VerifyError> {
    run_stream(stream, || CheckedFrames::of(engine(Arc::clone(network))?, Arc::clone(network)), summary)
}

/// Verifies `stream` on a new engine, and counts it. If results differ, the stream is shrunk.
fn run_stream<C: Checked>(
    stream: Stream<C::Input>,
    make: impl Fn() -> Result<C, EngineError>,
    summary: &mut Summary,
) -> Result<(), VerifyError>
where
    C::Input: Shrink,
    VerifyError: From<Box<Mismatch<C::Input>>>,
{
    let mut checked = make()?;
    let Some((end, first)) = difference(&mut checked, &stream.steps) else {
        let (rows, refused) = checked.counts();
        summary.cases += 1;
        summary.inputs += stream.steps.iter().filter_map(Step::input).count() as u64;
        summary.comparisons += 1 + stream.steps.iter().filter(|step| step.is_compared()).count() as u64;
        summary.rows += rows;
        summary.refused += refused;
        return Ok(());
    };
    let found_in = stream.steps.len();
    let mut steps = stream.steps;
    steps.truncate(end);
    // The first engine was made with the same arguments.
    let steps = shrink(steps, |steps| Some(difference(&mut make().ok()?, steps)?.0));
    let difference = difference(&mut make()?, &steps).map_or(first, |(_, difference)| difference);
    let input = steps.iter().filter_map(Step::input).count();
    Err(Box::new(Mismatch { difference, input, stream: Stream { steps, ..stream }, found_in }).into())
}

/// Runs `steps` with comparisons: the first difference, and the number of steps up to it.
fn difference<C: Checked>(checked: &mut C, steps: &[Step<C::Input>]) -> Option<(usize, Difference)> {
    for (i, step) in steps.iter().enumerate() {
        let done =
            checked.step(step).and_then(|()| if step.is_compared() { checked.compare() } else { Ok(()) });
        if let Err(difference) = done {
            return Some((i + 1, difference));
        }
    }
    checked.compare().err().map(|difference| (steps.len(), difference))
}
