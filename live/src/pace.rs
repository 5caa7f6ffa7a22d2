//! Decides when the worker stops taking events for a prediction that cannot cover all of them.
//!
//! A prediction is started early enough to meet its deadline: twice the recent duration of a batch and a prediction
//! before it. While events wait, predictions take at most half of the worker's time; otherwise a controller that
//! requests predictions faster than they can be computed would starve the events.

use std::time::{Duration, Instant};

/// Recent durations of batches and predictions.
#[derive(Debug, Default)]
pub(crate) struct Pace {
    /// Longest recent duration; it decays by an eighth with each new one.
    batch: Duration,
    prediction: Duration,
    /// Duration of the last prediction, and of the batches since then.
    last: Duration,
    since: Duration,
}

/// The longer of `taken` and seven eighths of `before`.
fn lately(before: Duration, taken: Duration) -> Duration {
    taken.max(before * 7 / 8)
}

impl Pace {
    /// Records the duration of a batch.
    pub(crate) fn pushed(&mut self, taken: Duration) {
        self.batch = lately(self.batch, taken);
        self.since += taken;
    }

    /// Records the duration of a prediction.
    pub(crate) fn predicted(&mut self, taken: Duration) {
        self.prediction = lately(self.prediction, taken);
        self.last = taken;
        self.since = Duration::ZERO;
    }

    /// Whether a prediction must be started `now` to be ready when `due`; never without a deadline.
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
