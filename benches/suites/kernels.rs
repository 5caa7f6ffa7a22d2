//! Every layer kernel of the shipped networks, on every instruction set of this machine: rows of a real graph, achieved
//! GFLOP/s, share of the measured peak.

use std::hint::black_box;
use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, criterion_group, criterion_main};
use meissner_benches::peak::Peak;
use meissner_benches::{kernel_cases, networks, streams, suite};
use meissner_kernels::{Isa, SplineScratch};

/// There are many cases, and all are short.
fn shorten(group: &mut BenchmarkGroup<'_, WallTime>) {
    group.sample_size(20);
    group.warm_up_time(Duration::from_millis(300));
    group.measurement_time(Duration::from_secs(1));
}

fn splines(criterion: &mut Criterion) {
    let window = streams::window();
    for network in networks::INCREMENTAL {
        let cases = kernel_cases::splines(network, &window);
        for isa in Isa::available() {
            let peak = Peak::measure(isa);
            let mut group = criterion.benchmark_group(format!("spline rows, {network}, {}", isa.name()));
            shorten(&mut group);
            for case in &cases {
                case.check(isa);
                let (mut scratch, mut out) = (SplineScratch::default(), case.out());
                let name = format!("{} ({}), {} rows", case.layer, case.shape(), case.rows());
                suite::bench(&mut group, &name, case.cost(), &peak, || {
                    case.run(isa, &mut scratch, black_box(&mut out));
                });
            }
            group.finish();
        }
    }
}

fn denses(criterion: &mut Criterion) {
    for isa in Isa::available() {
        let peak = Peak::measure(isa);
        let mut group = criterion.benchmark_group(format!("dense, {}", isa.name()));
        shorten(&mut group);
        for case in kernel_cases::denses() {
            case.check(isa);
            let mut out = case.out();
            let name = format!("{} {} ({})", case.network, case.layer, case.shape());
            suite::bench(&mut group, &name, case.cost, &peak, || case.run(isa, black_box(&mut out)));
        }
        group.finish();
    }
}

criterion_group!(suite, splines, denses);
criterion_main!(suite);
