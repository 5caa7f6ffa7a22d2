//! An engine that counts its inputs, and stands still, is slow or fails if a test requests it.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use meissner_engine::{DropReason, EngineError, Event, EventCounters, Outcome, Prediction};
use meissner_live::{Live, LiveError, Overload, Predictor, QueueCounters, QueueOptions, cores};

/// Longest wait for an action that takes no time: the machine may be busy.
pub(crate) const PATIENCE: Duration = Duration::from_mins(1);

/// The calls that it received, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verb {
    Push(i64),
    Advance(i64),
}

/// Predicts how many events it has taken.
#[derive(Debug, Default)]
pub(crate) struct Fake {
    /// A thread that holds this makes the engine stand still at its next event.
    pub(crate) gate: Arc<Mutex<()>>,
    /// Sleep per event.
    pub(crate) nap: Duration,
    pub(crate) verbs: Vec<Verb>,
    pub(crate) taken: usize,
    /// Events pushed since it was made, and those of them that it dropped as late.
    pub(crate) pushed: u64,
    pub(crate) late: u64,
    pub(crate) values: [f32; 1],
    /// Number of requested predictions.
    pub(crate) predicted: Arc<AtomicU64>,
    /// The only core that it may run on, at its last event; `None` if there are several.
    pub(crate) core: Option<usize>,
}

/// An event in this column makes the next prediction fail.
pub(crate) const NAN_COLUMN: u16 = 13;
/// An event in this column is late.
pub(crate) const LATE_COLUMN: u16 = 7_777;
/// An event in this column makes the engine panic.
pub(crate) const PANIC_COLUMN: u16 = 666;

impl Fake {
    /// Times of the events that were taken.
    pub(crate) fn times(&self) -> Vec<i64> {
        let time = |verb: &Verb| match verb {
            Verb::Push(t_us) => Some(*t_us),
            Verb::Advance(_) => None,
        };
        self.verbs.iter().filter_map(time).collect()
    }
}

impl Predictor for Fake {
    type Input = Event;

    fn push(&mut self, event: &Event) -> Result<Outcome, EngineError> {
        drop(self.gate.lock().unwrap_or_else(PoisonError::into_inner));
        if !self.nap.is_zero() {
            std::thread::sleep(self.nap);
        }
        assert!(event.x != PANIC_COLUMN, "asked to panic");
        self.pushed += 1;
        if event.x == LATE_COLUMN {
            self.late += 1;
            return Ok(Outcome::Dropped(DropReason::Late));
        }
        self.verbs.push(Verb::Push(event.t_us));
        self.taken += 1;
        self.core = match cores()[..] {
            [core] => Some(core),
            _ => None,
        };
        self.values = [if event.x == NAN_COLUMN { f32::NAN } else { self.taken as f32 }];
        Ok(Outcome::Accepted)
    }

    fn advance(&mut self, t_us: i64) {
        self.verbs.push(Verb::Advance(t_us));
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.predicted.fetch_add(1, Ordering::Relaxed);
        if self.values[0].is_nan() {
            return Err(EngineError::NotANumber { layer: "fake".to_owned(), rows: 1 });
        }
        let t_us = self.times().last().copied();
        Ok(Prediction { values: &self.values, t_us, nodes: self.taken, rows: &[], unlike: None })
    }

    fn reset(&mut self) {
        self.verbs.clear();
        self.taken = 0;
    }

    fn event_counters(&self) -> EventCounters {
        EventCounters {
            pushed: self.pushed,
            accepted: self.pushed - self.late,
            late: self.late,
            ..EventCounters::default()
        }
    }
}

/// Events at these times.
pub(crate) fn events(times: std::ops::Range<i64>) -> Vec<Event> {
    times.map(|t| Event::new(t, (t % 8) as u16, 0, true)).collect()
}

/// An event at `t_us` in column `x`.
pub(crate) fn event(t_us: i64, x: u16) -> Event {
    Event::new(t_us, x, 0, true)
}

pub(crate) fn options(capacity: usize, overload: Overload) -> QueueOptions {
    QueueOptions::new().with_capacity(capacity).with_overload(overload).with_batch(16)
}

/// Waits until `is_so` is true for the counters.
pub(crate) fn wait_until(live: &Live<Fake>, is_so: impl Fn(QueueCounters) -> bool) {
    let start = std::time::Instant::now();
    while !is_so(live.counters()) {
        assert!(start.elapsed() < PATIENCE, "{:?}", live.counters());
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Asserts that every offered event is counted.
pub(crate) fn check(counters: &QueueCounters, capacity: usize) {
    assert_eq!(counters.offered, counters.delivered + counters.waiting + counters.dropped(), "{counters:?}");
    assert!(counters.high_water <= capacity as u64, "{counters:?}");
}

/// The value of a prediction of all events: the number of taken events.
pub(crate) fn drained(live: &mut Live<Fake>) -> Result<u64, LiveError> {
    let timely = live.predict(PATIENCE)?;
    assert!(timely.fresh && timely.own && timely.behind_events == 0, "{timely:?}");
    Ok(timely.values[0] as u64)
}
