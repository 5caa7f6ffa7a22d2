//! Times of short computations, without criterion: medians over batches that are long enough for the clock.

use std::time::{Duration, Instant};

/// Median nanoseconds of a call, over `samples` batches of at least `shortest` each, after a warm-up.
///
/// # Panics
/// If there are no samples.
pub fn median_ns(samples: usize, shortest: Duration, call: impl FnMut()) -> f64 {
    median(samples_ns(samples, shortest, call))
}

/// The same, but the fastest batch: for limits, which a disturbed batch says nothing about.
pub fn least_ns(samples: usize, shortest: Duration, call: impl FnMut()) -> f64 {
    samples_ns(samples, shortest, call).into_iter().fold(f64::INFINITY, f64::min)
}

fn samples_ns(samples: usize, shortest: Duration, mut call: impl FnMut()) -> Vec<f64> {
    let mut calls = 1u32;
    // The number of calls doubles until a batch is long enough; that warms up as well.
    loop {
        if timed(calls, &mut call) >= shortest || calls >= 1 << 30 {
            break;
        }
        calls *= 2;
    }
    (0..samples).map(|_| timed(calls, &mut call).as_secs_f64() * 1e9 / f64::from(calls)).collect()
}

fn timed(calls: u32, call: &mut impl FnMut()) -> Duration {
    let start = Instant::now();
    (0..calls).for_each(|_| call());
    start.elapsed()
}

/// The middle one of `values`.
///
/// # Panics
/// If there are none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
