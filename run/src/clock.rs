//! Stream time on the wall clock.

use std::time::{Duration, Instant};

use crate::interrupt;

/// Longest interval on the wall clock that is represented: ten years.
const MAX: Duration = Duration::from_hours(10 * 365 * 24);

/// Longest time after an end until a wait notices it.
const NAP: Duration = Duration::from_millis(5);

/// Stream time that has passed: the sum of all steps forward, without steps across a restart.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Passed {
    newest_us: Option<i64>,
    us: u64,
}

impl Passed {
    /// Takes the time of an accepted event.
    pub(crate) fn event(&mut self, t_us: i64) {
        let newest_us = self.newest_us.map_or(t_us, |newest_us| newest_us.max(t_us));
        self.us = self.us.saturating_add(newest_us.abs_diff(self.newest_us.unwrap_or(t_us)));
        self.newest_us = Some(newest_us);
    }

    /// Adds `us` of stream time without events.
    pub(crate) fn add(&mut self, us: u64) {
        self.us = self.us.saturating_add(us);
    }

    /// The next event is the first of a clock that has restarted.
    pub(crate) fn restart(&mut self) {
        self.newest_us = None;
    }

    /// Stream time divided by the time `spent` on it, unless either is zero.
    pub(crate) fn times_real_time(&self, spent: Duration) -> Option<f64> {
        (self.us > 0 && !spent.is_zero()).then(|| self.us as f64 / (spent.as_secs_f64() * 1e6))
    }
}

/// Converts stream times to wall clock times, and back.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    start: Instant,
    first_us: i64,
    speed: f64,
}

impl Clock {
    /// A clock that is at `first_us` at `start` and runs `speed` times as fast as the wall clock.
    pub fn new(start: Instant, first_us: i64, speed: f64) -> Self {
        Self { start, first_us, speed }
    }

    /// The wall clock time of stream time `t_us`. Times before the first one map to the start.
    pub fn at(&self, t_us: i64) -> Instant {
        let us = i128::from(t_us) - i128::from(self.first_us);
        let seconds = us.max(0) as f64 / 1e6 / self.speed;
        self.start + Duration::try_from_secs_f64(seconds).unwrap_or(MAX).min(MAX)
    }

    /// The stream time at `now`.
    pub fn stream_us(&self, now: Instant) -> i64 {
        let us = now.saturating_duration_since(self.start).as_secs_f64() * self.speed * 1e6;
        self.first_us.saturating_add(us as i64)
    }

    /// Waits until `t_us`, until `ended`, or until a request to end; returns whether `t_us` was
    /// reached.
    pub fn wait(&self, t_us: i64, ended: impl Fn() -> bool) -> bool {
        let at = self.at(t_us);
        while !ended() && !interrupt::requested() {
            let left = at.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return true;
            }
            interrupt::sleep(left.min(NAP));
        }
        false
    }
}
