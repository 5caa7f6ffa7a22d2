//! State that the threads share, and how they wait for each other.
//!
//! One lock guards queue, request and answer. It is held for copies of bounded size, never while an
//! engine computes. A waiting thread is woken by its event, or by the end of the other side.
//!
//! | thread | waits for | woken by |
//! |---|---|---|
//! | worker | events, a request, the end | offering thread, requesting thread, close |
//! | offering thread, under `Block` | half of the queue to be free | worker; the end |
//! | requesting thread | its answer, until its deadline | worker; the end |

use std::sync::PoisonError;
use std::time::Duration;

use meissner_engine::{EngineError, EventCounters, Prediction};

use crate::intake::{Intake, Item};
use crate::sync::{Condvar, Instant, Mutex, MutexGuard};

/// A call of `predict`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Request {
    /// Counted from 1.
    pub(crate) number: u64,
    /// Position of the last event to cover.
    pub(crate) target: u64,
    /// Time to advance to after these events.
    pub(crate) advance_us: Option<i64>,
    /// Deadline of the answer.
    pub(crate) due: Option<Instant>,
    /// Time at which the first event after those of the previous request was offered.
    pub(crate) offered: Option<Instant>,
}

/// The newest finished prediction.
#[derive(Debug)]
pub(crate) struct Answer {
    /// Number of the request that it was computed for; 0 before the first.
    pub(crate) request: u64,
    /// Error of the newest computation; the other fields are then those of the previous one.
    pub(crate) error: Option<EngineError>,
    pub(crate) values: Vec<f32>,
    pub(crate) t_us: Option<i64>,
    pub(crate) nodes: usize,
    pub(crate) unlike: Option<f32>,
    /// Position of the last event that it covers.
    pub(crate) covered: u64,
    /// Time of the last event that it covers.
    pub(crate) covered_us: Option<i64>,
    /// Losses and restarts of the engine up to this prediction.
    pub(crate) losses: Losses,
    /// Start of the computation.
    pub(crate) begun: Instant,
}

/// Inputs that the engine received but a prediction does not cover, since the worker started.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Losses {
    /// Events or frames that the engine dropped.
    pub(crate) dropped: u64,
    /// Events that it holds at the moment.
    pub(crate) held: u64,
    /// Restarts of the sensor's clock.
    pub(crate) restarts: u64,
}

impl Answer {
    /// No answer.
    pub(crate) fn new(begun: Instant) -> Self {
        let values = Vec::new();
        let losses = Losses::default();
        Self {
            request: 0,
            error: None,
            values,
            t_us: None,
            nodes: 0,
            unlike: None,
            covered: 0,
            covered_us: None,
            losses,
            begun,
        }
    }

    /// Copies the content of `prediction`.
    pub(crate) fn copy(&mut self, prediction: Prediction<'_>) {
        self.values.clear();
        self.values.extend_from_slice(prediction.values);
        self.t_us = prediction.t_us;
        self.nodes = prediction.nodes;
        self.unlike = prediction.unlike;
    }
}

/// The state for which a prediction is computed without a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Ahead {
    /// Position of the last event.
    covered: u64,
    /// Time to advance to after these events.
    pub(crate) advance_us: Option<i64>,
}

/// The worker's next task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Task {
    /// Position of the last event that the worker has, including those of this task.
    pub(crate) covered: u64,
    /// The request for a prediction, if any.
    pub(crate) request: Option<Request>,
    /// Prediction to compute although nothing is requested.
    pub(crate) ahead: Option<Ahead>,
    /// Whether the queue is congested.
    pub(crate) congested: bool,
}

/// Phases of the worker's life, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    Running,
    /// Asked to end.
    Stopping,
    Ended,
}

