//! A clock that restarts, single stamps far ahead, and the events that are held until a decision.

use meissner_engine::{Engine, Event, LatePolicy, Options, RestartPolicy};
use meissner_verify::CheckedEngine;
use meissner_verify::bits;

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
fn what_is_held_at_a_reset_is_counted() {
    let mut engine = Engine::new(shape(ALL).build(), SENSOR).expect("the network is exact");
    engine.push_slice(&restart()[..5]);
    engine.reset();
    assert_eq!((engine.event_counters().late, engine.held().len()), (2, 0));
    engine.push_slice(&[Event::new(0, 1, 1, true), Event::new(i64::MAX, 1, 1, true)]);
    engine.reset();
    assert_eq!((engine.event_counters().outliers, engine.event_counters().pushed), (1, 7));
}

/// Found by the claims: rows of events that a reset still took were computed after it.
#[test]
fn late_events_that_a_reset_takes_leave_nothing_behind() {
    for candidates in EVERY {
        let options = Options::new().with_late(LatePolicy::Clamp).with_poison(true);
        let engine = || Engine::with_options(shape(candidates).build(), SENSOR, options).expect("exact");
        let (mut used, mut new) = (engine(), engine());
        used.push_slice(&[0, 0, -SPAN_US - 2].map(|t_us| Event::new(t_us, 0, 0, false)));
        used.reset();
        assert_eq!((used.event_counters().clamped, used.nodes()), (1, 0), "{candidates:?}");
        for engine in [&mut used, &mut new] {
            engine.push(Event::new(0, 0, 0, false));
        }
        let expected = bits(new.predict().expect("finite").values);
        assert_eq!(bits(used.predict().expect("finite").values), expected, "{candidates:?}");
    }
}
