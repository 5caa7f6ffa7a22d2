//! The beginning of each recording through each shipped network from an empty engine, with a prediction once a
//! millisecond of the recording.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use meissner_benches::{answers, networks, streams};
use meissner_engine::{Engine, Event};
use meissner_verify::bits;

/// Events taken from each recording.
const EVENTS: usize = 3_000;
const EVERY_US: i64 = 1_000;

/// Runs `events`, and returns the number of predictions.
fn run(engine: &mut Engine, events: &[Event]) -> usize {
    let mut predictions = 0;
    let mut due = events[0].t_us + EVERY_US;
    for &event in events {
        if event.t_us >= due {
            engine.predict().expect("finite");
            predictions += 1;
            due = event.t_us - (event.t_us - due) % EVERY_US + EVERY_US;
        }
        engine.push(event);
    }
    predictions
}

fn recordings(criterion: &mut Criterion) {
    for recording in streams::recordings() {
        let events = &recording.events[..EVENTS.min(recording.events.len())];
        let mut group = criterion.benchmark_group(format!("{}, first {EVENTS} events", recording.name));
        group.sample_size(10).throughput(Throughput::Elements(events.len() as u64));
        for name in networks::INCREMENTAL {
            let mut engine = answers::checked_engine(&networks::shipped(name), recording.sensor, events);
            let expected = bits(engine.predict().expect("finite").values);
            engine.reset();
            let predictions = run(&mut engine, events);
            assert_eq!(bits(engine.predict().expect("finite").values), expected, "{name}");
            group.bench_function(format!("{name}, {predictions} predictions"), |b| {
                b.iter(|| {
                    engine.reset();
                    run(&mut engine, events)
                });
            });
        }
        group.finish();
    }
}

criterion_group!(suite, recordings);
criterion_main!(suite);
