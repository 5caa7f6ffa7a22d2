//! The queue of events, without threads.
//!
//! Input: offered events or frames and, for `Filter`, whether each passes. Output: events in order
//! of arrival. Invariants: at most `capacity` events wait; `offered = delivered + waiting +
//! dropped`; no memory is allocated later; which events enter does not depend on slices.
//!
//! *Positions* number the entered events from 1. Events up to `left()` were delivered, or dropped
//! as the oldest; those up to `entered()` have left or are waiting.

use std::collections::VecDeque;

use meissner_engine::Event;
use meissner_engine::frames::Frame;

use crate::{Overload, QueueCounters};

/// An item of the queue: an [`Event`] or a [`Frame`].
pub trait Item: Clone + std::fmt::Debug + Send + 'static {
    /// Its time in microseconds.
    fn t_us(&self) -> i64;
    /// The event that filters check; `None` if filters do not apply.
    fn event(&self) -> Option<Event>;
}

impl Item for Event {
    fn t_us(&self) -> i64 {
        self.t_us
    }

    fn event(&self) -> Option<Event> {
        Some(*self)
    }
}

impl Item for Frame {
    fn t_us(&self) -> i64 {
        self.t_us
    }

    fn event(&self) -> Option<Event> {
        None
    }
}

/// A bounded queue with an overload rule.
#[derive(Debug)]
pub(crate) struct Intake<T> {
    pub(crate) ring: VecDeque<T>,
    capacity: usize,
    overload: Overload,
    congested: bool,
    counters: QueueCounters,
    /// Times of the first and of the newest event that entered.
    stamps_us: Option<(i64, i64)>,
}

impl<T: Item> Intake<T> {
    /// An empty queue for `capacity` events, at least 1.
    pub(crate) fn new(capacity: usize, overload: Overload) -> Self {
        Self {
            ring: VecDeque::with_capacity(capacity),
            capacity,
            overload,
            congested: false,
            counters: QueueCounters::default(),
            stamps_us: None,
        }
    }

    /// Processes `events`. `passes` tells whether each passes the filters; it is empty without
    /// filters. Returns the number of processed events: all, or under `Block` those that found
    /// room.
    pub(crate) fn offer(&mut self, events: &[T], passes: &[bool]) -> usize {
        let room = self.capacity - self.ring.len();
        let taken = match self.overload {
            Overload::Block => {
                let taken = room.min(events.len());
                self.enter(&events[..taken]);
                taken
            }
            Overload::DropNewest => {
                let entering = room.min(events.len());
                self.enter(&events[..entering]);
                self.counters.dropped_newest += (events.len() - entering) as u64;
                events.len()
            }
            Overload::DropOldest => {
                // If they entered one by one, events beyond the capacity would push out those at
                // the start of the slice.
                let (gone, staying) = events.split_at(events.len().saturating_sub(self.capacity));
                let leaving = self.ring.len().saturating_sub(self.capacity - staying.len());
                self.ring.drain(..leaving);
                self.counters.dropped_oldest += (gone.len() + leaving) as u64;
                if gone.len() + leaving > 0 {
                    self.counters.high_water = self.capacity as u64;
                }
                self.enter(staying);
                events.len()
            }
            Overload::Thin { stride } => {
                self.one_by_one(events, |number, _| number.is_multiple_of(stride.into()));
                events.len()
            }
            Overload::Filter(_) => {
                self.one_by_one(events, |_, place| passes[place]);
                events.len()
            }
        };
        self.counters.offered += taken as u64;
        self.counters.waiting = self.ring.len() as u64;
        taken
    }

    /// Lets `events` enter: all if the queue is not congested, else those for which `stays(number,
    /// index)` is true, with the event's number since the start and its index here.
    fn one_by_one(&mut self, events: &[T], stays: impl Fn(u64, usize) -> bool) {
        for (place, event) in events.iter().enumerate() {
            let waiting = self.ring.len();
            self.congested = self.is_congested(self.congested);
            if self.congested && !stays(self.counters.offered + place as u64, place) {
                match self.overload {
                    Overload::Filter(_) => self.counters.filtered += 1,
                    _ => self.counters.thinned += 1,
                }
            } else if waiting == self.capacity {
                self.counters.dropped_newest += 1;
            } else {
                self.enter(std::slice::from_ref(event));
            }
        }
    }

    fn enter(&mut self, events: &[T]) {
        self.ring.extend(events.iter().cloned());
        if let (Some(first), Some(newest)) = (events.first(), events.last()) {
            self.stamps_us = Some((self.stamps_us.map_or(first.t_us(), |(first, _)| first), newest.t_us()));
        }
        self.counters.high_water = self.counters.high_water.max(self.ring.len() as u64);
    }

    /// Moves the oldest events, at most `most`, to the end of `to`; returns their number.
    pub(crate) fn take(&mut self, most: usize, to: &mut Vec<T>) -> usize {
        let taken = most.min(self.ring.len());
        to.extend(self.ring.drain(..taken));
        self.counters.delivered += taken as u64;
        self.counters.waiting -= taken as u64;
        taken
    }

    pub(crate) fn waiting(&self) -> usize {
        self.ring.len()
    }

    /// Whether more than half of the capacity is taken.
    pub(crate) fn is_crowded(&self) -> bool {
        2 * self.ring.len() > self.capacity
    }

    /// Whether the queue is congested: from when more than half is taken until a quarter is.
    pub(crate) fn is_congested(&self, was: bool) -> bool {
        if was { 4 * self.ring.len() > self.capacity } else { self.is_crowded() }
    }

    /// Position of the newest event that entered.
    pub(crate) fn entered(&self) -> u64 {
        self.left() + self.counters.waiting
    }

    /// Position of the newest event that left.
    pub(crate) fn left(&self) -> u64 {
        self.counters.delivered + self.counters.dropped_oldest
    }

    /// Times of the first and of the newest event that entered.
    pub(crate) fn stamps_us(&self) -> Option<(i64, i64)> {
        self.stamps_us
    }

    pub(crate) fn counters(&self) -> &QueueCounters {
        &self.counters
    }

    pub(crate) fn counters_mut(&mut self) -> &mut QueueCounters {
        &mut self.counters
    }
}
