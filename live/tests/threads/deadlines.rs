//! Predictions by their deadline, whatever the engine is doing.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use meissner_live::{Live, Overload};

use crate::fake::{Fake, LATE_COLUMN, PATIENCE, Verb, drained, event, events, options, wait_until};

#[test]
fn an_idle_engine_answers_with_all_that_has_entered() {
    let (mut input, mut live) =
        Live::spawn(Fake::default(), options(64, Overload::Block)).expect("options are fine");
    let first = live.predict(PATIENCE).expect("the worker lives");
    assert!(first.fresh && first.t_us.is_none() && first.behind_us == 0, "{first:?}");
    for (count, t) in (1..).zip([10, 20, 30]) {
        input.push_slice(&[event(t, 0)]).expect("the worker lives");
        let timely = live.predict(PATIENCE).expect("the worker lives");
        assert!(timely.fresh && timely.age <= timely.waited, "{timely:?}");
        assert_eq!((timely.t_us, timely.nodes), (Some(t), count));
    }
}

#[test]
fn what_the_engine_drops_is_told_with_the_prediction_which_is_not_fresh() {
    let (mut input, mut live) =
        Live::spawn(Fake::default(), options(64, Overload::Block)).expect("options are fine");
    input.push_slice(&[event(1, 0), event(2, LATE_COLUMN), event(3, LATE_COLUMN)]).expect("the worker lives");
    let timely = live.predict(PATIENCE).expect("the worker lives");
    assert_eq!((timely.fresh, timely.own, timely.behind_events, timely.lost_events), (false, true, 0, 2));
    assert_eq!((live.event_counters().late, live.event_counters().pushed), (2, 3));
    // Losses are reported once.
    input.push_slice(&[event(4, 0)]).expect("the worker lives");
    let timely = live.predict(PATIENCE).expect("the worker lives");
    assert!(timely.fresh && timely.lost_events == 0, "{timely:?}");
}

#[test]
fn what_the_queue_drops_is_told_with_the_prediction() {
    let fake = Fake::default();
    let gate = Arc::clone(&fake.gate);
    let (mut input, mut live) =
        Live::spawn(fake, options(4, Overload::DropNewest)).expect("options are fine");
    let held = gate.lock().expect("nobody panicked");
    input.push_slice(&events(0..10)).expect("the worker lives");
    drop(held);
    let dropped = live.counters().dropped();
    let timely = live.predict(PATIENCE).expect("the worker lives");
    assert_eq!((timely.dropped_events, timely.lost_events, timely.fresh), (dropped, 0, true));
    assert!(dropped >= 5, "{dropped}");
    assert_eq!(live.predict(PATIENCE).expect("the worker lives").dropped_events, 0);
}

#[test]
fn at_the_deadline_comes_the_newest_finished_prediction_with_its_age() {
    let fake = Fake::default();
    let gate = Arc::clone(&fake.gate);
    let (mut input, mut live) = Live::spawn(fake, options(64, Overload::Block)).expect("options are fine");
    let held = gate.lock().expect("nobody panicked");
    input.push_slice(&events(0..5)).expect("the worker lives");
    let timely = live.predict(Duration::ZERO).expect("the worker lives");
    assert_eq!((timely.t_us, timely.behind_events, timely.behind_us), (None, 5, 4), "before any event");
    drop(held);
    assert_eq!(drained(&mut live).expect("the worker lives"), 5);
    let held = gate.lock().expect("nobody panicked");
    input.push_slice(&events(100..110)).expect("the worker lives");
    let deadline = Duration::from_millis(20);
    for _ in 0..3 {
        let timely = live.predict(deadline).expect("the worker lives");
        assert!(!timely.fresh && !timely.own, "{timely:?}");
        assert_eq!((timely.values, timely.t_us, timely.nodes), (&[5.0][..], Some(4), 5));
        assert_eq!((timely.behind_events, timely.behind_us), (10, 105));
        assert!(timely.waited >= deadline && timely.age >= timely.waited, "{timely:?}");
        assert!(timely.waited < PATIENCE);
    }
    let now = live.predict(Duration::ZERO).expect("the worker lives");
    assert_eq!((now.t_us, now.fresh), (Some(4), false));
    drop(held);
    assert_eq!(drained(&mut live).expect("the worker lives"), 15);
}

