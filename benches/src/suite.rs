//! Shared by the criterion suites: a full window in a steady state, and costs.

use std::sync::Arc;
use std::time::{Duration, Instant};

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Throughput};
use meissner_engine::{Engine, Event, Network};

use crate::cost::Cost;
use crate::peak::Peak;
use crate::streams::{Recording, SPAN_US};
use crate::timing::checked_engine;

/// Times `call`, which costs `cost`, and prints GFLOP/s and the share of the peak.
///
/// Criterion's own throughput line counts floating-point operations: its "Gelem/s" are GFLOP/s.
pub fn bench(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    cost: Cost,
    peak: &Peak,
    mut call: impl FnMut(),
) {
    group.throughput(Throughput::Elements(cost.flops() as u64));
    // Criterion does not expose its samples. The mean of all calls is close to its estimate.
    let (mut total, mut calls) = (Duration::ZERO, 0u64);
    group.bench_function(name, |bencher| {
        bencher.iter_custom(|iterations| {
            let start = Instant::now();
            (0..iterations).for_each(|_| call());
            let elapsed = start.elapsed();
            total += elapsed;
            calls += iterations;
            elapsed
        });
    });
    // Criterion's test mode makes one call; a filter that excludes the benchmark makes none.
    if calls > 1 {
        let gflops = cost.gflops(total.as_secs_f64() * 1e9 / calls as f64);
        println!(
            "{:24}achieved {gflops:.1} GFLOP/s, {:.0} % of {}'s measured {:.1}; {:.2} operations a byte",
            "",
            peak.percent(gflops),
            peak.isa.name(),
            peak.gflops,
            cost.intensity(),
        );
    }
}

/// An endless stream with a full window: the same events in each round, each later by the span and
/// one microsecond, so that an event expires exactly when it comes again.
///
/// A steady state: as many nodes as a round has events, and one expiry per event.
#[derive(Clone, Debug)]
pub struct Rounds {
    events: Vec<Event>,
    next: usize,
    offset_us: i64,
}

impl Rounds {
    /// Rounds of `window`, and a [checked](checked_engine) engine with a full window of them.
    ///
    /// # Panics
    /// If a round does not fit the span, no engine can run `network`, or the check fails.
    pub fn full(network: &Arc<Network>, window: &Recording) -> (Self, Engine) {
        let events = window.events.clone();
        let duration = events[events.len() - 1].t_us - events[0].t_us;
        assert!(duration <= SPAN_US, "a round of {duration} us does not fit the span");
        let mut rounds = Self { events, next: 0, offset_us: 0 };
        let pushed: Vec<Event> = (0..rounds.events.len() + 50).map(|_| rounds.event()).collect();
        (rounds, checked_engine(network, window.sensor, &pushed))
    }

    /// The next event.
    pub fn event(&mut self) -> Event {
        let event = self.events[self.next];
        let out = Event { t_us: event.t_us + self.offset_us, ..event };
        self.next += 1;
        if self.next == self.events.len() {
            self.next = 0;
            self.offset_us += SPAN_US + 1;
        }
        out
    }
}
