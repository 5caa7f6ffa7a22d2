//! A criterion benchmark that knows its operations: beside criterion's time it prints GFLOP/s and the share of the
//! peak that was measured in the same run.
//!
//! Criterion's own throughput line counts floating-point operations: its "Gelem/s" are GFLOP/s.

use std::time::{Duration, Instant};

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Throughput};

use crate::cost::Cost;
use crate::peak::Peak;

/// Times `call`, which costs `cost`, and prints what it achieves.
pub fn bench(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    cost: Cost,
    peak: &Peak,
    mut call: impl FnMut(),
) {
    group.throughput(Throughput::Elements(cost.flops() as u64));
    // Criterion keeps its samples to itself; the mean of all but the warm-up's first calls is close to its estimate.
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
    // One call is criterion's test mode, which times nothing; none, a filter.
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
