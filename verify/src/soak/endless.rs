//! Recordings in an endless loop, and disturbances between their events.
//!
//! Enters: recordings, and a seed. Leaves: events. All stamps of a recording are shifted, so that
//! it begins after the one before. Invariants: within a recording, differences between stamps are
//! its own, except for inserted silences; a shuffled deck of eight disturbances is dealt to its
//! end.

use std::sync::Arc;

use meissner_engine::Event;
use meissner_kernels::random::Random;

use crate::error::VerifyError;

/// Silences are below 2 to this power, in microseconds: some 9 minutes.
const MAX: u64 = 29;

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
}

/// The stream, at an event. A clone looks ahead.
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
    /// The stream over `recordings`, at least one, with random silences between them.
    pub(crate) fn new(recordings: Vec<Recording>, random: Random) -> Self {
        Self {
            recordings: recordings.into(),
            recording: 0,
            next: 0,
            shift_us: 0,
            newest_us: 0,
            silent_us: 0,
            rounds: 0,
            random,
        }
    }

    pub(crate) fn names(&self) -> Vec<String> {
        self.recordings.iter().map(|recording| recording.name.clone()).collect()
    }

    /// Number of recordings that have begun after the first.
    pub(crate) fn rounds(&self) -> u64 {
        self.rounds
    }

    /// Delays the next event by 1 us to some 9 minutes, and returns the middle of the silence.
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
    /// A silence, and time is moved on to its middle.
    Advance,
    /// The state is written as bytes, and a new engine goes on from them.
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
