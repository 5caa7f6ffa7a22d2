//! The stages after the event level, without spline blocks: one event into a full sliding window, then a prediction. The
//! difference to `graph_update` with the same rule, and between these figures, is the cost of the stage.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use meissner_benches::suite::Rounds;
use meissner_benches::{networks, streams};
use meissner_engine::{Candidates, Lifetime};

fn pooling(criterion: &mut Criterion) {
    let window = streams::window();
    let mut group = criterion.benchmark_group("pooling and readout, an event and a prediction");
    group.sample_size(30).throughput(Throughput::Elements(1));
    let frozen = Candidates::Past(Lifetime::Frozen);
    let cases = [
        ("readout, 1 channel", 1, false),
        ("readout, 32 channels", 32, false),
        ("pooled level and readout, 1 channel", 1, true),
        ("pooled level and readout, 32 channels", 32, true),
    ];
    for (name, channels, pooled) in cases {
        let network = networks::pooling_only(channels, pooled, frozen);
        let (mut rounds, mut engine) = Rounds::full(&network, &window);
        group.bench_function(name, |b| {
            b.iter(|| {
                engine.push(rounds.event());
                black_box(engine.predict().expect("finite").values[0])
            });
        });
    }
    group.finish();
}

criterion_group!(suite, pooling);
criterion_main!(suite);
