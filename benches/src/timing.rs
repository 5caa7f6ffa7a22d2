//! Checks of answers, and medians of times without criterion.
//!
//! Every bench compares its answer first: the time of a wrong answer is meaningless.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::{Engine, Event, Network, Options, Search, Sensor};
use meissner_reference::Difference;
use meissner_verify::CheckedEngine;

const SAMPLES: usize = 9;

/// Median nanoseconds of a call, over nine batches of at least `shortest` each, after a warm-up.
pub fn median_ns(shortest: Duration, mut call: impl FnMut()) -> f64 {
    median(samples_ns(SAMPLES, shortest, &mut call))
}

/// Nanoseconds of a call in the fastest of `samples` batches, for limits.
pub fn least_ns(samples: usize, shortest: Duration, mut call: impl FnMut()) -> f64 {
    samples_ns(samples, shortest, &mut call).into_iter().fold(f64::INFINITY, f64::min)
}

/// Median milliseconds of one call over `runs` calls, after one call to warm up.
///
/// # Errors
/// The first error that a call returns.
///
/// # Panics
/// If there are no runs.
pub fn median_ms<E>(runs: usize, mut call: impl FnMut() -> Result<(), E>) -> Result<f64, E> {
    call()?;
    let time = |_| {
        let start = Instant::now();
        call().map(|()| start.elapsed().as_secs_f64() * 1e3)
    };
    Ok(median((0..runs).map(time).collect::<Result<_, _>>()?))
}

fn samples_ns(samples: usize, shortest: Duration, call: &mut impl FnMut()) -> Vec<f64> {
    let calls = repeats(shortest, call);
    (0..samples).map(|_| timed_ns(calls, call)).collect()
}

/// The number of calls that takes at least `shortest`; finding it warms up as well.
fn repeats(shortest: Duration, call: &mut impl FnMut()) -> u32 {
    let mut calls = 1;
    while timed_ns(calls, call) * f64::from(calls) < shortest.as_secs_f64() * 1e9 && calls < 1 << 30 {
        calls *= 2;
    }
    calls
}

fn timed_ns(calls: u32, call: &mut impl FnMut()) -> f64 {
    let start = Instant::now();
    (0..calls).for_each(|_| call());
    start.elapsed().as_secs_f64() * 1e9 / f64::from(calls)
}

/// The middle one of `values`.
///
/// # Panics
/// If there are none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The largest difference of `found` from `expected`, relative to the largest expected magnitude.
pub fn relative_error<'a>(
    expected: impl IntoIterator<Item = &'a f32>,
    found: impl IntoIterator<Item = &'a f32>,
) -> f64 {
    let mut difference = Difference::default();
    for (&expected, &found) in expected.into_iter().zip(found) {
        difference.add(found, expected.into());
    }
    difference.relative()
}

/// An engine that took `events`, with the bits of the batch over all pairs.
///
/// # Panics
/// If they do not, or no engine can run `network`.
pub fn checked_engine(network: &Arc<Network>, sensor: Sensor, events: &[Event]) -> Engine {
    let mut checked =
        CheckedEngine::with_options(network.clone(), sensor, Search::Exhaustive, Options::new());
    for &event in events {
        checked.push(event);
    }
    assert_eq!(checked.compare(), Ok(()), "{}: engine and batch differ", network.name());
    checked.engine
}