/// The state that the lock guards.
#[derive(Debug)]
pub(crate) struct State<T> {
    pub(crate) intake: Intake<T>,
    /// Position and time of the newest clock advance.
    moved: Option<(u64, i64)>,
    /// Position of the last event that the worker took.
    covered: u64,
    /// Whether the queue was congested at the last task.
    congested: bool,
    asked: u64,
    request: Option<Request>,
    /// Time at which the first event since the newest request was offered.
    offered: Option<Instant>,
    pub(crate) answer: Answer,
    /// The engine's counts of events, as of the worker's last task.
    pub(crate) events: EventCounters,
    /// State for which the worker last computed ahead.
    computed: Ahead,
    /// Whether the worker is waiting.
    idle: bool,
    /// Whether the offering thread is waiting.
    blocked: bool,
    worker: Phase,
}

/// The locked state and its condition variables.
#[derive(Debug)]
pub(crate) struct Shared<T> {
    state: Mutex<State<T>>,
    work: Condvar,
    room: Condvar,
    answered: Condvar,
    /// Whether the worker computes while it would wait.
    ahead: bool,
}

impl<T: Item> State<T> {
    /// Whether the worker has ended or is about to.
    pub(crate) fn is_closed(&self) -> bool {
        self.worker > Phase::Running
    }

    /// The time of a clock advance after all events that have entered; later events advance the
    /// clock themselves.
    fn advance_us(&self) -> Option<i64> {
        let entered = self.intake.entered();
        self.moved.filter(|&(position, _)| position == entered).map(|(_, t_us)| t_us)
    }

    /// Whether the worker has ended.
    pub(crate) fn has_ended(&self) -> bool {
        self.worker == Phase::Ended
    }
}

impl<T: Item> Shared<T> {
    pub(crate) fn new(intake: Intake<T>, answer: Answer, ahead: bool) -> Self {
        let state = State {
            intake,
            moved: None,
            covered: 0,
            congested: false,
            asked: 0,
            request: None,
            offered: None,
            answer,
            events: EventCounters::default(),
            computed: Ahead { covered: 0, advance_us: None },
            idle: false,
            blocked: false,
            worker: Phase::Running,
        };
        Self {
            state: Mutex::new(state),
            work: Condvar::new(),
            room: Condvar::new(),
            answered: Condvar::new(),
            ahead,
        }
    }

    /// Locks the state. No code that can panic runs under the lock.
    pub(crate) fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    #[cfg_attr(all(test, meissner_loom), track_caller)]
    fn wake_worker(&self, state: &mut State<T>) {
        if std::mem::take(&mut state.idle) {
            self.work.notify_one();
        }
    }

