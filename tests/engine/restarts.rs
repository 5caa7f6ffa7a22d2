//! A clock that restarts, single stamps far ahead, and what is held until they are decided.

use meissner_engine::{Engine, Event, MAX_SILENCE_US, Options, RestartPolicy};
use meissner_verify::CheckedEngine;
use meissner_verify::bits;
use proptest::prelude::*;

use crate::stream::{ALL, EVERY, SENSOR, SPAN_US, checked, shape};

/// A restart of the clock: three events of an old clock, and ten of a new one.
fn restart() -> Vec<Event> {
    let times = [1_729_000_000, 1_729_000_100, 1_729_000_200].into_iter().chain((0..10).map(|i| 10 * i));
    times.enumerate().map(|(i, t_us)| Event::new(t_us, i as u16 % 40, 3, i % 2 == 0)).collect()
}

#[test]
fn a_clock_that_restarts_resets_the_engine_and_every_event_of_the_new_clock_enters() {
    for candidates in EVERY {
        let (mut stream, mut fresh) = (checked(candidates), checked(candidates));
        for event in restart() {
            stream.push(event);
            assert_eq!(stream.compare(), Ok(()), "{candidates:?}");
        }
        for &event in &restart()[3..] {
            fresh.push(event);
        }
        let counters = stream.engine.counters().events;
        assert_eq!((counters.restarts, counters.accepted, counters.late), (1, 13, 0), "{candidates:?}");
        assert_eq!((stream.engine.epoch_us(), stream.engine.now_us()), (Some(0), Some(90)), "{candidates:?}");
        let values = |stream: &mut CheckedEngine| bits(stream.engine.predict().expect("finite").values);
        assert_eq!(values(&mut stream), values(&mut fresh), "{candidates:?}");
    }
}

#[test]
fn a_single_stamp_in_the_far_future_neither_enters_nor_moves_the_clock() {
    let mut stream = checked(ALL);
    for t_us in [0, 1, 900_000_000_000_000, 2, 3] {
        stream.push(Event::new(t_us, 1, 1, true));
        assert_eq!(stream.compare(), Ok(()));
    }
    let counters = stream.engine.counters().events;
    assert_eq!((counters.pushed, counters.accepted, counters.outliers), (5, 4, 1));
    assert_eq!(stream.engine.now_us(), Some(3));
}

#[test]
fn with_keep_the_events_of_a_new_clock_are_late() {
    let options = Options::new().with_restart(RestartPolicy::Keep);
    let mut engine = Engine::with_options(shape(ALL).build(), SENSOR, options).expect("the network is exact");
    assert_eq!(engine.push_slice(&restart()), 3);
    assert_eq!((engine.event_counters().late, engine.event_counters().restarts), (10, 0));
}

#[test]
fn a_snapshot_keeps_the_events_that_wait_for_a_restart_to_be_confirmed() {
    for candidates in EVERY {
        for cut in 3..13 {
            let engine = || Engine::new(shape(candidates).build(), SENSOR).expect("the network is exact");
            let (mut whole, mut copied, mut read) = (engine(), engine(), engine());
            whole.push_slice(&restart()[..cut]);
            copied.restore(&whole.snapshot()).expect("the same network");
            read.restore_bytes(&whole.to_bytes()).expect("the same network");
            for engine in [&mut whole, &mut copied, &mut read] {
                engine.push_slice(&restart()[cut..]);
            }
            let expected = bits(whole.predict().expect("finite").values);
            for engine in [&mut copied, &mut read] {
                assert_eq!(bits(engine.predict().expect("finite").values), expected, "{candidates:?} {cut}");
                assert_eq!(engine.event_counters(), whole.event_counters(), "{candidates:?} {cut}");
            }
        }
    }
}

#[test]
fn what_is_held_at_a_reset_is_counted() {
    let mut engine = Engine::new(shape(ALL).build(), SENSOR).expect("the network is exact");
    engine.push_slice(&restart()[..5]);
    engine.reset();
    assert_eq!((engine.event_counters().late, engine.held().len()), (2, 0));
    engine.push_slice(&[Event::new(0, 1, 1, true), Event::new(i64::MAX, 1, 1, true)]);
    engine.reset();
    assert_eq!((engine.event_counters().outliers, engine.event_counters().pushed), (1, 7));
}

/// A step of a stream whose clock is not to be trusted.
fn untrusted() -> impl Strategy<Value = (bool, i64)> {
    let jump = prop_oneof![
        6 => 0..40i64,
        3 => -30..0i64,
        2 => -4 * SPAN_US..-SPAN_US,
        1 => Just(-MAX_SILENCE_US),
        1 => Just(MAX_SILENCE_US + 1),
        1 => Just(50 * MAX_SILENCE_US),
    ];
    (prop::bool::weighted(0.1), jump)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn whatever_the_clock_does_the_engine_equals_batch_in_slices_and_from_bytes_too(
        kind in 0..3usize,
        steps in prop::collection::vec(untrusted(), 1..80),
        cut in 0..80usize,
    ) {
        let candidates = EVERY[kind];
        let mut stream = checked(candidates);
        let new = || Engine::new(shape(candidates).build(), SENSOR).expect("the network is exact");
        let (mut sliced, mut waiting, mut now) = (new(), Vec::new(), 0i64);
        for (index, &(advances, jump)) in steps.iter().enumerate() {
            now = now.saturating_add(jump);
            if advances {
                stream.advance(now);
                sliced.push_slice(&waiting);
                waiting.clear();
                sliced.advance(now);
            } else {
                let event = Event::new(now, index as u16 % 40, (index / 3) as u16 % 30, index % 2 == 0);
                stream.push(event);
                waiting.push(event);
            }
            prop_assert_eq!(stream.compare(), Ok(()));
            if index == cut {
                sliced.push_slice(&waiting);
                waiting.clear();
                let mut read = new();
                read.restore_bytes(&sliced.to_bytes()).expect("the same network");
                sliced = read;
            }
        }
        sliced.push_slice(&waiting);
        let counters = sliced.event_counters();
        prop_assert_eq!(counters, stream.engine.event_counters());
        let dropped: u64 = counters.dropped().iter().map(|(_, count)| count).sum();
        prop_assert_eq!(counters.pushed, counters.accepted + dropped);
        let expected = bits(stream.engine.predict().expect("finite").values);
        prop_assert_eq!(bits(sliced.predict().expect("finite").values), expected);
    }
}
