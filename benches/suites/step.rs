//! One whole step of each shipped network around 7,006 nodes: an event, what expires with it, and a prediction; and a
//! push alone.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use meissner_benches::suite::Rounds;
use meissner_benches::{networks, streams};

fn step(criterion: &mut Criterion) {
    let window = streams::window();
    let mut group = criterion.benchmark_group("step, an event");
    group.sample_size(30).throughput(Throughput::Elements(1));
    for name in networks::INCREMENTAL {
        let (mut rounds, mut engine) = Rounds::full(&networks::shipped(name), &window);
        group.bench_function(format!("{name}, push and prediction"), |b| {
            b.iter(|| {
                engine.push(rounds.event());
                black_box(engine.predict().expect("finite").values[0])
            });
        });
        group.bench_function(format!("{name}, push alone"), |b| b.iter(|| engine.push(rounds.event())));
    }
    group.finish();
}

criterion_group!(suite, step);
criterion_main!(suite);
