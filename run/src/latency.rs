//! Durations of calls, as histograms and quantiles.

use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize, Serializer};

/// Longest time that the histogram distinguishes: an hour, in nanoseconds.
const MAX_NS: u64 = 3_600_000_000_000;
/// Significant digits of the histogram.
const DIGITS: u8 = 3;
/// Number of empty measurements whose mean is the overhead of the clock, and number of such means.
const CLOCK_READS: u32 = 2000;
const CLOCK_RUNS: usize = 50;

/// A histogram of durations, by nanoseconds or three digits, written as a [`Distribution`].
#[derive(Debug)]
pub struct Latency {
    histogram: Histogram<u64>,
    /// The exact maximum and the exact sum: the histogram rounds both.
    max_ns: u64,
    total: Duration,
}

/// Quantiles in microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names of the quantiles")]
pub struct Quantiles {
    pub p50: f64,
    pub p90: f64,
    pub p99: f64,
    pub p999: f64,
    pub max: f64,
}

/// Durations in microseconds.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the names of the figures")]
pub struct Distribution {
    pub count: u64,
    pub mean: f64,
    #[serde(flatten)]
    pub quantiles: Quantiles,
}

/// Quantiles by name, serialised as one object in this order; `None` if nothing was recorded.
#[derive(Clone, Debug)]
pub struct Latencies(pub Vec<(&'static str, Option<Quantiles>)>);

impl Latencies {
    pub(crate) fn of<const N: usize>(latencies: [(&'static str, &Latency); N]) -> Self {
        Self(latencies.map(|(name, latency)| (name, latency.quantiles())).into())
    }
}

impl Serialize for Latencies {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().copied())
    }
}

/// Overhead of the clock in microseconds: the smallest mean of several runs.
pub fn clock_us() -> f64 {
    let mean = |_| {
        let mut nothing = Duration::ZERO;
        for _ in 0..CLOCK_READS {
            let start = Instant::now();
            nothing += start.elapsed();
        }
        microseconds(nothing) / f64::from(CLOCK_READS)
    };
    (0..CLOCK_RUNS).map(mean).fold(f64::INFINITY, f64::min)
}

/// `duration` in microseconds.
pub fn microseconds(duration: Duration) -> f64 {
    duration.as_nanos() as f64 / 1e3
}

impl Serialize for Latency {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.distribution().serialize(serializer)
    }
}

impl Default for Latency {
    fn default() -> Self {
        let histogram =
            Histogram::new_with_bounds(1, MAX_NS, DIGITS).expect("the bounds are constants that fit");
        Self { histogram, max_ns: 0, total: Duration::ZERO }
    }
}

impl Latency {
    /// An empty histogram. Recording into it does not allocate.
    pub fn new() -> Self {
        Self::default()
    }

    /// Records one duration.
    pub fn record(&mut self, taken: Duration) {
        let ns = u64::try_from(taken.as_nanos()).unwrap_or(u64::MAX);
        self.histogram.saturating_record(ns);
        self.max_ns = self.max_ns.max(ns);
        self.total += taken;
    }

    /// Adds all durations of `other`.
    pub fn add(&mut self, other: &Self) {
        // All histograms have the same bounds.
        let added = self.histogram.add(&other.histogram);
        debug_assert!(added.is_ok(), "{added:?}");
        self.max_ns = self.max_ns.max(other.max_ns);
        self.total += other.total;
    }

    /// Sum of all recorded durations.
    pub fn total(&self) -> Duration {
        self.total
    }

    /// The number of recorded durations.
    pub fn count(&self) -> u64 {
        self.histogram.len()
    }

    /// Points (duration in microseconds, share of longer durations) in ascending order of duration.
    /// There is one point for each value of the histogram that occurred. The last share is 0.
    pub fn longer(&self) -> Vec<(f64, f64)> {
        let mut left = self.count();
        let point = |bucket: hdrhistogram::iterators::IterationValue<u64>| {
            left -= bucket.count_at_value();
            let ns = bucket.value_iterated_to().min(self.max_ns);
            (ns as f64 / 1e3, left as f64 / self.count() as f64)
        };
        self.histogram.iter_recorded().map(point).collect()
    }

    /// Count, mean and quantiles; `None` if nothing was recorded.
    pub fn distribution(&self) -> Option<Distribution> {
        let (count, quantiles) = (self.count(), self.quantiles()?);
        Some(Distribution { count, mean: microseconds(self.total) / count as f64, quantiles })
    }

    /// `None` if nothing was recorded.
    pub fn quantiles(&self) -> Option<Quantiles> {
        let us = |ns: u64| ns as f64 / 1e3;
        let at = |quantile| us(self.histogram.value_at_quantile(quantile).min(self.max_ns));
        (!self.histogram.is_empty()).then(|| Quantiles {
            p50: at(0.5),
            p90: at(0.9),
            p99: at(0.99),
            p999: at(0.999),
            max: us(self.max_ns),
        })
    }
}

/// Durations of calls, over any number of passes.
#[derive(Debug, Default, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct CallLatencies {
    pub push: Latency,
    pub predict: Latency,
    /// The push of each event or frame with its predictions.
    pub push_predict: Latency,
}

impl CallLatencies {
    /// Adds all durations of `other`.
    pub fn add(&mut self, other: &Self) {
        self.push.add(&other.push);
        self.predict.add(&other.predict);
        self.push_predict.add(&other.push_predict);
    }
}
