//! What becomes of events that come faster than they are taken, and the counts of it.

use std::fmt;
use std::time::Duration;

use meissner_engine::filters::Chain;

use crate::LiveError;

/// What happens to events while they come faster than the engine takes them.
///
/// `Thin` and `Filter` act while the queue is *congested*: from more than half full until a quarter full. Should it
/// fill up all the same, they drop the newest.
#[derive(Clone, Debug)]
pub enum Overload {
    /// Nothing is dropped: who offers events waits until there is room.
    Block,
    /// The oldest waiting event makes room: what is taken is recent, after a gap.
    DropOldest,
    /// The event that finds no room is dropped: what is taken is without gaps, and old.
    DropNewest,
    /// While congested, of the offered events numbered from 0, only multiples of `stride` enter.
    Thin {
        /// At least 1.
        stride: u32,
    },
    /// While congested, only what passes these filters enters. They see every event at any time, so that they know what
    /// came before when it matters, and work in the thread that offers. Frames pass all filters.
    Filter(Chain),
}

impl Overload {
    /// A short name, as in the program's reports.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Block => "block",
            Self::DropOldest => "drop_oldest",
            Self::DropNewest => "drop_newest",
            Self::Thin { .. } => "thin",
            Self::Filter(_) => "filter",
        }
    }
}

impl fmt::Display for Overload {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The queue between the threads, and how the worker takes events from it.
///
/// ```
/// use meissner_live::{Overload, QueueOptions};
///
/// let options = QueueOptions::new().with_capacity(8192).with_overload(Overload::Block);
/// assert_eq!(options.batch, 64);
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
#[must_use]
pub struct QueueOptions {
    /// Most events that wait, 1 to [`Self::LARGEST`]: by default 65,536. Each takes 16 bytes, allocated at the start.
    pub capacity: usize,
    /// What happens to events that come faster than they are taken. By default the oldest make room.
    pub overload: Overload,
    /// Most events that the worker pushes before it checks whether a prediction is due, 1 to [`Self::LARGEST`]: by
    /// default 64.
    pub batch: usize,
}

impl Default for QueueOptions {
    fn default() -> Self {
        Self { capacity: 1 << 16, overload: Overload::DropOldest, batch: 64 }
    }
}

impl QueueOptions {
    /// Largest capacity and batch.
    pub const LARGEST: usize = 1 << 28;

    /// The defaults.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets [`Self::capacity`].
    pub fn with_capacity(self, capacity: usize) -> Self {
        Self { capacity, ..self }
    }

    /// Sets [`Self::overload`].
    pub fn with_overload(self, overload: Overload) -> Self {
        Self { overload, ..self }
    }

    /// Sets [`Self::batch`].
    pub fn with_batch(self, batch: usize) -> Self {
        Self { batch, ..self }
    }

    pub(crate) fn check(&self) -> Result<(), LiveError> {
        let range = |what, value: usize, largest: usize| {
            let refusal =
                || LiveError::Option { what, expected: format!("1 to {largest}"), found: value.to_string() };
            if (1..=largest).contains(&value) { Ok(()) } else { Err(refusal()) }
        };
        range("capacity of the queue in events", self.capacity, Self::LARGEST)?;
        range("batch in events", self.batch, Self::LARGEST)?;
        if let Overload::Thin { stride } = self.overload {
            range("stride in events", stride as usize, u32::MAX as usize)?;
        }
        Ok(())
    }
}

/// What became of offered events. At any time `offered = delivered + waiting + dropped()`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QueueCounters {
    /// Events that were offered and decided about.
    pub offered: u64,
    /// Events that the worker took.
    pub delivered: u64,
    /// Events that wait.
    pub waiting: u64,
    /// Dropped: made room for a newer one.
    pub dropped_oldest: u64,
    /// Dropped: found no room.
    pub dropped_newest: u64,
    /// Dropped: no multiple of the stride, while congested.
    pub thinned: u64,
    /// Dropped: did not pass the filters, while congested.
    pub filtered: u64,
    /// Most events that waited at any time.
    pub high_water: u64,
    /// Time for which who offers events waited for room.
    pub blocked: Duration,
}

impl QueueCounters {
    /// Events that were dropped, whatever the reason.
    pub fn dropped(&self) -> u64 {
        self.dropped_by_reason().iter().map(|(_, count)| count).sum()
    }

    /// Dropped events by reason, with short names as in the program's reports.
    pub fn dropped_by_reason(&self) -> [(&'static str, u64); 4] {
        [
            ("oldest", self.dropped_oldest),
            ("newest", self.dropped_newest),
            ("thinned", self.thinned),
            ("filtered", self.filtered),
        ]
    }
}
