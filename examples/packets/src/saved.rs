//! An engine that stores its state in a table, from time to time, with the events that the state
//! covers.
//!
//! The engine belongs to its worker's thread; the caller's thread knows which events of the stream
//! the worker got. They share the table: the caller notes the position of each packet (a [`Mark`]),
//! and the worker finds the position of its newest event there when it encodes its state.

use std::collections::VecDeque;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use meissner_engine::{DropReason, EngineError, Event, EventCounters, Outcome, Prediction, Predictor};
use meissner_io::{IoError, replace_file};
use serde::{Deserialize, Serialize};

use crate::coverage::Losses;
use crate::network::AnyEngine;

/// The position of a packet: counts after its last event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mark {
    /// Events that this engine got.
    pub entered: u64,
    /// Number of the next event of the stream.
    pub next: u64,
    /// Total number of accepted events.
    pub accepted: u64,
    /// Total number of lost events.
    pub lost: Losses,
    /// Sending time of the packet, in nanoseconds.
    pub sent_ns: i64,
    /// Its arrival, in nanoseconds.
    pub received_ns: i64,
}

/// The events that a state covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Covered {
    pub(crate) stream: i64,
    pub(crate) next: u64,
    pub(crate) accepted: u64,
    pub(crate) lost: Losses,
    pub(crate) predictions: u64,
}

impl Covered {
    /// The events that the state in `bytes` of an `engine` covers, from its note.
    pub(crate) fn of_state(engine: &AnyEngine, bytes: &[u8]) -> Result<Self, EngineError> {
        serde_json::from_slice(&engine.note(bytes)?).map_err(|error| EngineError::Snapshot {
            what: "note",
            expected: "that of a live sensor".to_owned(),
            found: error.to_string(),
        })
    }
}

/// Data that the caller and the worker share.
#[derive(Debug, Default)]
pub(crate) struct StateTable {
    /// Marks of packets that the newest prediction does not cover, in order, and one before them.
    pub(crate) marks: VecDeque<Mark>,
    /// Predictions that were answered.
    pub(crate) predictions: u64,
    /// Events that the engine did not use, at the newest prediction.
    pub(crate) ignored: Vec<(DropReason, u64)>,
    /// The newest state that was not collected.
    pub(crate) state: Option<Vec<u8>>,
}

impl StateTable {
    /// The position of the event after the first `entered`.
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
}

/// A table that two threads use.
pub(crate) type Shared = Arc<Mutex<StateTable>>;

/// After a panic the counts are still consistent, because each is written in one step.
pub(crate) fn lock(table: &Mutex<StateTable>) -> MutexGuard<'_, StateTable> {
    table.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An engine that stores its state in the table.
pub(crate) struct SavedEngine {
    engine: AnyEngine,
    stream: i64,
    /// Events that it got since it was made.
    entered: u64,
    table: Shared,
    /// Time between two states; `None` if none are stored.
    every: Option<Duration>,
    left: Option<(u64, Instant)>,
}

impl SavedEngine {
    /// `engine` over the events of `stream`.
    pub(crate) fn new(engine: AnyEngine, stream: i64, table: Shared, every: Option<Duration>) -> Self {
        Self { engine, stream, entered: 0, table, every, left: None }
    }

    /// Stores the state if it is due and has changed.
    fn leave(&mut self) {
        let Some(every) = self.every.filter(|_| self.entered > 0) else { return };
        if self.left.is_some_and(|(entered, at)| entered == self.entered || at.elapsed() < every) {
            return;
        }
        let state = self.state();
        lock(&self.table).state = Some(state);
        self.left = Some((self.entered, Instant::now()));
    }

    /// The state, with the events that it covers.
    pub(crate) fn state(&mut self) -> Vec<u8> {
        let (Mark { next, accepted, lost, .. }, predictions) = {
            let table = lock(&self.table);
            (table.place(self.entered), table.predictions)
        };
        let covered = Covered { stream: self.stream, next, accepted, lost, predictions };
        let note = serde_json::to_vec(&covered).expect("integers are written without errors");
        self.engine.to_bytes_with(&note)
    }
}

impl Predictor for SavedEngine {
    type Input = Event;

    fn push(&mut self, event: &Event) -> Result<Outcome, EngineError> {
        self.entered += 1;
        self.engine.push(event)
    }

    fn push_slice(&mut self, events: &[Event]) -> Result<(), EngineError> {
        self.entered += events.len() as u64;
        Predictor::push_slice(&mut self.engine, events)
    }

    fn advance(&mut self, t_us: i64) {
        self.engine.advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.leave();
        lock(&self.table).ignored = self.engine.dropped().to_vec();
        self.engine.predict()
    }

    fn reset(&mut self) {
        self.engine.reset();
    }

    fn event_counters(&self) -> EventCounters {
        self.engine.event_counters()
    }
}

/// Writes states to files in a separate thread, because a disk may take longer than a prediction.
pub struct StateWriter {
    states: Sender<(PathBuf, Vec<u8>)>,
    failed: Receiver<IoError>,
    thread: thread::JoinHandle<()>,
}

impl Default for StateWriter {
    fn default() -> Self {
        let (states, written) = channel::<(PathBuf, Vec<u8>)>();
        let (failing, failed) = channel();
        let write = move || {
            for (path, state) in written {
                // Nobody reads the error if the caller has ended.
                let _ = write(&path, &state).map_err(|error| failing.send(error));
            }
        };
        Self { states, failed, thread: thread::spawn(write) }
    }
}

impl StateWriter {
    /// Sends a state to be written to the file at `path`.
    pub fn write(&self, (path, state): (PathBuf, Vec<u8>)) {
        // The thread ends with the writer.
        let _ = self.states.send((path, state));
    }

    /// Errors of writing states since the previous call.
    pub fn failures(&self) -> impl Iterator<Item = IoError> {
        self.failed.try_iter()
    }

    /// Waits until all states are written.
    pub fn close(self) {
        drop(self.states);
        // It has not panicked, or has printed the panic.
        let _ = self.thread.join();
    }
}

/// Replaces the state in the file at `path` in one step, or leaves the former one.
pub(crate) fn write(path: &Path, state: &[u8]) -> Result<(), IoError> {
    replace_file(path, |out| out.write_all(state))
}

#[cfg(test)]
mod tests {
    use super::{Mark, StateTable};

    #[test]
    fn the_place_of_an_event_inside_a_packet_is_counted_back_from_its_end() {
        let mark = |entered, next, accepted| Mark { entered, next, accepted, ..Mark::default() };
        let mut table = StateTable::default();
        assert_eq!(table.place(0).next, 0);
        table.marks.extend([mark(10, 110, 60), mark(10, 120, 60), mark(30, 150, 80)]);
        let places = [10, 11, 29, 30].map(|entered| table.place(entered));
        assert_eq!(
            places.map(|mark| (mark.next, mark.accepted)),
            [(110, 60), (131, 61), (149, 79), (150, 80)]
        );
        table.forget_before(11);
        assert_eq!(table.marks, [mark(30, 150, 80)]);
        table.forget_before(99);
        assert_eq!(table.place(30).next, 150);
    }
}
