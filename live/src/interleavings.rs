//! Runs every order in which the threads of small cases can take their steps, by the model checker
//! loom. No wake-up and no event is lost, and no late prediction is fresh.
//!
//! loom reports threads that wait forever. Each case runs with up to [`PREEMPTIONS`] switches away
//! from a thread that could continue, in addition to those at locks and waits.

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::process::Command;
use std::sync::{Arc, PoisonError};
use std::time::Duration;

use loom::sync::{Condvar, Mutex};
use loom::thread;
use meissner_engine::{EngineError, Event, EventCounters, Outcome, Prediction};

use crate::intake::Intake;
use crate::shared::{Answer, Shared};
use crate::sync::Instant;
use crate::sync::checked::WAKE_UPS;
use crate::{Live, LiveError, Overload, Predictor, QueueOptions, worker};

const PREEMPTIONS: usize = 2;
const DEADLINE: Duration = Duration::from_millis(1);
/// An event in this column makes the engine panic.
const PANIC_COLUMN: u16 = 1;
/// The line whose wake-up is left out.
const WITHOUT: &str = "MEISSNER_WITHOUT";

const CASES: [(&str, fn()); 7] = [
    ("a sensor that waits for room", || every_event_arrives(Overload::Block, 1)),
    ("a sensor that never waits", || every_event_arrives(Overload::DropOldest, 1)),
    ("more room than events", || every_event_arrives(Overload::DropNewest, 4)),
    ("a deadline that passes", a_deadline_passes),
    ("computing ahead", it_computes_ahead),
    ("an end while the sensor waits for room", it_ends_while_the_sensor_waits),
    ("an engine that panics", the_engine_panics),
];

/// Predicts how many events it has taken, and signals when its clock has been advanced.
#[derive(Debug, Default)]
struct Counter {
    events: EventCounters,
    values: [f32; 1],
    advanced: bool,
    computed: Option<Arc<(Mutex<bool>, Condvar)>>,
}

impl Predictor for Counter {
    type Input = Event;

    fn push(&mut self, event: &Event) -> Result<Outcome, EngineError> {
        if event.x == PANIC_COLUMN {
            // The same as a panic, but without a call of the hook, which would print it.
            resume_unwind(Box::new("asked to panic"));
        }
        self.events.pushed += 1;
        self.events.accepted += 1;
        Ok(Outcome::Accepted)
    }

    fn advance(&mut self, _: i64) {
        self.advanced = true;
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        if let Some(computed) = self.computed.as_ref().filter(|_| self.advanced) {
            *computed.0.lock().expect("nobody panics") = true;
            computed.1.notify_one();
        }
        self.values = [self.events.pushed as f32];
        let nodes = self.events.pushed as usize;
        Ok(Prediction { values: &self.values, t_us: None, nodes, rows: &[], unlike: None })
    }

    fn reset(&mut self) {}

    fn event_counters(&self) -> EventCounters {
        self.events
    }
}

fn events(count: i64) -> Vec<Event> {
    (0..count).map(|t_us| Event::new(t_us, 0, 0, true)).collect()
}

fn options(overload: Overload, capacity: usize) -> QueueOptions {
    QueueOptions::new().with_capacity(capacity).with_overload(overload).with_batch(1)
}

/// The prediction of all events that have entered; waits as long as necessary.
fn drained(live: &mut Live<Counter>) -> u64 {
    let timely = live.predict(Duration::MAX).expect("the worker runs");
    assert!(timely.fresh && timely.own && timely.behind_events == 0, "{timely:?}");
    timely.values[0] as u64
}

fn every_event_arrives(overload: Overload, capacity: usize) {
    let options = options(overload.clone(), capacity);
    let (mut input, mut live) = Live::spawn(Counter::default(), options).expect("it starts");
    let sensor = thread::spawn(move || input.push_slice(&events(3)));
    drained(&mut live);
    sensor.join().expect("it does not panic").expect("the worker runs");
    let (seen, counters) = (drained(&mut live), live.counters());
    assert_eq!((counters.offered, counters.waiting, counters.delivered), (3, 0, seen));
    assert_eq!(seen + counters.dropped(), 3);
    if matches!(overload, Overload::Block) || capacity > 3 {
        assert_eq!(seen, 3);
    }
    assert_eq!(live.close().expect("it ends").events.pushed, seen);
}

