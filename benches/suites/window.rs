//! The window of 7,006 events from scratch, on one thread: neighbour search, and a forward pass.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use meissner_benches::peak::Peak;
use meissner_benches::{cost, networks, streams, suite, timing};
use meissner_engine::{Batch, Candidates, Lifetime, Search, Stream};
use meissner_kernels::Isa;

/// The engine's grid of pixels against a k-d tree with the same exact order.
fn neighbours(criterion: &mut Criterion) {
    let window = streams::window();
    let stream = Stream::new(&window.events);
    let batch = |k, candidates| networks::grid_batch(&networks::graph_only(k, candidates), window.sensor);
    let lists = |batch: &Batch| -> Vec<Vec<u32>> {
        let trace = batch.forward(stream).expect("finite");
        let edges = &trace.levels[0].edges;
        (0..edges.rows()).map(|row| edges.row(row).iter().map(|n| n.row).collect()).collect()
    };
    let all = batch(16, Candidates::All);
    let tree = all.clone().with_search(networks::TREE);
    assert_eq!(lists(&all), lists(&tree), "grid and tree differ");
    let past = batch(8, Candidates::Past(Lifetime::Frozen));
    let pairs = past.clone().with_search(Search::Exhaustive);
    assert_eq!(lists(&past), lists(&pairs), "grid and all pairs differ");

    let mut group = criterion.benchmark_group("neighbour search, a window");
    group.sample_size(20).throughput(Throughput::Elements(window.events.len() as u64));
    group.bench_function("grid, 16 of all, with attributes", |b| b.iter(|| black_box(all.forward(stream))));
    group.bench_function("k-d tree, 16 of all, with attributes", |b| {
        b.iter(|| black_box(tree.forward(stream)));
    });
    group.bench_function("grid, 8 of the past, with attributes", |b| {
        b.iter(|| black_box(past.forward(stream)));
    });
    group.finish();
}

/// A forward pass, including the graph.
fn batch(criterion: &mut Criterion) {
    let window = streams::window();
    let stream = Stream::new(&window.events);
    let peak = Peak::measure(Isa::best());
    let mut group = criterion.benchmark_group("batch, a window");
    group.sample_size(20);
    for name in networks::INCREMENTAL {
        let network = networks::shipped(name);
        timing::checked_engine(&network, window.sensor, &window.events);
        let batch = networks::grid_batch(&network, window.sensor);
        let cost = cost::forward(&network, &batch.forward(stream).expect("finite"));
        // The time includes the neighbour search, but the operations do not.
        suite::bench(&mut group, name, cost, &peak, || _ = black_box(batch.forward(stream)));
    }
    group.finish();
}

criterion_group!(suite, neighbours, batch);
criterion_main!(suite);
