//! Filters that thin a stream: every nth event, and a bound on the rate of events.

use super::{EventFilter, FilterCounters, reports};
use crate::error::in_range;
use crate::{EngineError, Event};

/// Passes the first of every `n` events, whatever their times and pixels.
#[derive(Clone, Debug)]
pub struct Stride {
    n: u32,
    /// Events since the last one that passed, modulo n.
    since: u32,
    counters: FilterCounters,
}

impl Stride {
    /// Passes the first, the (n + 1)th, the (2 n + 1)th, ... event.
    ///
    /// # Errors
    /// [`EngineError::Option`] if `n` is 0.
    pub fn new(n: u32) -> Result<Self, EngineError> {
        in_range("stride in events", i64::from(n), 1, i64::from(u32::MAX))?;
        Ok(Self { n, since: 0, counters: FilterCounters::default() })
    }
}

impl EventFilter for Stride {
    fn admit(&mut self, _: Event) -> bool {
        let passes = self.since == 0;
        self.since += 1;
        if self.since == self.n {
            self.since = 0;
        }
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.since = 0;
    }

    reports!("stride");
}

/// A token bucket: thins events evenly if they come faster than a rate.
///
/// ```text
/// credit <- min(credit + rate (t - newest), depth),  newest <- t      if t > newest
/// an event passes if credit >= 1, and takes 1 off it;
/// depth = max(rate 1 ms, 1), full at the start
/// ```
///
/// Credit counts in millionths of an event, so a microsecond brings `rate`, an integer. In any T
/// microseconds at most `rate` T / 10^6 + `depth` events pass; if no interval holds more, all do.
/// In a steady faster stream, events pass at even distances once the depth is used.
///
/// An event earlier than the newest brings no credit, and passes if there is some: the bound holds
/// over the newest times. After a restart of the clock, [`reset`](EventFilter::reset) the filter.
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
    /// Microseconds of stream time that the bucket holds: the longest burst that is not thinned.
    pub const DEPTH_US: u64 = 1_000;
    /// Highest rate, in events per second.
    pub const HIGHEST: u64 = 1_000_000_000_000;

    /// Passes `events_per_s` events a second.
    ///
    /// # Errors
    /// [`EngineError::Option`] for a rate of 0 or above [`Self::HIGHEST`].
    pub fn new(events_per_s: u64) -> Result<Self, EngineError> {
        let rate = i64::try_from(events_per_s).unwrap_or(i64::MAX);
        in_range("rate limit in events per second", rate, 1, Self::HIGHEST as i64)?;
        let depth = (events_per_s * Self::DEPTH_US).max(EVENT);
        Ok(Self { events_per_s, credit: depth, depth, newest_us: None, counters: FilterCounters::default() })
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

    reports!("rate_limit");
}