    /// Offers `events`; `passes` tells whether each passes the filters. Waits if the rule is to
    /// wait. Returns the number of processed events: all, unless the worker ends.
    pub(crate) fn offer(&self, events: &[T], passes: &[bool]) -> usize {
        let mut state = self.lock();
        let mut taken = 0;
        loop {
            if state.is_closed() {
                return taken;
            }
            taken += state.intake.offer(&events[taken..], passes.get(taken..).unwrap_or_default());
            state.offered.get_or_insert_with(Instant::now);
            self.wake_worker(&mut state);
            if taken == events.len() {
                return taken;
            }
            let start = Instant::now();
            state.blocked = true;
            // A wake-up for each taken batch would cost more than the batch.
            while state.intake.is_crowded() && !state.is_closed() {
                state = self.room.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
            state.blocked = false;
            state.intake.counters_mut().blocked += start.elapsed();
        }
    }

    /// Promises that no event before `t_us` will be offered any more.
    pub(crate) fn advance(&self, t_us: i64) {
        let mut state = self.lock();
        let entered = state.intake.entered();
        // After newer events, the clock may have restarted; an advance to an earlier time has no
        // effect.
        let before = state.moved.filter(|&(position, _)| position == entered);
        state.moved = Some((entered, before.map_or(t_us, |(_, before)| before.max(t_us))));
        if self.ahead {
            self.wake_worker(&mut state);
        }
    }

    /// Requests a prediction of all entered events; replaces an earlier request.
    pub(crate) fn ask(&self, due: Option<Instant>) -> (Request, MutexGuard<'_, State<T>>) {
        let mut state = self.lock();
        state.asked += 1;
        let (target, advance_us) = (state.intake.entered(), state.advance_us());
        let request = Request { number: state.asked, target, advance_us, due, offered: state.offered.take() };
        state.request = Some(request);
        self.wake_worker(&mut state);
        (request, state)
    }

    /// Waits for the answer to `request` until its deadline, or until the worker has ended.
    pub(crate) fn answered<'a>(
        &'a self,
        request: &Request,
        mut state: MutexGuard<'a, State<T>>,
    ) -> MutexGuard<'a, State<T>> {
        while state.answer.request != request.number && !state.has_ended() {
            let left = request.due.map(|due| due.saturating_duration_since(Instant::now()));
            state = match left {
                Some(Duration::ZERO) => break,
                Some(left) => {
                    self.answered.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0
                }
                None => self.answered.wait(state).unwrap_or_else(PoisonError::into_inner),
            };
        }
        state
    }

    /// Waits for a task, with computing ahead as the last choice, and appends at most `most` events
    /// to `batch`; `None` if the worker must end. While a prediction is requested, takes no event
    /// beyond its target, except one event if the target was dropped.
    pub(crate) fn next(&self, most: usize, batch: &mut Vec<T>, events: EventCounters) -> Option<Task> {
        let mut state = self.lock();
        state.events = events;
        while !state.is_closed() && state.intake.waiting() == 0 && state.request.is_none() {
            let ahead = Ahead { covered: state.covered, advance_us: state.advance_us() };
            if self.ahead && state.computed != ahead {
                state.computed = ahead;
                return Some(Task {
                    covered: ahead.covered,
                    request: None,
                    ahead: Some(ahead),
                    congested: false,
                });
            }
            state.idle = true;
            state = self.work.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.idle = false;
        if state.is_closed() {
            return None;
        }
        let most = match state.request {
            Some(request) if state.covered >= request.target => 0,
            Some(request) => {
                let ahead = request.target.saturating_sub(state.intake.left()).max(1);
                most.min(usize::try_from(ahead).unwrap_or(usize::MAX))
            }
            None => most,
        };
        if state.intake.take(most, batch) > 0 {
            state.covered = state.intake.left();
        }
        if state.blocked && !state.intake.is_crowded() {
            self.room.notify_one();
        }
        state.congested = state.intake.is_congested(state.congested);
        Some(Task { covered: state.covered, request: state.request, ahead: None, congested: state.congested })
    }

    /// Publishes the outcome of `request` through `write`, with the engine's counts.
    pub(crate) fn publish(&self, request: u64, events: EventCounters, write: impl FnOnce(&mut Answer)) {
        let mut state = self.lock();
        state.events = events;
        state.answer.request = request;
        write(&mut state.answer);
        state.request.take_if(|waiting| waiting.number == request);
        self.answered.notify_all();
    }

    /// Moves the clock of a checked case, and wakes the threads that may wait until that time.
    #[cfg(all(test, meissner_loom))]
    pub(crate) fn move_clock(&self, now: Duration) {
        let _state = self.lock();
        Instant::set(now);
        self.answered.time_out();
    }

    /// Asks the worker to end, and wakes every waiting thread.
    pub(crate) fn stop(&self) {
        self.enter(Phase::Stopping);
    }

    /// Records that the worker has ended.
    pub(crate) fn end(&self) {
        self.enter(Phase::Ended);
    }

    /// Enters a later phase and wakes every waiting thread; phases never go back.
    fn enter(&self, phase: Phase) {
        let mut state = self.lock();
        state.worker = state.worker.max(phase);
        self.work.notify_all();
        self.room.notify_all();
        self.answered.notify_all();
    }
}
