//! What the threads have in common, and how they wait for each other.
//!
//! One lock over queue, request and answer, held for copies of bounded size and never while an engine works. Whoever
//! waits is woken by what it waits for, or by the end of the other side.
//!
//! | who waits | for | woken by |
//! |---|---|---|
//! | worker | events, a request, the end | who offers, who asks, who closes |
//! | who offers, under `Block` | half of the queue to be free | worker; the end |
//! | who asks | its answer, until its deadline | worker; the end |

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use meissner_engine::{EngineError, Prediction};

use crate::intake::{Intake, Item};

/// A call of `predict`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Request {
    /// Counted from 1.
    pub(crate) number: u64,
    /// Position up to which events are to be covered.
    pub(crate) target: u64,
    /// The time to move on to behind them.
    pub(crate) advance_us: Option<i64>,
    /// When the answer is to be there.
    pub(crate) due: Option<Instant>,
}

/// The newest finished prediction.
#[derive(Debug)]
pub(crate) struct Answer {
    /// The request that it was computed for; 0 before the first.
    pub(crate) request: u64,
    /// Whether the newest computation failed; then the rest is of the one before.
    pub(crate) error: Option<EngineError>,
    pub(crate) values: Vec<f32>,
    pub(crate) t_us: Option<i64>,
    pub(crate) nodes: usize,
    /// Position up to which it covers events.
    pub(crate) covered: u64,
    /// Stamp of the last event that it covers.
    pub(crate) covered_us: Option<i64>,
    /// When it was begun.
    pub(crate) begun: Instant,
}

impl Answer {
    /// No answer.
    pub(crate) fn new(begun: Instant) -> Self {
        let values = Vec::new();
        Self { request: 0, error: None, values, t_us: None, nodes: 0, covered: 0, covered_us: None, begun }
    }

    /// Takes over values, time and size of `prediction`.
    pub(crate) fn copy(&mut self, prediction: Prediction<'_>) {
        self.values.clear();
        self.values.extend_from_slice(prediction.values);
        self.t_us = prediction.t_us;
        self.nodes = prediction.nodes;
    }
}

/// What the worker is to do next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Task {
    /// Position up to which it has events, those of this task included.
    pub(crate) covered: u64,
    /// Who waits for a prediction.
    pub(crate) request: Option<Request>,
}

/// The worker's life, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    Running,
    /// It is to end.
    Stopping,
    Ended,
}

/// Behind the lock.
#[derive(Debug)]
pub(crate) struct State<T> {
    pub(crate) intake: Intake<T>,
    capacity: usize,
    /// Position and time of the newest move of time.
    moved: Option<(u64, i64)>,
    /// Position of the last event that the worker took.
    covered: u64,
    asked: u64,
    request: Option<Request>,
    pub(crate) answer: Answer,
    /// Whether the worker waits.
    idle: bool,
    /// Whether who offers events waits.
    blocked: bool,
    worker: Phase,
}

/// State, lock and the places to wait at.
#[derive(Debug)]
pub(crate) struct Shared<T> {
    state: Mutex<State<T>>,
    work: Condvar,
    room: Condvar,
    answered: Condvar,
}

impl<T> State<T> {
    /// Whether the worker has ended or is about to.
    pub(crate) fn is_closed(&self) -> bool {
        self.worker > Phase::Running
    }

    /// Whether the worker has ended.
    pub(crate) fn has_ended(&self) -> bool {
        self.worker == Phase::Ended
    }
}

impl<T: Item> Shared<T> {
    pub(crate) fn new(intake: Intake<T>, capacity: usize, answer: Answer) -> Self {
        let state = State {
            intake,
            capacity,
            moved: None,
            covered: 0,
            asked: 0,
            request: None,
            answer,
            idle: false,
            blocked: false,
            worker: Phase::Running,
        };
        Self {
            state: Mutex::new(state),
            work: Condvar::new(),
            room: Condvar::new(),
            answered: Condvar::new(),
        }
    }

    /// No code that can panic runs under the lock; should it all the same, the state is whole.
    pub(crate) fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wake_worker(&self, state: &mut State<T>) {
        if std::mem::take(&mut state.idle) {
            self.work.notify_one();
        }
    }

    /// Offers `events`, of which `passes` says what filters let pass; waits where the rule is to wait. How many were
    /// decided about: all, unless the worker ends.
    pub(crate) fn offer(&self, events: &[T], passes: &[bool]) -> usize {
        let mut state = self.lock();
        let mut taken = 0;
        loop {
            if state.is_closed() {
                return taken;
            }
            taken += state.intake.offer(&events[taken..], passes.get(taken..).unwrap_or_default());
            self.wake_worker(&mut state);
            if taken == events.len() {
                return taken;
            }
            let start = Instant::now();
            state.blocked = true;
            // A wake-up for every batch that leaves would cost more than the batch.
            let is_crowded =
                |state: &mut State<T>| 2 * state.intake.waiting() > state.capacity && !state.is_closed();
            state = self.room.wait_while(state, is_crowded).unwrap_or_else(PoisonError::into_inner);
            state.blocked = false;
            state.intake.counters_mut().blocked += start.elapsed();
        }
    }

    /// No event before `t_us` will be offered any more.
    pub(crate) fn advance(&self, t_us: i64) {
        let mut state = self.lock();
        let newest = state.moved.map_or(t_us, |(_, before)| before.max(t_us));
        state.moved = Some((state.intake.entered(), newest));
    }

    /// Asks for a prediction of all that has entered, in place of an earlier request.
    pub(crate) fn ask(&self, due: Option<Instant>) -> (Request, MutexGuard<'_, State<T>>) {
        let mut state = self.lock();
        state.asked += 1;
        let target = state.intake.entered();
        // Behind a move of time, events have later stamps and move time on themselves.
        let advance_us = state.moved.filter(|&(position, _)| position == target).map(|(_, t_us)| t_us);
        let request = Request { number: state.asked, target, advance_us, due };
        state.request = Some(request);
        self.wake_worker(&mut state);
        (request, state)
    }

    /// Waits for the answer to `request` until it is due, or until the worker has ended.
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

    /// Waits for something to do and appends at most `most` events to `batch`; none where the worker is to end. Where a
    /// prediction is waited for, nothing beyond what it is to cover is taken, except where that was dropped: then one.
    pub(crate) fn next(&self, most: usize, batch: &mut Vec<T>) -> Option<Task> {
        let mut state = self.lock();
        while !state.is_closed() && state.intake.waiting() == 0 && state.request.is_none() {
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
        if state.blocked && 2 * state.intake.waiting() <= state.capacity {
            self.room.notify_one();
        }
        Some(Task { covered: state.covered, request: state.request })
    }

    /// Publishes the outcome of `request` by `write`.
    pub(crate) fn publish(&self, request: u64, write: impl FnOnce(&mut Answer)) {
        let mut state = self.lock();
        state.answer.request = request;
        write(&mut state.answer);
        state.request.take_if(|waiting| waiting.number == request);
        self.answered.notify_all();
    }

    /// Tells the worker to end, and everyone not to wait for it.
    pub(crate) fn stop(&self) {
        self.enter(Phase::Stopping);
    }

    /// The worker has ended.
    pub(crate) fn end(&self) {
        self.enter(Phase::Ended);
    }

    /// Nothing is to be waited for any more; phases do not go back.
    fn enter(&self, phase: Phase) {
        let mut state = self.lock();
        state.worker = state.worker.max(phase);
        self.work.notify_all();
        self.room.notify_all();
        self.answered.notify_all();
    }
}
