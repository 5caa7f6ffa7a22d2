//! Filters in front of an engine: which events enter at all.
//!
//! Enters: events, one at a time. Leaves: whether each passes. A filter takes O(1) for an event and
//! allocates nothing later. It knows neither window nor admission: it also sees late events and
//! those outside the sensor, which the engine counts.
//!
//! | filter | passes | source |
//! |---|---|---|
//! | [`Stride`] | every nth event | |
//! | [`RateLimit`] | as many events as a rate allows | token bucket (the mirror of Turner 1986) |
//! | [`BackgroundActivity`] | events with a recent neighbour | Delbruck 2008 |
//! | [`Refractory`] | at most one event of a pixel in a time | the refractory filter of jAER |
//!
//! Times are compared by the magnitude of their difference as u64, which cannot overflow. Each
//! filter says how it treats an event that is earlier than one before.

mod chain;
mod pixels;
mod rate;

pub use chain::{Chain, Filter};
pub use pixels::{BackgroundActivity, Refractory};
pub use rate::{RateLimit, Stride};

use crate::Event;

/// Decides, event by event, which events pass.
pub trait EventFilter {
    /// Whether `event`, the next one, passes.
    fn admit(&mut self, event: Event) -> bool;
    /// Forgets all events; counts go on.
    fn reset(&mut self);
    /// Counts since the filter was made.
    fn counters(&self) -> FilterCounters;
    /// A short name, as in the program's reports.
    fn name(&self) -> &'static str;
}

/// Numbers of events that passed and that were dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FilterCounters {
    /// Events that passed.
    pub passed: u64,
    /// Events that were dropped.
    pub dropped: u64,
}

impl FilterCounters {
    /// Counts an event, and returns whether it passed.
    fn count(&mut self, passed: bool) -> bool {
        self.passed += u64::from(passed);
        self.dropped += u64::from(!passed);
        passed
    }
}

/// The name and the counters of a filter with a field `counters`.
macro_rules! reports {
    ($name:literal) => {
        fn counters(&self) -> $crate::filters::FilterCounters {
            self.counters
        }

        fn name(&self) -> &'static str {
            $name
        }
    };
}
use reports;
