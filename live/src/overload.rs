//! Rules for events that arrive faster than the engine takes them, and the counters of the queue.

use std::fmt;
use std::time::Duration;

use meissner_engine::filters::Chain;

use crate::LiveError;

/// Rule for events while they arrive faster than the engine takes them.
///
/// `Thin` and `Filter` act while the queue is *congested*: from when it is more than half full
/// until it is a quarter full. If it still fills up, they drop the newest events.
#[derive(Clone, Debug)]
pub enum Overload {
    /// Nothing is dropped: the offering thread waits until there is room.
    Block,
    /// The oldest waiting event makes room: the engine receives recent events, after a gap.
    DropOldest,
    /// An event that finds no room is dropped: events without gaps, but old ones.
    DropNewest,
    /// While congested, only offered events whose number (from 0) is a multiple of `stride` enter.
    Thin {
        /// At least 1.
        stride: u32,
    },
    /// While congested, only events that pass these filters enter. They check every event at all
    /// times, in the offering thread. Frames pass all filters.
    Filter(Chain),
}

impl Overload {
    /// Short name, as in the program's reports.
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

/// Options of the queue between the threads.
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
    /// Maximum number of waiting events of 16 bytes, 1 to [`Self::MAX`], allocated at the start.
    /// Default: 65,536.
    pub capacity: usize,
    /// Rule for events that are too fast for the engine. Default: the oldest make room.
    pub overload: Overload,
    /// Maximum number of events that the worker inserts before it checks whether a prediction is
    /// due, 1 to [`Self::MAX`]. Default: 64.
    pub batch: usize,
    /// Core of the worker's thread, one of [`cores`](crate::cores). Default: the system's choice.
    pub core: Option<usize>,
    /// Whether the worker advances the clock and computes while it would wait. Answers come sooner,
    /// mainly if many events leave at once; in total, more is computed. Predictions keep their
    /// bits, unless an approximation depends on when they are read. Default: false.
    pub ahead: bool,
}

impl Default for QueueOptions {
    fn default() -> Self {
        Self { capacity: 1 << 16, overload: Overload::DropOldest, batch: 64, core: None, ahead: false }
    }
}

impl QueueOptions {
    /// Largest capacity and batch.
    pub const MAX: usize = 1 << 28;

    /// The default options.
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

    /// Sets [`Self::core`].
    pub fn with_core(self, core: Option<usize>) -> Self {
        Self { core, ..self }
    }

    /// Sets [`Self::ahead`].
    pub fn with_ahead(self, ahead: bool) -> Self {
        Self { ahead, ..self }
    }

    /// Bytes that a queue of `T` and the batch of its worker use during their lifetime.
    pub fn bytes<T>(&self) -> usize {
        (self.capacity + self.batch) * size_of::<T>()
    }

    pub(crate) fn check(&self) -> Result<(), LiveError> {
        let range = |what, value: usize, largest: usize| {
            let refusal =
                || LiveError::Option { what, expected: format!("1 to {largest}"), found: value.to_string() };
            if (1..=largest).contains(&value) { Ok(()) } else { Err(refusal()) }
        };
        range("capacity of the queue in events", self.capacity, Self::MAX)?;
        range("batch in events", self.batch, Self::MAX)?;
        if let Overload::Thin { stride } = self.overload {
            range("stride in events", stride as usize, u32::MAX as usize)?;
        }
        Ok(())
    }
}

/// Counts of offered events. At any time `offered = delivered + waiting + dropped()`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QueueCounters {
    /// Offered events that were processed.
    pub offered: u64,
    /// Events that the worker took.
    pub delivered: u64,
    /// Events that are waiting.
    pub waiting: u64,
    /// Dropped to make room for a newer event.
    pub dropped_oldest: u64,
    /// Dropped for lack of room.
    pub dropped_newest: u64,
    /// Dropped while congested: the number was not a multiple of the stride.
    pub thinned: u64,
    /// Dropped while congested: did not pass the filters.
    pub filtered: u64,
    /// Largest number of waiting events so far.
    pub high_water: u64,
    /// Total time that the offering thread waited for room.
    pub blocked: Duration,
}

impl QueueCounters {
    /// Dropped events, whatever the reason.
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
