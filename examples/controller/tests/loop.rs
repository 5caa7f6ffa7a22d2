//! The loop over a recording: every event arrives, every cycle is counted, and nothing is allocated. Alone in its program, because
//! allocations are those of all threads.

use std::alloc::System;
use std::path::Path;
use std::time::Duration;

use meissner::live::{Live, QueueOptions};
use meissner::{Description, Engine, Weights, io};
use meissner_controller::control::{Alone, Rhythm, run};
use meissner_controller::feed::{Feed, Source};
use meissner_controller::metered::{Meter, Metered};
use meissner_controller::realtime::{now, sleep_until};
use meissner_controller::timing::Timing;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

#[test]
fn the_loop_over_a_recording_takes_all_its_events_and_allocates_nothing() {
    let press = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../pipeline/assets/dome_press.evt3");
    let recording = io::read(&press).expect("it is part of the repository");
    let description = Description::shipped("tactigraph-past").expect("a shipped network");
    let weights = Weights::shipped("tactigraph-past").expect("its weights");
    let network = description.network(&weights).expect("they fit");
    let engine = Engine::new(network, recording.sensor.expect("a sensor")).expect("room for its state");

    let meter = Meter::default();
    let (input, mut live) =
        Live::spawn(Metered::new(engine, meter.clone()), QueueOptions::new()).expect("a thread");
    let events = recording.events.len() as u64;
    let ready = now() + Duration::from_millis(200);
    let start = ready + Duration::from_millis(50);
    let feed = Feed::start(Source::Recording(recording.events), input, start).expect("a thread");
    let rhythm = Rhythm {
        start,
        period: Duration::from_millis(1),
        deadline: Duration::from_micros(900),
        most: u64::MAX,
    };
    let (mut timing, mut robot) = (Timing::default(), Alone::default());
    sleep_until(ready);
    let allocations = Region::new(ALLOCATOR);
    run(&mut live, &meter, &feed, &mut robot, rhythm, &mut timing).expect("finite predictions");
    let change = allocations.change();

    assert_eq!(change.allocations + change.reallocations, 0);
    assert_eq!(feed.end().expect("the engine lives").events, events);
    live.predict(Duration::MAX).expect("a finite prediction");
    assert_eq!((live.counters().delivered, live.counters().dropped()), (events, 0));
    let engine = live.close().expect("the engine's thread did not panic");
    assert_eq!(engine.engine().counters().events.accepted, events);
    assert_eq!((timing.cycles, timing.cycles), (timing.wake_ns.len(), timing.answer_ns.len()));
    // The press takes 0.31 s; the last cycle may come late.
    assert!(timing.cycles > 200, "{}", timing.cycles);
    assert!(meter.read() > Duration::ZERO && robot.wrist.angles() != [0.0, 0.0]);
}
