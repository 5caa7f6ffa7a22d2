//! Errors, panics and ends: reported, never waited for.

use std::sync::Arc;
use std::thread;
use std::time::Duration;

use meissner_engine::EngineError;
use meissner_live::{Live, LiveError, Overload};

use crate::fake::{Fake, NAN_COLUMN, PANIC_COLUMN, PATIENCE, drained, event, events, options, wait_until};

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
    // More than there is room for: this would wait forever.
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
