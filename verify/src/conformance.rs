//! Claims that hold for every engine: also in a thread, behind a C interface, in another process.
//!
//! Each claim is a function over the steps of a stream and makes new engines; the error names the
//! step. [`predicts`], [`takes_slices`] and [`forgets`] need only a [`Predictor`]; [`resumes`] and
//! [`refuses_damage`] also need its states.

use std::fmt::{Debug, Display};

use meissner_engine::{EngineError, EventCounters, Prediction, Predictor};

use crate::error::bits;
use crate::incremental::Incremental;
use crate::stream::Step;

/// The visible state of a predictor: its prediction as bits, with time, number of nodes, and how
/// unlike its input is; and its counts.
type Shown = (Result<(Vec<u32>, Option<i64>, usize, Option<u32>), EngineError>, EventCounters);

fn show<P: Predictor>(predictor: &mut P) -> Shown {
    let shown = |p: Prediction<'_>| (bits(p.values), p.t_us, p.nodes, p.unlike.map(f32::to_bits));
    let prediction = predictor.predict().map(shown);
    (prediction, predictor.event_counters())
}

/// Performs a step, unless it reads a prediction or a state.
fn act<P: Predictor>(predictor: &mut P, step: &Step<P::Input>) -> Result<(), String> {
    match step {
        Step::Push(input) => drop(predictor.push(input).map_err(|error| format!("push: {error}"))?),
        Step::Advance(t_us) => predictor.advance(*t_us),
        Step::Reset => predictor.reset(),
        Step::Predict | Step::Snapshot | Step::Bytes => {}
    }
    Ok(())
}

fn at(step: usize) -> impl Fn(String) -> String {
    move |error| format!("step {step}: {error}")
}

fn equal<T: PartialEq + Debug>(found: &T, expected: &T) -> Result<(), String> {
    if found == expected { Ok(()) } else { Err(format!("expected {expected:?}, found {found:?}")) }
}

fn done<T>(result: Result<T, impl Display>) -> Result<T, String> {
    result.map_err(|error| error.to_string())
}

/// Both predict the same, bit for bit, and count the same.
///
/// # Errors
/// The first difference.
pub fn predicts<P: Predictor, O: Predictor<Input = P::Input>>(
    predictor: &mut P,
    oracle: &mut O,
    steps: &[Step<P::Input>],
) -> Result<(), String> {
    for (i, step) in steps.iter().chain([&Step::Predict]).enumerate() {
        act(predictor, step).and_then(|()| act(oracle, step)).map_err(at(i))?;
        if step.is_compared() {
            equal(&show(predictor), &show(oracle)).map_err(at(i))?;
        }
    }
    Ok(())
}

/// A slice has the same effect as its inputs one by one; `cuts` are lengths of slices, in turn.
///
/// # Errors
/// The first difference.
pub fn takes_slices<P: Predictor<Input: Clone>>(
    make: impl Fn() -> P,
    steps: &[Step<P::Input>],
    cuts: &[usize],
) -> Result<(), String> {
    let [mut sliced, mut single] = [make(), make()];
    let (mut waiting, mut cuts) = (Vec::new(), cuts.iter().copied().cycle());
    let mut length = cuts.next().unwrap_or(usize::MAX);
    for (i, step) in steps.iter().chain([&Step::Predict]).enumerate() {
        act(&mut single, step).map_err(at(i))?;
        if let Step::Push(input) = step {
            waiting.push(input.clone());
            if waiting.len() < length {
                continue;
            }
        }
        done(sliced.push_slice(&waiting)).map_err(at(i))?;
        waiting.clear();
        length = cuts.next().unwrap_or(usize::MAX);
        if step.input().is_none() {
            act(&mut sliced, step).map_err(at(i))?;
        }
        if step.is_compared() {
            equal(&show(&mut sliced), &show(&mut single)).map_err(at(i))?;
        }
    }
    Ok(())
}

