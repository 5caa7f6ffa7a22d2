//! Neighbour search from scratch: the engine's grid of pixels against a k-d tree with the same exact order, over one
//! window.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use meissner_benches::{networks, streams};
use meissner_engine::{Batch, Candidates, Lifetime, Search, Stream};

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

criterion_group!(suite, neighbours);
criterion_main!(suite);
