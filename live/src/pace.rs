//! When the worker stops taking events for a prediction that cannot cover all of them.
//!
//! A prediction is begun early enough to be there at its deadline: at twice what a batch and a prediction took lately
//! before it. While events wait, predictions take no more than half of the worker's time: otherwise a controller that
//! asks for predictions faster than they can be computed would keep every event out.

use std::time::{Duration, Instant};

/// What batches and predictions took.
#[derive(Debug, Default)]
pub(crate) struct Pace {
    /// Longest of the latest batches and predictions: it forgets an eighth with each.
    batch: Duration,
    prediction: Duration,
    /// The last prediction, and batches since then.
    last: Duration,
    since: Duration,
}

/// The longer of `taken` and seven eighths of `before`.
fn lately(before: Duration, taken: Duration) -> Duration {
    taken.max(before * 7 / 8)
}

impl Pace {
    /// A batch took so long.
    pub(crate) fn pushed(&mut self, taken: Duration) {
        self.batch = lately(self.batch, taken);
        self.since += taken;
    }

    /// A prediction took so long.
    pub(crate) fn predicted(&mut self, taken: Duration) {
        self.prediction = lately(self.prediction, taken);
        self.last = taken;
        self.since = Duration::ZERO;
    }

    /// Whether a prediction that is `due` then must be begun `now`, whatever waits; never where it has no deadline.
    pub(crate) fn is_time(&self, due: Option<Instant>, now: Instant) -> bool {
        let begin = 2 * (self.batch + self.prediction);
        due.is_some_and(|due| due.saturating_duration_since(now) <= begin) && self.since >= self.last
    }
}

#[cfg(test)]
mod tests {
    use super::Pace;
    use std::time::{Duration, Instant};

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn a_prediction_is_begun_twice_its_time_before_the_deadline() {
        let (mut pace, now) = (Pace::default(), Instant::now());
        pace.predicted(3 * MS);
        pace.pushed(4 * MS);
        assert!(!pace.is_time(Some(now + 15 * MS), now));
        assert!(pace.is_time(Some(now + 14 * MS), now));
        assert!(pace.is_time(Some(now), now + MS), "what is overdue is due");
        assert!(!pace.is_time(None, now));
    }

    #[test]
    fn a_long_prediction_is_followed_by_as_long_a_time_for_events() {
        let (mut pace, now) = (Pace::default(), Instant::now());
        pace.predicted(10 * MS);
        for _ in 0..9 {
            pace.pushed(MS);
            assert!(!pace.is_time(Some(now), now));
        }
        pace.pushed(MS);
        assert!(pace.is_time(Some(now), now));
    }

    #[test]
    fn a_single_slow_batch_is_forgotten() {
        let (mut pace, now) = (Pace::default(), Instant::now());
        pace.pushed(100 * MS);
        (0..40).for_each(|_| pace.pushed(MS));
        assert!(!pace.is_time(Some(now + 4 * MS), now));
    }
}
