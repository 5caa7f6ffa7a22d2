//! Stream time on the wall clock.

use std::time::{Duration, Instant};

use crate::interrupt;

/// Longest interval on the wall clock that is represented: ten years.
const LONGEST: Duration = Duration::from_hours(10 * 365 * 24);

/// Longest time after an end until a wait notices it.
const NAP: Duration = Duration::from_millis(5);

/// Converts stream times to wall clock times, and back.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    start: Instant,
    first_us: i64,
    speed: f64,
}

impl Clock {
    /// A clock whose stream time is `first_us` at `start` and passes `speed` times as fast as wall clock time.
    pub fn new(start: Instant, first_us: i64, speed: f64) -> Self {
        Self { start, first_us, speed }
    }

    /// The wall clock time of stream time `t_us`. Times before the first one map to the start.
    pub fn at(&self, t_us: i64) -> Instant {
        let us = i128::from(t_us) - i128::from(self.first_us);
        let seconds = us.max(0) as f64 / 1e6 / self.speed;
        self.start + Duration::try_from_secs_f64(seconds).unwrap_or(LONGEST).min(LONGEST)
    }

    /// The stream time at `now`.
    pub fn stream_us(&self, now: Instant) -> i64 {
        let us = now.saturating_duration_since(self.start).as_secs_f64() * self.speed * 1e6;
        self.first_us.saturating_add(us as i64)
    }

    /// Waits until stream time `t_us`, until `ended`, or until the program is asked to end; whether the time has come.
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

#[cfg(test)]
mod tests {
    use super::Clock;
    use std::time::{Duration, Instant};

    #[test]
    fn at_twice_the_speed_a_second_of_the_stream_takes_half_a_second() {
        let start = Instant::now();
        let clock = Clock::new(start, 1_000_000, 2.0);
        assert_eq!(clock.at(2_000_000), start + Duration::from_millis(500));
        assert_eq!(clock.stream_us(start + Duration::from_millis(500)), 2_000_000);
        assert_eq!(clock.at(0), start);
        assert!(clock.at(i64::MAX) > start && Clock::new(start, i64::MIN, 1e-6).at(i64::MAX) > start);
    }
}
