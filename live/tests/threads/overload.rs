//! More events than the engine can process, under every policy; errors, panics and ends.

use std::sync::Arc;
use std::thread;
use std::time::Duration;

use meissner_engine::filters::{Chain, Filter, Refractory};
use meissner_engine::{EngineError, Sensor};
use meissner_live::{Live, LiveError, Overload};

use crate::fake::{
    Fake, NAN_COLUMN, PANIC_COLUMN, PATIENCE, check, drained, event, events, options, wait_until,
};

const CAPACITY: usize = 128;
const OFFERED: i64 = 10_000;

fn refractory() -> Overload {
    let filter = Refractory::new(Sensor::new(8, 1), 100).expect("100 us is in range");
    Overload::Filter(Chain::new(vec![Filter::Refractory(filter)]))
}

fn dropping() -> [Overload; 4] {
    [Overload::DropOldest, Overload::DropNewest, Overload::Thin { stride: 10 }, refractory()]
}

#[test]
fn before_an_engine_that_stands_still_the_queue_is_bounded_and_every_event_is_counted() {
    for overload in dropping() {
        let name = overload.name();
        let fake = Fake::default();
        let gate = Arc::clone(&fake.gate);
        let (mut input, mut live) = Live::spawn(fake, options(CAPACITY, overload)).expect("options are fine");
        let held = gate.lock().expect("nobody panicked");
        input.push_slice(&events(0..OFFERED)).expect("the worker lives");
        let counters = input.counters();
        check(&counters, CAPACITY);
        assert_eq!(counters.offered, OFFERED as u64, "{name}");
        assert!(counters.delivered <= 16, "{name}: one batch at most");
        let reasons = counters.dropped_by_reason().map(|(_, count)| count > 0);
        let expected = match name {
            "drop_oldest" => [true, false, false, false],
            "drop_newest" => [false, true, false, false],
            "thin" => [false, true, true, false],
            // At least a tenth passes: the queue still fills up.
            _ => [false, true, false, true],
        };
        assert_eq!(reasons, expected, "{name}: {counters:?}");
        drop(held);
        let taken = drained(&mut live).expect("the worker lives");
        let counters = live.counters();
        check(&counters, CAPACITY);
        assert_eq!((counters.waiting, counters.delivered), (0, taken), "{name}");
        let times = live.close().expect("the worker lives").times();
        assert!(times.is_sorted_by(|a, b| a < b), "{name}: order is kept");
        assert_eq!(times.len() as u64, taken, "{name}");
        let newest = times.last().copied();
        assert_eq!(newest == Some(OFFERED - 1), name == "drop_oldest", "{name}: {newest:?}");
    }
}

#[test]
fn blocking_drops_nothing_and_says_how_long_it_waited() {
    let fake = Fake::default();
    let gate = Arc::clone(&fake.gate);
    let (mut input, mut live) =
        Live::spawn(fake, options(CAPACITY, Overload::Block)).expect("options are fine");
    let held = gate.lock().expect("nobody panicked");
    let reader = thread::spawn(move || input.push_slice(&events(0..OFFERED)).map(|()| input));
    // The first slice fills the queue, and the worker holds a batch at most.
    wait_until(&live, |counters| counters.offered == CAPACITY as u64);
    thread::sleep(Duration::from_millis(5));
    check(&live.counters(), CAPACITY);
    drop(held);
    let input = reader.join().expect("the reader does not panic").expect("the worker lives");
    assert_eq!(drained(&mut live).expect("the worker lives"), OFFERED as u64);
    let counters = input.counters();
    check(&counters, CAPACITY);
    assert_eq!(counters.dropped(), 0);
    assert!(counters.blocked > Duration::ZERO);
    let times = live.close().expect("the worker lives").times();
    assert!(times.iter().copied().eq(0..OFFERED));
}

#[test]
fn under_load_from_both_sides_every_event_is_somewhere_and_every_call_is_answered() {
    for (overload, ahead) in
        dropping().into_iter().chain([Overload::Block]).zip([true, false].into_iter().cycle())
    {
        let name = overload.name();
        let fake = Fake { nap: Duration::from_micros(20), ..Fake::default() };
        let options = options(CAPACITY, overload).with_ahead(ahead);
        let (mut input, mut live) = Live::spawn(fake, options).expect("options are fine");
        let reader = thread::spawn(move || {
            let events = events(0..4000);
            let mut rest = &events[..];
            for size in [1, 700, 3, 64, 0, 150].into_iter().cycle() {
                let (now, later) = rest.split_at(rest.len().min(size));
                input.push_slice(now).expect("the worker lives");
                if let Some(event) = now.last() {
                    input.advance(event.t_us);
                }
                thread::yield_now();
                rest = later;
                if rest.is_empty() {
                    break;
                }
            }
        });
        let mut before = 0;
        for call in 0..200 {
            let timely = live.predict(Duration::from_micros(call * 37 % 1000)).expect("the worker lives");
            let taken = timely.values[0] as u64;
            assert!(taken >= before, "{name}: predictions do not go back");
            assert!(!timely.fresh || timely.own, "{name}: {timely:?}");
            before = taken;
            check(&live.counters(), CAPACITY);
        }
        reader.join().expect("the reader does not panic");
        let taken = drained(&mut live).expect("the worker lives");
        let counters = live.counters();
        assert_eq!((counters.offered, counters.waiting, counters.delivered), (4000, 0, taken), "{name}");
        assert_eq!(counters.dropped() == 0, taken == 4000, "{name}");
        let times = live.close().expect("the worker lives").times();
        assert!(times.is_sorted_by(|a, b| a < b), "{name}");
    }
}

