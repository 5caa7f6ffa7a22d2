//! Times of a setting and of the exact network that took turns with it.
//!
//! Enters: for each repeat what both took for each event. Leaves: mean and quantiles over the events, where the time of an
//! event is the median over the repeats, which all compute the same: what interrupts one of them moves no figure.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use meissner_pipeline::latency::{Latency, microseconds};

/// What one of the two took in a repeat.
#[derive(Clone, Debug, Default)]
pub(super) struct Lap {
    /// Of each event: filters and push.
    push: Vec<Duration>,
    /// The same with the prediction behind it.
    push_predict: Vec<Duration>,
}

impl Lap {
    /// The next event.
    pub(super) fn record(&mut self, push: Duration, push_predict: Duration) {
        self.push.push(push);
        self.push_predict.push(push_predict);
    }
}

/// Microseconds of an event, or of a window of readings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Time {
    pub(super) mean: f64,
    pub(super) p50: f64,
    pub(super) p99: f64,
}

/// All repeats together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Timing {
    pub(super) push_us: Time,
    pub(super) push_predict_us: Time,
    /// Mean push and prediction of the exact network in the same runs.
    pub(super) exact_us: f64,
    /// The setting's mean push and prediction as a share of the exact network's.
    pub(super) ratio: f64,
}

impl Time {
    /// Of the repeats in `laps`, each with a time for each event.
    fn of<'a>(laps: impl Iterator<Item = &'a Vec<Duration>>) -> Self {
        let laps: Vec<&Vec<Duration>> = laps.collect();
        let events = laps.iter().map(|lap| lap.len()).min().unwrap_or(0);
        let mut latency = Latency::new();
        for event in 0..events {
            latency.record(median(laps.iter().map(|lap| lap[event]).collect()));
        }
        latency.quantiles().map_or_else(Self::default, |quantiles| Self {
            mean: microseconds(latency.total()) / latency.count() as f64,
            p50: quantiles.p50,
            p99: quantiles.p99,
        })
    }
}

impl Timing {
    /// Of repeats (setting, exact).
    pub(super) fn of(laps: &[(Lap, Lap)]) -> Self {
        let push_predict_us = Time::of(laps.iter().map(|(own, _)| &own.push_predict));
        let exact_us = Time::of(laps.iter().map(|(_, exact)| &exact.push_predict)).mean;
        Self {
            push_us: Time::of(laps.iter().map(|(own, _)| &own.push)),
            push_predict_us,
            exact_us,
            // A clock may not tell a short time from none.
            ratio: push_predict_us.mean.max(1e-6) / exact_us.max(1e-6),
        }
    }
}

/// The middle one, or the mean of both in the middle; 0 of none.
fn median(mut times: Vec<Duration>) -> Duration {
    times.sort_unstable();
    match times.len() {
        0 => Duration::ZERO,
        count => (times[(count - 1) / 2] + times[count / 2]) / 2,
    }
}

#[cfg(test)]
mod tests {
    use super::{Lap, Timing, median};
    use std::time::Duration;

    fn lap(times_us: &[u64]) -> Lap {
        let mut lap = Lap::default();
        for &us in times_us {
            let us = Duration::from_micros(us);
            lap.record(us / 2, us);
        }
        lap
    }

    #[test]
    fn what_interrupts_one_repeat_moves_no_figure() {
        let laps = [
            (lap(&[10, 20]), lap(&[20, 9000])),
            (lap(&[7000, 20]), lap(&[20, 40])),
            (lap(&[10, 8000]), lap(&[9000, 40])),
        ];
        let timing = Timing::of(&laps);
        assert!((timing.ratio - 0.5).abs() < 1e-9, "{timing:?}");
        assert!((timing.push_predict_us.mean - 15.0).abs() < 1e-9 && (timing.exact_us - 30.0).abs() < 1e-9);
        assert!((timing.push_us.mean - 7.5).abs() < 1e-9);
    }

    #[test]
    fn the_median_of_two_is_between_them() {
        let of = |times: &[u64]| median(times.iter().map(|&us| Duration::from_micros(us)).collect());
        assert_eq!([of(&[3, 1, 2]), of(&[4, 2]), of(&[])], [2, 3, 0].map(Duration::from_micros));
    }
}
