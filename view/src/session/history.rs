//! The events of a session, a cursor between them, and states of the engine to return to.
//!
//! Invariant: states are of the engine after the events before them, and take a bounded number of
//! bytes: when they become too many, every second one goes, and those to come are further apart.

use meissner_engine::Event;

/// Bytes of all states.
const MAX_BYTES: usize = 64 << 20;
/// Events between two states at first.
const APART: usize = 8192;

/// Events with a cursor.
#[derive(Debug)]
pub(super) struct History {
    events: Vec<Event>,
    /// Time of the first event of all.
    first_us: i64,
    /// Number of events before the cursor.
    pub(super) cursor: usize,
    /// Events that were forgotten.
    pub(super) forgotten: u64,
    states: Vec<(usize, Vec<u8>)>,
    apart: usize,
}

impl History {
    pub(super) fn new(events: Vec<Event>) -> Self {
        let first_us = events.first().map_or(0, |event| event.t_us);
        Self { events, first_us, cursor: 0, forgotten: 0, states: Vec::new(), apart: APART }
    }

    pub(super) fn len(&self) -> usize {
        self.events.len()
    }

    pub(super) fn extend(&mut self, events: &[Event]) {
        if self.events.is_empty() && self.forgotten == 0 {
            self.first_us = events.first().map_or(0, |event| event.t_us);
        }
        self.events.extend_from_slice(events);
    }

    /// Forgets the oldest `count` events; returns how many.
    pub(super) fn forget(&mut self, count: usize) -> usize {
        self.events.drain(..count);
        self.forgotten += count as u64;
        self.cursor = self.cursor.saturating_sub(count);
        self.states.retain_mut(|(event, _)| {
            let kept = *event >= count;
            *event = event.saturating_sub(count);
            kept
        });
        count
    }

    /// The events from the cursor to `end`.
    pub(super) fn slice(&self, end: usize) -> &[Event] {
        &self.events[self.cursor..end]
    }

    /// The events before the cursor.
    pub(super) fn taken(&self) -> &[Event] {
        &self.events[..self.cursor]
    }

    /// Time of the last event in microseconds from the first.
    pub(super) fn end_us(&self) -> i64 {
        self.time_of(self.events.len()) as i64
    }

    /// Time of the last of the first `count` events in microseconds from the first event.
    pub(super) fn time_of(&self, count: usize) -> f64 {
        let last = count.checked_sub(1).and_then(|last| self.events.get(last));
        last.map_or(0.0, |event| event.t_us.saturating_sub(self.first_us) as f64)
    }

    /// The absolute time of `t_us` from the first event.
    pub(super) fn absolute_us(&self, t_us: f64) -> i64 {
        self.first_us.saturating_add(t_us as i64)
    }

    /// Number of events until `t_us` from the first event, if times ascend.
    pub(super) fn until_us(&self, t_us: f64) -> usize {
        self.events.partition_point(|event| event.t_us.saturating_sub(self.first_us) as f64 <= t_us)
    }

    /// Whether a state at the cursor is worth keeping.
    pub(super) fn wants_state(&self) -> bool {
        self.cursor >= self.states.last().map_or(0, |(event, _)| *event) + self.apart
    }

    pub(super) fn keep_state(&mut self, bytes: Vec<u8>) {
        self.states.push((self.cursor, bytes));
        while self.states.len() > 1
            && self.states.iter().map(|(_, bytes)| bytes.len()).sum::<usize>() > MAX_BYTES
        {
            let mut index = 0;
            self.states.retain(|_| {
                index += 1;
                index % 2 == 0
            });
            self.apart *= 2;
        }
    }

    pub(super) fn forget_states(&mut self) {
        self.states.clear();
        self.apart = APART;
    }

    /// The last state after at most `event` events.
    pub(super) fn state_before(&self, event: usize) -> Option<(usize, &[u8])> {
        let after = self.states.partition_point(|(of, _)| *of <= event);
        self.states[..after].last().map(|(of, bytes)| (*of, &bytes[..]))
    }

    /// Whether there is a state after more than `from` and at most `to` events.
    pub(super) fn has_state_between(&self, from: usize, to: usize) -> bool {
        self.state_before(to).is_some_and(|(event, _)| event > from)
    }
}