#[test]
fn without_congestion_nothing_is_thinned_or_filtered() {
    for overload in [Overload::Thin { stride: 10 }, refractory()] {
        let (mut input, mut live) =
            Live::spawn(Fake::default(), options(CAPACITY, overload)).expect("options are fine");
        for start in (0..1000).step_by(CAPACITY / 2) {
            input.push_slice(&events(start..start + CAPACITY as i64 / 2)).expect("the worker lives");
            drained(&mut live).expect("the worker lives");
        }
        assert_eq!(live.counters().dropped(), 0);
    }
}

#[test]
fn options_out_of_range_are_refused() {
    let zero = [
        options(0, Overload::Block),
        options(1, Overload::Thin { stride: 0 }),
        options(1, Overload::Block).with_batch(0),
    ];
    for (options, what) in zero.into_iter().zip(["capacity of the queue", "stride", "batch"]) {
        let error = Live::spawn(Fake::default(), options).expect_err("0 is out of range").to_string();
        assert!(error.starts_with(what) && error.ends_with("found 0"), "{error}");
    }
}

#[test]
fn what_is_not_a_number_is_an_error_until_it_is_one_again() {
    let (mut input, mut live) =
        Live::spawn(Fake::default(), options(64, Overload::Block)).expect("options are fine");
    input.push_slice(&[event(1, NAN_COLUMN)]).expect("the worker lives");
    for _ in 0..2 {
        let error = live.predict(PATIENCE).expect_err("the engine fails");
        assert!(matches!(error, LiveError::Engine(EngineError::NotANumber { .. })), "{error}");
    }
    input.push_slice(&[event(2, 0)]).expect("the worker lives");
    assert_eq!(drained(&mut live).expect("the engine is well"), 2);
}

#[test]
fn a_panic_of_the_engine_reaches_both_sides() {
    let (mut input, mut live) =
        Live::spawn(Fake::default(), options(8, Overload::Block)).expect("options are fine");
    input.push_slice(&[event(1, PANIC_COLUMN)]).expect("there is room");
    for _ in 0..2 {
        let error = live.predict(Duration::MAX).expect_err("the worker has ended");
        assert!(matches!(&error, LiveError::Panicked { message } if message == "asked to panic"), "{error}");
    }
    // More events than there is room for: this would wait forever.
    let error = input.push_slice(&events(0..20)).expect_err("the worker has ended");
    assert!(matches!(error, LiveError::Closed { offered: 20, taken: 0 }), "{error}");
    assert!(matches!(live.close(), Err(LiveError::Panicked { .. })));
}

#[test]
fn who_waits_for_room_is_told_that_there_will_be_none() {
    let fake = Fake::default();
    let gate = Arc::clone(&fake.gate);
    let (mut input, live) = Live::spawn(fake, options(8, Overload::Block)).expect("options are fine");
    let held = gate.lock().expect("nobody panicked");
    let reader = thread::spawn(move || (input.push_slice(&events(0..1000)), input.counters()));
    wait_until(&live, |counters| counters.waiting == 8);
    let closer = thread::spawn(move || live.close());
    let (error, counters) = reader.join().expect("the reader does not panic");
    let Err(LiveError::Closed { offered: 1000, taken }) = error else { panic!("{error:?}") };
    assert_eq!(taken as u64, counters.offered);
    assert_eq!(counters.offered, counters.delivered + counters.waiting);
    drop(held);
    let fake = closer.join().expect("it does not panic").expect("the worker lived");
    assert_eq!(fake.times().len() as u64, counters.delivered, "the batch at hand is finished");
}

#[test]
fn dropping_the_handle_joins_the_worker() {
    let fake = Fake::default();
    let gate = Arc::clone(&fake.gate);
    let (mut input, live) = Live::spawn(fake, options(8, Overload::DropNewest)).expect("options are fine");
    input.push_slice(&events(0..5)).expect("the worker lives");
    drop(live);
    assert_eq!(Arc::strong_count(&gate), 1, "the engine is gone");
    assert!(matches!(input.push_slice(&events(5..6)), Err(LiveError::Closed { offered: 1, taken: 0 })));
}
