//! The items of a session, a cursor between them, and states of the engine to return to.
//!
//! Invariant: states are of the engine after the items before them, and take a bounded number of
//! bytes. If they become too many, every second one is removed, and the next ones are further
//! apart.

use crate::subject::Item;

/// Bytes of all states.
const MAX_BYTES: usize = 64 << 20;

/// Items with a cursor.
#[derive(Debug)]
pub(super) struct History<I> {
    items: Vec<I>,
    /// Time of the first item of all.
    first_us: i64,
    /// Number of items before the cursor.
    pub(super) cursor: usize,
    /// Items that were forgotten.
    pub(super) forgotten: u64,
    states: Vec<(usize, Vec<u8>)>,
    apart: usize,
}

impl<I: Item> History<I> {
    pub(super) fn new(items: Vec<I>) -> Self {
        let first_us = items.first().map_or(0, Item::t_us);
        Self { items, first_us, cursor: 0, forgotten: 0, states: Vec::new(), apart: I::APART }
    }

    pub(super) fn len(&self) -> usize {
        self.items.len()
    }

    /// Whether no item has come yet.
    pub(super) fn is_new(&self) -> bool {
        self.items.is_empty() && self.forgotten == 0
    }

    pub(super) fn extend(&mut self, items: Vec<I>) {
        if self.is_new() {
            self.first_us = items.first().map_or(0, Item::t_us);
        }
        self.items.extend(items);
    }

    /// Forgets the oldest `count` items; returns the number of forgotten ones.
    pub(super) fn forget(&mut self, count: usize) -> usize {
        self.items.drain(..count);
        self.forgotten += count as u64;
        self.cursor = self.cursor.saturating_sub(count);
        self.states.retain_mut(|(event, _)| {
            let kept = *event >= count;
            *event = event.saturating_sub(count);
            kept
        });
        count
    }

    /// The items from the cursor to `end`.
    pub(super) fn slice(&self, end: usize) -> &[I] {
        &self.items[self.cursor..end]
    }

    /// The first `count` items.
    pub(super) fn first(&self, count: usize) -> &[I] {
        &self.items[..count]
    }

    /// The items before the cursor.
    pub(super) fn taken(&self) -> &[I] {
        self.first(self.cursor)
    }

    /// Time of the last event in microseconds from the first.
    pub(super) fn end_us(&self) -> i64 {
        self.time_of(self.items.len()) as i64
    }

    /// Time of the last of the first `count` events in microseconds from the first event.
    pub(super) fn time_of(&self, count: usize) -> f64 {
        let last = count.checked_sub(1).and_then(|last| self.items.get(last));
        last.map_or(0.0, |item| item.t_us().saturating_sub(self.first_us) as f64)
    }

    /// The absolute time of `t_us` from the first event.
    pub(super) fn absolute_us(&self, t_us: f64) -> i64 {
        self.first_us.saturating_add(t_us as i64)
    }

    /// Number of events until `t_us` from the first event, if times ascend.
    pub(super) fn until_us(&self, t_us: f64) -> usize {
        self.items.partition_point(|item| item.t_us().saturating_sub(self.first_us) as f64 <= t_us)
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
        self.apart = I::APART;
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