fn a_deadline_passes() {
    let options = options(Overload::DropOldest, 4);
    let (mut input, mut live) = Live::spawn(Counter::default(), options).expect("it starts");
    input.push_slice(&events(1)).expect("the worker runs");
    let shared = Arc::clone(&live.shared);
    let clock = thread::spawn(move || shared.move_clock(2 * DEADLINE));
    let timely = live.predict(DEADLINE).expect("the worker runs");
    assert_eq!(timely.fresh, timely.own && timely.behind_events == 0);
    assert_eq!(timely.values[0] as u64, 1 - timely.behind_events);
    // A later answer belongs to the former request.
    input.push_slice(&events(1)).expect("the worker runs");
    let asked = live.ask(Duration::ZERO);
    let timely = live.timely(&asked).expect("the worker runs");
    assert!(!timely.fresh || timely.values[0] == 2.0, "{timely:?}");
    assert_eq!(drained(&mut live), 2);
    clock.join().expect("it does not panic");
}

fn it_computes_ahead() {
    let computed = Arc::new((Mutex::new(false), Condvar::new()));
    let counter = Counter { computed: Some(Arc::clone(&computed)), ..Counter::default() };
    let (mut input, live) =
        Live::spawn(counter, options(Overload::Block, 2).with_ahead(true)).expect("it starts");
    input.push_slice(&events(1)).expect("the worker runs");
    input.advance(5);
    let mut is_computed = computed.0.lock().expect("nobody panics");
    while !*is_computed {
        is_computed = computed.1.wait(is_computed).expect("nobody panics");
    }
    drop(is_computed);
    assert_eq!(live.close().expect("it ends").events.pushed, 1);
}

fn it_ends_while_the_sensor_waits() {
    let (mut input, live) = Live::spawn(Counter::default(), options(Overload::Block, 1)).expect("it starts");
    let sensor = thread::spawn(move || input.push_slice(&events(3)));
    let seen = live.close().expect("it ends").events.pushed;
    match sensor.join().expect("it does not panic") {
        Ok(()) => assert!(seen >= 2, "one fits into the queue"),
        Err(LiveError::Closed { offered: 3, taken }) => assert!(taken as u64 >= seen && taken < 3),
        Err(error) => panic!("{error}"),
    }
}

fn the_engine_panics() {
    let shared = Arc::new(Shared::new(Intake::new(1, Overload::Block), Answer::new(Instant::now()), false));
    let theirs = Arc::clone(&shared);
    let worker = thread::spawn(move || {
        let run = || worker::run(Counter::default(), &theirs, 1, false);
        assert!(catch_unwind(AssertUnwindSafe(run)).is_err());
    });
    let theirs = Arc::clone(&shared);
    let sensor = thread::spawn(move || {
        let events = [Event::new(0, 0, 0, true), Event::new(1, PANIC_COLUMN, 0, true), events(1)[0]];
        theirs.offer(&events, &[]);
        // The thread gets to know the end, and never waits for room again.
        while theirs.offer(&events[..1], &[]) == 1 {}
    });
    let (request, state) = shared.ask(None);
    let state = shared.answered(&request, state);
    let is_answered = state.answer.request == request.number;
    assert!(is_answered || state.has_ended());
    drop(state);
    sensor.join().expect("it does not panic");
    worker.join().expect("it does not panic");
    assert!(shared.lock().has_ended());
}

/// Runs all cases in every order, without the wake-up of a line of `shared.rs`, or with all
/// wake-ups (0). Returns the lines that have woken a thread.
fn check(without: u32) -> BTreeSet<u32> {
    *WAKE_UPS.lock().unwrap_or_else(PoisonError::into_inner) = (without, BTreeSet::new());
    for (name, case) in CASES {
        println!("{name}");
        let mut builder = loom::model::Builder::new();
        builder.preemption_bound = Some(PREEMPTIONS);
        builder.check(move || {
            Instant::set(Duration::ZERO);
            case();
        });
    }
    WAKE_UPS.lock().unwrap_or_else(PoisonError::into_inner).1.clone()
}

#[test]
fn no_order_loses_a_wake_up_or_an_event_and_every_wake_up_is_needed() {
    let lines = check(0);
    println!("wake-ups in shared.rs: lines {lines:?}");
    for line in lines {
        // A case that fails ends its process.
        let mut broken = Command::new(std::env::current_exe().expect("it is running"));
        broken.args(["without_a_wake_up", "--ignored", "--nocapture"]).env(WITHOUT, line.to_string());
        let output = broken.output().expect("it starts");
        let told = String::from_utf8_lossy(&output.stdout);
        let failing = told.lines().rfind(|line| CASES.iter().any(|(name, _)| line.ends_with(name)));
        println!("without that of line {line}: {failing:?} fails");
        assert!(!output.status.success(), "every case passes without the wake-up of line {line}");
    }
}

#[test]
#[ignore = "fails: the test above runs it without each wake-up in turn"]
fn without_a_wake_up() {
    let line = std::env::var(WITHOUT).ok().and_then(|line| line.parse().ok());
    check(line.expect("the line of a wake-up"));
}