#[test]
fn a_worker_that_will_not_be_done_in_time_predicts_for_what_it_has() {
    let fake = Fake { nap: Duration::from_millis(1), ..Fake::default() };
    let (mut input, mut live) =
        Live::spawn(fake, options(1 << 15, Overload::Block)).expect("options are fine");
    input.push_slice(&events(0..30_000)).expect("the worker lives");
    let mut own = 0;
    for _ in 0..20 {
        let timely = live.predict(Duration::from_millis(200)).expect("the worker lives");
        assert!(!timely.fresh && timely.behind_events > 0, "30 s of work do not fit: {timely:?}");
        own += u32::from(timely.own);
    }
    assert!(own > 0, "of 20 calls, none was answered by a prediction of its own");
}

#[test]
fn time_moves_on_behind_the_events_before_it_and_never_before_them() {
    let fake = Fake::default();
    let gate = Arc::clone(&fake.gate);
    let (mut input, mut live) = Live::spawn(fake, options(256, Overload::Block)).expect("options are fine");
    let held = gate.lock().expect("nobody panicked");
    input.push_slice(&events(0..100)).expect("the worker lives");
    input.advance(500);
    input.advance(400);
    // The worker reaches this request late, and the next one first.
    live.predict(Duration::ZERO).expect("the worker lives");
    drop(held);
    live.predict(PATIENCE).expect("the worker lives");
    input.push_slice(&[event(600, 0)]).expect("the worker lives");
    live.predict(PATIENCE).expect("the worker lives");
    let verbs = live.close().expect("the worker lives").verbs;
    let pushed = verbs.iter().filter(|verb| matches!(verb, Verb::Push(_))).count();
    assert_eq!(pushed, 101);
    let mut moves = verbs.clone();
    moves.retain(|verb| matches!(verb, Verb::Advance(_)));
    assert!(!moves.is_empty() && moves.iter().all(|&verb| verb == Verb::Advance(500)), "{moves:?}");
    let first = verbs.iter().position(|&verb| verb == Verb::Advance(500));
    assert_eq!(first, Some(100));
    assert_eq!(verbs.last(), Some(&Verb::Push(600)), "its own time is enough");
}

#[test]
fn only_a_worker_that_computes_ahead_advances_and_predicts_without_a_request() {
    for ahead in [false, true] {
        let fake = Fake::default();
        let predicted = Arc::clone(&fake.predicted);
        let options = options(64, Overload::Block).with_ahead(ahead);
        let (mut input, live) = Live::spawn(fake, options).expect("options are fine");
        let reach = |most| {
            let start = Instant::now();
            while predicted.load(Ordering::Relaxed) < most {
                assert!(start.elapsed() < PATIENCE, "{predicted:?} of {most}");
                std::thread::sleep(Duration::from_millis(1));
            }
        };
        // One prediction is computed at the start.
        input.push_slice(&events(0..5)).expect("the worker lives");
        wait_until(&live, |counters| counters.delivered == 5);
        reach(if ahead { 2 } else { 1 });
        let before = predicted.load(Ordering::Relaxed);
        input.advance(500);
        reach(if ahead { before + 1 } else { before });
        input.push_slice(&[event(600, 0)]).expect("the worker lives");
        wait_until(&live, |counters| counters.delivered == 6);
        let mut expected: Vec<Verb> = (0..5).map(Verb::Push).collect();
        expected.extend(ahead.then_some(Verb::Advance(500)));
        expected.push(Verb::Push(600));
        let fake = live.close().expect("the worker lives");
        assert_eq!(fake.verbs, expected);
        assert_eq!(predicted.load(Ordering::Relaxed) > 1, ahead);
    }
}

#[test]
fn what_was_asked_for_can_be_awaited_in_turns() {
    let fake = Fake::default();
    let gate = Arc::clone(&fake.gate);
    let (mut input, mut live) = Live::spawn(fake, options(64, Overload::Block)).expect("options are fine");
    let held = gate.lock().expect("nobody panicked");
    input.push_slice(&events(0..5)).expect("the worker lives");
    let asked = live.ask(PATIENCE);
    for _ in 0..3 {
        assert!(!live.wait(&asked, Duration::from_millis(1)).expect("the worker lives"));
    }
    drop(held);
    assert!(live.wait(&asked, PATIENCE).expect("the worker lives"));
    let timely = live.timely(&asked).expect("the worker lives");
    assert!(timely.fresh && timely.nodes == 5, "{timely:?}");
    let late = live.ask(Duration::ZERO);
    assert!(live.wait(&late, PATIENCE).expect("the worker lives"), "the deadline has passed");
}
