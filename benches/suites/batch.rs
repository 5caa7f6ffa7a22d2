//! A forward pass from scratch over the window of 7,006 events, graph included, on one thread.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use meissner_benches::peak::Peak;
use meissner_benches::{answers, cost, networks, streams, suite};
use meissner_engine::Stream;
use meissner_kernels::Isa;

fn batch(criterion: &mut Criterion) {
    let window = streams::window();
    let stream = Stream::new(&window.events);
    let peak = Peak::measure(Isa::best());
    let mut group = criterion.benchmark_group("batch, a window");
    group.sample_size(20);
    for name in networks::INCREMENTAL {
        let network = networks::shipped(name);
        answers::checked_engine(&network, window.sensor, &window.events);
        let batch = networks::grid_batch(&network, window.sensor);
        let cost = cost::forward(&network, &batch.forward(stream).expect("finite"));
        // Neighbour search is in the time and not in the operations.
        suite::bench(&mut group, name, cost, &peak, || _ = black_box(batch.forward(stream)));
    }
    group.finish();
}

criterion_group!(suite, batch);
criterion_main!(suite);
