//! A bound on the rate of events.
//!
//! ```text
//! credit <- min(credit + rate (t - newest), depth),  newest <- t      where t > newest
//! an event passes where credit >= 1, and takes 1 off it               depth = max(rate 1 ms, 1), full at the start
//! ```
//!
//! Credit counts in millionths of an event, so that a microsecond brings `rate` of them and everything is an integer.

use super::{EventFilter, FilterCounters};
use crate::error::in_range;
use crate::{EngineError, Event};

/// Thins events evenly where they come faster than a rate, and lets all pass where they do not: a token bucket.
///
/// Of any interval of T microseconds, at most `rate` T / 10^6 + `depth` events pass; and where no interval holds more,
/// every event does. In a steady stream at a higher rate, what passes comes at even distances once the depth is used up.
///
/// An event that is earlier than the newest one brings no credit, and passes where there is some: the bound holds over
/// the newest times, however stamps go back and forth. A clock that starts again needs a [`reset`](EventFilter::reset),
/// as the engine does.
#[derive(Clone, Debug)]
pub struct RateLimit {
    events_per_s: u64,
    credit: u64,
    depth: u64,
    newest_us: Option<i64>,
    counters: FilterCounters,
}

/// Credit that an event takes.
const EVENT: u64 = 1_000_000;

impl RateLimit {
    /// Stream time at the rate that the bucket holds, in microseconds: how long a burst may be before it is thinned.
    pub const DEPTH_US: u64 = 1_000;
    /// Highest rate, in events per second.
    pub const HIGHEST: u64 = 1_000_000_000_000;

    /// Lets `events_per_s` events a second pass.
    ///
    /// # Errors
    /// [`EngineError::Option`] for a rate of 0 or above [`Self::HIGHEST`].
    pub fn new(events_per_s: u64) -> Result<Self, EngineError> {
        let rate = i64::try_from(events_per_s).unwrap_or(i64::MAX);
        in_range("rate limit in events per second", rate, 1, Self::HIGHEST as i64)?;
        let depth = (events_per_s * Self::DEPTH_US).max(EVENT);
        Ok(Self { events_per_s, credit: depth, depth, newest_us: None, counters: FilterCounters::default() })
    }

    /// Millionths of an event that the bucket holds.
    pub fn depth_millionths(&self) -> u64 {
        self.depth
    }
}

impl EventFilter for RateLimit {
    fn admit(&mut self, event: Event) -> bool {
        let newest = self.newest_us.unwrap_or(event.t_us);
        if event.t_us > newest {
            let earned = event.t_us.abs_diff(newest).saturating_mul(self.events_per_s);
            self.credit = self.credit.saturating_add(earned).min(self.depth);
        }
        self.newest_us = Some(newest.max(event.t_us));
        let passes = self.credit >= EVENT;
        if passes {
            self.credit -= EVENT;
        }
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.credit = self.depth;
        self.newest_us = None;
    }

    fn counters(&self) -> FilterCounters {
        self.counters
    }

    fn name(&self) -> &'static str {
        "rate_limit"
    }
}
