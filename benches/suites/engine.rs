//! Engines event by event: graph update, stages after the event level, a step, recordings.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use meissner_benches::suite::Rounds;
use meissner_benches::{networks, streams, timing};
use meissner_engine::{Candidates, Engine, Event, Lifetime};
use meissner_verify::bits;

/// One event into a full sliding window without layers, including its expiries.
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

/// One event into a full window without spline blocks, then a prediction. The difference to
/// `graph_update` with the same rule, and between these figures, is the cost of the stage.
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

/// One step of each shipped network around 7,006 nodes with a prediction, and a push alone.
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

/// The start of each recording from an empty engine, with a prediction once a millisecond.
fn recordings(criterion: &mut Criterion) {
    for recording in streams::recordings() {
        let events = &recording.events[..EVENTS.min(recording.events.len())];
        let mut group = criterion.benchmark_group(format!("{}, first {EVENTS} events", recording.name));
        group.sample_size(10).throughput(Throughput::Elements(events.len() as u64));
        for name in networks::INCREMENTAL {
            let mut engine = timing::checked_engine(&networks::shipped(name), recording.sensor, events);
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

criterion_group!(suite, graph_update, pooling, step, recordings);
criterion_main!(suite);
