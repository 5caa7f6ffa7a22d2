//! Recordings in an endless loop, and disturbances between their events.
//!
//! Input: recordings, and a seed. Output: events. All stamps of a recording are shifted, so that
//! it begins after the one before; the first one begins with any of its events. Invariants: within
//! a recording, differences between stamps are those of the recording, except for inserted
//! silences; a shuffled deck of eight disturbances is dealt to its end.

use std::sync::Arc;

use meissner_engine::Event;
use meissner_kernels::random::Random;

use crate::error::VerifyError;

/// Silences are below 2 to this power, in microseconds: about 9 minutes.
const MAX: u64 = 29;
/// The first event comes before 2 to this power, in microseconds: about a year.
const MAX_START: u64 = 45;

/// A recording with at least one event.
#[derive(Debug)]
pub struct Recording {
    name: String,
    /// Times count from the first event.
    events: Vec<Event>,
}

impl Recording {
    /// The recording called `name`.
    ///
    /// # Errors
    /// [`VerifyError::Empty`] without events.
    pub fn new(name: String, mut events: Vec<Event>) -> Result<Self, VerifyError> {
        let Some(begin) = events.first().map(|event| event.t_us) else {
            return Err(VerifyError::Empty(name));
        };
        events.iter_mut().for_each(|event| event.t_us = event.t_us.saturating_sub(begin));
        Ok(Self { name, events })
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn events(&self) -> &[Event] {
        &self.events
    }
}

/// The stream, positioned at an event. A clone can look ahead.
#[derive(Clone, Debug)]
pub(crate) struct Endless {
    recordings: Arc<[Recording]>,
    recording: usize,
    next: usize,
    shift_us: i64,
    newest_us: i64,
    /// Silence since the last event.
    silent_us: i64,
    rounds: u64,
    random: Random,
}

impl Endless {
    /// The stream over `recordings`, at least one, with random silences between them. It begins
    /// with a random event, at a random time.
    pub(crate) fn new(recordings: Arc<[Recording]>, mut random: Random) -> Self {
        let recording = random.below(recordings.len() as u64) as usize;
        let next = random.below(recordings[recording].events.len() as u64) as usize;
        let newest_us = random.below(1 << MAX_START) as i64;
        let shift_us = newest_us.saturating_sub(recordings[recording].events[next].t_us);
        Self { recordings, recording, next, shift_us, newest_us, silent_us: 0, rounds: 0, random }
    }

    /// Number of recordings that have begun after the first.
    pub(crate) fn rounds(&self) -> u64 {
        self.rounds
    }

    /// Delays the next event by 1 us to about 9 minutes, and returns the middle of the silence.
    pub(crate) fn fall_silent(&mut self) -> i64 {
        let magnitude = 1 << self.random.below(MAX);
        let silence = (magnitude + self.random.below(magnitude)) as i64;
        self.shift_us = self.shift_us.saturating_add(silence);
        self.silent_us = self.silent_us.saturating_add(silence);
        self.newest_us.saturating_add(self.silent_us - silence / 2)
    }

    /// The next event.
    pub(crate) fn next(&mut self) -> Event {
        if self.next == self.recordings[self.recording].events.len() {
            self.recording = (self.recording + 1) % self.recordings.len();
            self.next = 0;
            self.rounds += 1;
            self.shift_us = self.newest_us.saturating_add(self.silent_us);
            self.fall_silent();
        }
        let event = self.recordings[self.recording].events[self.next];
        self.next += 1;
        self.silent_us = 0;
        let t_us = event.t_us.saturating_add(self.shift_us);
        self.newest_us = self.newest_us.max(t_us);
        Event { t_us, ..event }
    }
}

/// A disturbance between two events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Disturbance {
    /// Nothing happens for a while.
    Silence,
    /// A silence, with an advance of the time to its middle.
    Advance,
    /// The state is written as bytes, and a new engine continues from them.
    Bytes,
    /// A snapshot in memory, events that are to be forgotten, and the return to it.
    Snapshot {
        /// Events between snapshot and return.
        detour: u64,
    },
    /// All events are forgotten.
    Reset,
}

/// Upper bound of the events between a snapshot and the return to it.
const DETOUR: u64 = 3_000;

/// An endless sequence of disturbances.
#[derive(Debug)]
pub(crate) struct Deck {
    random: Random,
    mean: u64,
    /// Events until the next one.
    left: u64,
    cards: [Disturbance; 8],
    dealt: usize,
}

impl Deck {
    /// Random disturbances, on average one every `mean` events.
    pub(crate) fn new(mut random: Random, mean: u64) -> Self {
        use Disturbance::{Advance, Bytes, Reset, Silence, Snapshot};
        let snapshot = Snapshot { detour: 0 };
        let cards = [Silence, Silence, Advance, Bytes, Bytes, snapshot, snapshot, Reset];
        let left = distance(&mut random, mean);
        Self { random, mean, left, dealt: cards.len(), cards }
    }

    /// Counts an event. Returns the disturbance that is due before it.
    pub(crate) fn after_an_event(&mut self) -> Option<Disturbance> {
        if self.left > 0 {
            self.left -= 1;
            return None;
        }
        self.left = distance(&mut self.random, self.mean);
        if self.dealt == self.cards.len() {
            self.dealt = 0;
            // Fisher and Yates.
            for i in (1..self.cards.len()).rev() {
                self.cards.swap(i, self.random.below(i as u64 + 1) as usize);
            }
        }
        self.dealt += 1;
        Some(match self.cards[self.dealt - 1] {
            Disturbance::Snapshot { .. } => Disturbance::Snapshot { detour: 1 + self.random.below(DETOUR) },
            card => card,
        })
    }
}

/// Number of events without a disturbance: uniform, `mean` - 1 on average.
fn distance(random: &mut Random, mean: u64) -> u64 {
    random.below(2 * mean - 1)
}
