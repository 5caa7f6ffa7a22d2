//! Every layer kernel of the shipped networks on every instruction set, over rows of a real graph:
//! GFLOP/s, share of the measured peak.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use meissner_benches::kernel_cases::{self, KernelCase};
use meissner_benches::peak::Peak;
use meissner_benches::{networks, streams, suite};
use meissner_kernels::{Isa, SplineScratch};

/// One group of `cases` for each instruction set.
fn groups(criterion: &mut Criterion, title: &str, cases: &[KernelCase], name: fn(&KernelCase) -> String) {
    for isa in Isa::available() {
        let peak = Peak::measure(isa);
        let mut group = criterion.benchmark_group(format!("{title}, {}", isa.name()));
        // There are many cases, and all are short.
        group.sample_size(20);
        group.warm_up_time(Duration::from_millis(300));
        group.measurement_time(Duration::from_secs(1));
        for case in cases {
            case.check(isa);
            let (mut scratch, mut out) = (SplineScratch::default(), case.out());
            suite::bench(&mut group, &name(case), case.cost, &peak, || {
                case.run(isa, &mut scratch, black_box(&mut out));
            });
        }
        group.finish();
    }
}

fn splines(criterion: &mut Criterion) {
    let window = streams::window();
    for network in networks::INCREMENTAL {
        let name = |case: &KernelCase| format!("{} ({}), {} rows", case.layer, case.shape, case.rows);
        let cases = kernel_cases::splines(network, &window);
        groups(criterion, &format!("spline rows, {network}"), &cases, name);
    }
}

fn denses(criterion: &mut Criterion) {
    let name = |case: &KernelCase| format!("{} {} ({})", case.network, case.layer, case.shape);
    groups(criterion, "dense", &kernel_cases::denses(), name);
}

criterion_group!(suite, splines, denses);
criterion_main!(suite);
