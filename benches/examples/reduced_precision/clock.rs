//! Times of several computations, one after the other in every round, so that a slow moment of the machine meets all.

use std::time::{Duration, Instant};

use meissner_benches::timing::median;

const ROUNDS: usize = 41;
const SHORTEST: Duration = Duration::from_millis(1);

/// Median nanoseconds of a call of each, and each one's median ratio to the first in the same round.
pub(crate) fn interleaved(calls: &mut [&mut dyn FnMut()]) -> Vec<(f64, f64)> {
    let counts: Vec<u32> = calls.iter_mut().map(|call| repeats(call)).collect();
    let mut times = vec![Vec::new(); calls.len()];
    for _ in 0..ROUNDS {
        for ((call, &count), times) in calls.iter_mut().zip(&counts).zip(&mut times) {
            // What the others left in the caches is not timed.
            call();
            times.push(timed(count, call).as_secs_f64() * 1e9 / f64::from(count));
        }
    }
    let first = times[0].clone();
    let ratios = |times: &[f64]| times.iter().zip(&first).map(|(t, f)| t / f).collect();
    times.into_iter().map(|times| (median(times.clone()), median(ratios(&times)))).collect()
}

/// How many calls last long enough for the clock; warms up as well.
fn repeats(call: &mut dyn FnMut()) -> u32 {
    let mut count = 1;
    while timed(count, call) < SHORTEST {
        count *= 2;
    }
    count
}

fn timed(count: u32, call: &mut dyn FnMut()) -> Duration {
    let start = Instant::now();
    (0..count).for_each(|_| call());
    start.elapsed()
}
