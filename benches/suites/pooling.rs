//! What lies behind the event level, without spline blocks above: one event into a full sliding window, then a
//! prediction. The difference to `graph_update` with the same rule, and between these figures, is the stage's cost.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use meissner_benches::lap::Lap;
use meissner_benches::{check, networks, streams};
use meissner_engine::{Candidates, Engine, Lifetime};

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
        let mut engine = Engine::new(network, window.sensor).expect("an engine");
        let mut lap = Lap::new(&window.events);
        let pushed = lap.fill(&mut engine);
        check::engine_equals_batch(&mut engine, &pushed);
        group.bench_function(name, |b| {
            b.iter(|| {
                engine.push(lap.event());
                black_box(engine.predict().expect("finite").values[0])
            });
        });
    }
    group.finish();
}

criterion_group!(suite, pooling);
criterion_main!(suite);
