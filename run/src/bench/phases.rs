//! Bursts: the phase of each event.
//!
//! Input: the events. Output: a phase for each event. An event belongs to a burst if the accepted
//! events of the [`WINDOW_US`] before it came at the burst rate, by default [`FACTOR`] times the
//! mean. A dropped event has the phase of its position.

use meissner_engine::{Admission, Event, LatePolicy, Sensor};

/// Stream time over which the rate is measured, in microseconds.
pub(super) const WINDOW_US: i64 = 10_000;
/// Ratio of the burst rate to the mean rate.
const FACTOR: f64 = 5.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    Idle,
    Burst,
}

#[derive(Debug)]
pub(super) struct Phases {
    of: Vec<Phase>,
    /// Accepted events per second of stream time; `None` without a span.
    pub(super) mean_rate: Option<f64>,
    /// Minimum rate of a burst, in events per second, if one is given or there is a span.
    pub(super) burst_rate: Option<f64>,
}

impl Phases {
    /// The phases of `events`; `sensor` and `late` decide which are accepted.
    pub(super) fn new(events: &[Event], sensor: Sensor, late: LatePolicy, burst_rate: Option<u64>) -> Self {
        let mut gate = Admission::new(sensor, late);
        let mut accepted = Vec::with_capacity(events.len());
        // The number of events accepted before each event.
        let before: Vec<usize> = events
            .iter()
            .map(|&event| {
                let before = accepted.len();
                accepted.extend(gate.admit(event).map(|event| event.t_us));
                before
            })
            .collect();
        let span_us = accepted.first().zip(accepted.last()).map_or(0, |(first, last)| last.abs_diff(*first));
        let mean_rate = (span_us > 0).then(|| accepted.len() as f64 / (span_us as f64 / 1e6));
        let burst_rate = burst_rate.map(|rate| rate as f64).or(mean_rate.map(|mean| mean * FACTOR));
        let least = burst_rate.map_or(f64::INFINITY, |rate| rate * (WINDOW_US as f64 / 1e6));
        let mut oldest = 0;
        let of = before
            .into_iter()
            .map(|before| {
                // A dropped event after all accepted ones gets the newest time.
                let now = accepted.get(before).or(accepted.last()).copied().unwrap_or(0);
                while oldest < before && now.abs_diff(accepted[oldest]) >= WINDOW_US.unsigned_abs() {
                    oldest += 1;
                }
                if (before - oldest) as f64 >= least { Phase::Burst } else { Phase::Idle }
            })
            .collect();
        Self { of, mean_rate, burst_rate }
    }

    pub(super) fn of(&self, index: usize) -> Phase {
        self.of[index]
    }

    pub(super) fn count(&self, phase: Phase) -> u64 {
        self.of.iter().filter(|&&of| of == phase).count() as u64
    }
}