/// An engine that has forgotten a stream behaves like a new one, but its counts continue.
///
/// # Errors
/// The first difference.
pub fn forgets<P: Predictor>(make: impl Fn() -> P, steps: &[Step<P::Input>]) -> Result<(), String> {
    let [mut used, mut new] = [make(), make()];
    for step in steps {
        act(&mut used, step)?;
        if step.is_compared() {
            let _ = used.predict();
        }
    }
    used.reset();
    let before = used.event_counters();
    equal(&show(&mut used).0, &show(&mut new).0).map_err(|error| format!("after the reset: {error}"))?;
    for (i, step) in steps.iter().chain([&Step::Predict]).enumerate() {
        act(&mut used, step).and_then(|()| act(&mut new, step)).map_err(at(i))?;
        if step.is_compared() {
            let (prediction, counters) = show(&mut used);
            equal(&(prediction, counters.since(before)), &show(&mut new)).map_err(at(i))?;
        }
    }
    Ok(())
}

/// An engine that returns to a state, from memory or from bytes, continues like the engine of that
/// state. The stream is cut after the step `cut`; the engine from bytes is written and read again
/// where the stream has such a step.
///
/// # Errors
/// The first difference.
pub fn resumes<E: Incremental>(
    make: impl Fn() -> E,
    steps: &[Step<E::Input>],
    cut: usize,
) -> Result<(), String> {
    let (before, after) = steps.split_at(cut.min(steps.len()));
    let [mut whole, mut copied, mut read] = [make(), make(), make()];
    for (i, step) in before.iter().enumerate() {
        act(&mut whole, step).map_err(at(i))?;
        if step.is_compared() {
            let _ = whole.predict();
        }
    }
    // Other inputs in between: the stream from there on.
    for step in after.iter().take(8) {
        act(&mut copied, step).and_then(|()| act(&mut read, step))?;
    }
    done(copied.restore(&whole.snapshot())).map_err(|error| format!("restore: {error}"))?;
    let bytes = whole.to_bytes();
    done(read.restore_bytes(&bytes)).map_err(|error| format!("restore_bytes: {error}"))?;
    for of in [&copied, &read] {
        equal(&of.to_bytes(), &bytes).map_err(|_| "what is restored is not written as it was".to_owned())?;
    }
    for (i, step) in after.iter().chain([&Step::Predict]).enumerate() {
        if matches!(step, Step::Snapshot | Step::Bytes) {
            done(read.through_bytes()).map_err(at(i))?;
        }
        for of in [&mut whole, &mut copied, &mut read] {
            act(of, step).map_err(at(i))?;
        }
        if step.is_compared() {
            let expected = show(&mut whole);
            equal(&show(&mut copied), &expected).map_err(at(i))?;
            equal(&show(&mut read), &expected).map_err(at(i))?;
        }
    }
    Ok(())
}

/// The engine refuses bytes that are cut at `place` (0 to 1) or have a bit flipped there, and
/// changes nothing.
///
/// # Errors
/// Damage that was not refused, or that changed the engine.
pub fn refuses_damage<E: Incremental>(
    make: impl Fn() -> E,
    steps: &[Step<E::Input>],
    place: f64,
    bit: u32,
) -> Result<(), String> {
    let mut engine = make();
    steps.iter().try_for_each(|step| act(&mut engine, step))?;
    let bytes = engine.to_bytes();
    let byte = ((bytes.len() as f64 * place) as usize).min(bytes.len() - 1);
    let mut flipped = bytes.clone();
    flipped[byte] ^= 1 << (bit % 8);
    for wrong in [&bytes[..byte], &flipped] {
        match engine.restore_bytes(wrong) {
            Err(EngineError::Snapshot { .. } | EngineError::SnapshotBytes { .. }) => {}
            other => return Err(format!("{} of {} bytes: {other:?}", wrong.len(), bytes.len())),
        }
        equal(&engine.to_bytes(), &bytes).map_err(|_| "refused bytes changed the state".to_owned())?;
    }
    Ok(())
}
