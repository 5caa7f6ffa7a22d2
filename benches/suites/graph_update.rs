//! Graph update: one event into a full sliding window without layers, its expiries included; also where all events are of one pixel
//! at one time.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use meissner_benches::suite::Rounds;
use meissner_benches::{networks, streams};
use meissner_engine::{Candidates, Lifetime};

fn graph_update(criterion: &mut Criterion) {
    let windows = [
        ("", streams::window()),
        (", 1,000 events of one pixel at one time", streams::Recording::one_pixel(1_000)),
        (", 4,000 events of one pixel at one time", streams::Recording::one_pixel(4_000)),
    ];
    let mut group = criterion.benchmark_group("graph update, an event");
    group.sample_size(30).throughput(Throughput::Elements(1));
    let rules = [
        ("16 of all", 16, Candidates::All),
        ("8 of the past, replaced", 8, Candidates::Past(Lifetime::Window)),
        ("8 of the past, frozen", 8, Candidates::Past(Lifetime::Frozen)),
    ];
    for (name, k, candidates) in rules {
        let network = networks::graph_only(k, candidates);
        for (scene, window) in &windows {
            let (mut rounds, mut engine) = Rounds::full(&network, window);
            group.bench_function(format!("{name}{scene}"), |b| b.iter(|| engine.push(rounds.event())));
        }
    }
    group.finish();
}

criterion_group!(suite, graph_update);
criterion_main!(suite);
