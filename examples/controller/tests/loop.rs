//! The loop over a recording: every event arrives, every cycle is counted, and nothing is
//! allocated. It is alone in its program, because allocations of all threads are counted.

use std::alloc::System;
use std::net::UdpSocket;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use meissner::live::{Live, QueueOptions};
use meissner::{Description, Engine, Weights, io};
use meissner_controller::run;
use meissner_simulator::plants::{FingertipState, Phase, WristTarget};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// The loop makes more cycles than these, of a millisecond each.
const CYCLES: u64 = 200;

#[test]
fn the_loop_over_a_recording_takes_all_its_events_and_allocates_nothing() {
    let press = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../run/assets/dome_press.evt3");
    let recording = io::read(&press).expect("it is part of the repository");
    let description = Description::shipped("tactigraph-past").expect("a shipped network");
    let weights = Weights::shipped("tactigraph-past").expect("its weights");
    let network = description.network(&weights).expect("they fit");
    let engine = Engine::new(network, recording.sensor.expect("a sensor")).expect("room for its state");
    let (mut input, mut live) = Live::spawn(engine, QueueOptions::new()).expect("a thread");
    let [robot, fingertip] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").expect("a free port"));
    fingertip.set_read_timeout(Some(Duration::from_mins(1))).expect("more than nothing");
    robot.connect(fingertip.local_addr().expect("it is bound")).expect("an address");
    // A wrist on which the targets have no effect: always in a hold, at rest.
    let state = FingertipState { phase: Phase::Hold, ..FingertipState::default() };
    fingertip.send_to(&state.bytes(), robot.local_addr().expect("it is bound")).expect("it is there");

    let (events, ended) = (&recording.events, AtomicBool::new(false));
    let start = Instant::now() + Duration::from_millis(250);
    let (timing, change) = thread::scope(|scope| {
        scope.spawn(|| {
            for part in events.chunks(20) {
                let due = start + Duration::from_micros(part[0].t_us.abs_diff(events[0].t_us));
                thread::sleep(due.saturating_duration_since(Instant::now()));
                input.push_slice(part).expect("the engine lives");
            }
            // The press takes 0.31 s. A slow machine makes some of the cycles after it.
            let target = || {
                let mut bytes = [0; WristTarget::BYTES];
                fingertip.recv(&mut bytes).expect("a target in each cycle");
                WristTarget::read(&bytes).expect("a target").cycle
            };
            assert_eq!(target(), 0);
            while target() < CYCLES {}
            ended.store(true, Ordering::Release);
        });
        // The threads have started by then.
        thread::sleep(Duration::from_millis(200));
        let allocations = Region::new(ALLOCATOR);
        let rhythm = [1000, 900].map(Duration::from_micros);
        let begun = Instant::now();
        let timing = run(&mut live, &robot, &ended, rhythm, u64::MAX).expect("finite predictions");
        // No cycle begins before its time.
        assert!(begun.elapsed() >= rhythm[0] * timing.cycles as u32, "{timing:?}");
        (timing, allocations.change())
    });
    assert_eq!(change.allocations + change.reallocations, 0);
    let events = events.len() as u64;
    live.predict(Duration::MAX).expect("a finite prediction");
    assert_eq!((live.counters().delivered, live.counters().dropped()), (events, 0));
    let engine = live.close().expect("the engine's thread did not panic");
    assert_eq!(engine.counters().events.accepted, events);
    assert!(timing.cycles > CYCLES && timing.late + timing.stale <= timing.cycles, "{timing:?}");
    assert!(timing.max_answer > Duration::ZERO);
}
