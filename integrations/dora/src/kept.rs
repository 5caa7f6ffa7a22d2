//! An engine that leaves its state on a desk, from time to time, with what the state covers.
//!
//! The engine belongs to its worker's thread; the node's thread knows which events of the source the worker was given. They meet at the desk:
//! the node notes the place of each message (a [`Mark`]), the worker finds the place of its newest event there when it encodes its state.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use meissner::live::Predictor;
use meissner::{DropReason, EngineError, Event, EventCounters, Outcome, Prediction};
use serde::{Deserialize, Serialize};

use crate::coverage::Lost;
use crate::engine::Engine;

/// The place of a message: counts after its last event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Mark {
    /// Events that were given to this engine.
    pub(crate) entered: u64,
    /// Number of the next event of the source.
    pub(crate) next: u64,
    /// Events that were accepted in all.
    pub(crate) accepted: u64,
    /// Events that were lost in all.
    pub(crate) lost: Lost,
    /// When it was sent.
    pub(crate) sent_ns: i64,
    /// When it arrived.
    pub(crate) received_ns: i64,
}

/// What a state covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Covered {
    /// Life of the source.
    pub(crate) stream: i64,
    /// Number of the next event.
    pub(crate) next: u64,
    /// Events that the engine took.
    pub(crate) accepted: u64,
    /// Events that it did not.
    pub(crate) lost: Lost,
    /// Predictions so far.
    pub(crate) predictions: u64,
}

impl Covered {
    /// What the state in `bytes` of an `engine` covers, in its note.
    ///
    /// # Errors
    /// The bytes are no state, or one of another kind of network or of another program.
    pub(crate) fn of_state(engine: &Engine, bytes: &[u8]) -> Result<Self, EngineError> {
        serde_json::from_slice(&engine.note(bytes)?).map_err(|error| EngineError::Snapshot {
            what: "note",
            expected: "that of such a node".to_owned(),
            found: error.to_string(),
        })
    }
}

/// What node and worker tell each other.
#[derive(Debug, Default)]
pub(crate) struct Desk {
    /// Marks of messages that the newest prediction does not cover completely, in order, and one before them.
    pub(crate) marks: VecDeque<Mark>,
    /// Predictions that were sent.
    pub(crate) predictions: u64,
    /// Events that the engine had no use for, at the newest prediction.
    pub(crate) ignored: Vec<(DropReason, u64)>,
    /// The newest state that was not collected.
    state: Option<Vec<u8>>,
}

impl Desk {
    /// The place of the event after the first `entered`.
    pub(crate) fn place(&self, entered: u64) -> Mark {
        let mark = self.marks.iter().find(|mark| mark.entered >= entered).or(self.marks.back());
        let mark = mark.copied().unwrap_or_default();
        let short = mark.entered.saturating_sub(entered);
        Mark { entered, next: mark.next - short, accepted: mark.accepted - short, ..mark }
    }

    /// Forgets the marks before that of the event after the first `entered`.
    pub(crate) fn forget_before(&mut self, entered: u64) {
        while self.marks.len() > 1 && self.marks[0].entered < entered {
            self.marks.pop_front();
        }
    }

    /// The newest state, once.
    pub(crate) fn collect(&mut self) -> Option<Vec<u8>> {
        self.state.take()
    }
}

/// A desk that two threads use.
pub(crate) type Shared = Arc<Mutex<Desk>>;

/// Whoever panicked left counts that are consistent: each is written at once.
pub(crate) fn lock(desk: &Mutex<Desk>) -> MutexGuard<'_, Desk> {
    desk.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An engine that leaves its state.
pub(crate) struct Kept {
    engine: Engine,
    stream: i64,
    /// Events that it was given, since it was made.
    entered: u64,
    desk: Shared,
    /// Time between two states; `None` if none are left.
    every: Option<Duration>,
    left: Option<(u64, Instant)>,
}

impl Kept {
    /// `engine` over the events of the life `stream` of a source.
    pub(crate) fn new(engine: Engine, stream: i64, desk: Shared, every: Option<Duration>) -> Self {
        Self { engine, stream, entered: 0, desk, every, left: None }
    }

    /// Leaves the state if it is due and has changed.
    fn leave(&mut self) {
        let Some(every) = self.every.filter(|_| self.entered > 0) else { return };
        if self.left.is_some_and(|(entered, at)| entered == self.entered || at.elapsed() < every) {
            return;
        }
        let state = self.state();
        lock(&self.desk).state = Some(state);
        self.left = Some((self.entered, Instant::now()));
    }

    /// The state, with what it covers.
    pub(crate) fn state(&mut self) -> Vec<u8> {
        let (Mark { next, accepted, lost, .. }, predictions) = {
            let desk = lock(&self.desk);
            (desk.place(self.entered), desk.predictions)
        };
        let covered = Covered { stream: self.stream, next, accepted, lost, predictions };
        let note = serde_json::to_vec(&covered).expect("integers are written without errors");
        self.engine.encoded(&note)
    }
}

impl Predictor for Kept {
    type Input = Event;

    fn push(&mut self, event: Event) -> Outcome {
        self.entered += 1;
        self.engine.push(event)
    }

    fn push_from(&mut self, events: &mut Vec<Event>) {
        self.entered += events.len() as u64;
        self.engine.push_from(events);
    }

    fn advance(&mut self, t_us: i64) {
        self.engine.advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.leave();
        lock(&self.desk).ignored = self.engine.dropped();
        self.engine.predict()
    }

    fn reset(&mut self) {
        self.engine.reset();
    }

    fn event_counters(&self) -> EventCounters {
        self.engine.event_counters()
    }
}

#[cfg(test)]
mod tests {
    use super::{Desk, Mark};

    #[test]
    fn the_place_of_an_event_inside_a_message_is_counted_back_from_its_end() {
        let mark = |entered, next, accepted| Mark { entered, next, accepted, ..Mark::default() };
        let mut desk = Desk::default();
        assert_eq!(desk.place(0).next, 0);
        desk.marks.extend([mark(10, 110, 60), mark(10, 120, 60), mark(30, 150, 80)]);
        let places = [10, 11, 29, 30].map(|entered| desk.place(entered));
        assert_eq!(
            places.map(|mark| (mark.next, mark.accepted)),
            [(110, 60), (131, 61), (149, 79), (150, 80)]
        );
        desk.forget_before(11);
        assert_eq!(desk.marks, [mark(30, 150, 80)]);
        desk.forget_before(99);
        assert_eq!(desk.place(30).next, 150);
    }
}
