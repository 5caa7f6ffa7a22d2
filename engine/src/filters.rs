//! Filters in front of an engine: which events enter at all.
//!
//! Enters: events, one at a time. Leaves: whether each passes. A filter keeps what it needs of the events before, takes
//! O(1) for an event and allocates nothing after it was made. It knows neither a window nor what the engine drops: it sees
//! events outside the sensor and late ones, too, and leaves those to the engine to count.
//!
//! | filter | what passes | source |
//! |---|---|---|
//! | [`Stride`] | every nth event | |
//! | [`RateLimit`] | what a rate allows | token bucket, the mirror of the leaky bucket of Turner 1986, "New directions in communications" |
//! | [`BackgroundActivity`] | what has a recent neighbour | Delbruck 2008, "Frame-free dynamic digital vision" |
//! | [`Refractory`] | at most one event of a pixel in a time | the refractory filter of jAER |
//!
//! Times are compared by the magnitude of their difference as 64 unsigned bits, which any two stamps have: nothing
//! overflows. Where an event is earlier than one before it, each filter says what happens.

mod activity;
mod chain;
mod rate;
mod refractory;
mod stamps;
mod stride;

pub use activity::BackgroundActivity;
pub use chain::{Chain, Filter};
pub use rate::RateLimit;
pub use refractory::Refractory;
pub use stride::Stride;

use crate::Event;

/// Decides, event by event, what passes.
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

/// What became of the events that a filter saw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FilterCounters {
    /// Events that passed.
    pub passed: u64,
    /// Events that did not.
    pub dropped: u64,
}

impl FilterCounters {
    /// Counts an event, and says again whether it passed.
    fn count(&mut self, passed: bool) -> bool {
        self.passed += u64::from(passed);
        self.dropped += u64::from(!passed);
        passed
    }
}
