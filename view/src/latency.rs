//! Durations of the newest events, from the push to the prediction.

use crate::frame::Bytes;

/// Number of measurements that count; older ones are forgotten.
const NEWEST: usize = 8192;
/// Buckets of the histogram: from 0.1 us to 0.1 us x 2^22 (0.4 s), four to an octave, and the rest.
const BUCKETS: usize = 88;

/// Durations of the newest events.
#[derive(Clone, Debug, Default)]
pub struct Latency {
    newest_us: Vec<f32>,
    next: usize,
    measured: u64,
}

impl Latency {
    /// Adds a duration in microseconds.
    pub fn record(&mut self, us: f64) {
        let us = us as f32;
        match self.newest_us.get_mut(self.next) {
            Some(oldest) => *oldest = us,
            None => self.newest_us.push(us),
        }
        self.next = (self.next + 1) % NEWEST;
        self.measured += 1;
    }

    /// Number of measurements.
    pub fn measured(&self) -> u64 {
        self.measured
    }

    /// The newest in microseconds; `None` before the first measurement.
    pub fn newest_us(&self) -> Option<f32> {
        let last = (self.next + NEWEST - 1) % NEWEST;
        self.newest_us.get(last).copied()
    }

    /// The mean in microseconds; `None` before the first measurement.
    pub fn mean_us(&self) -> Option<f64> {
        let sum: f64 = self.newest_us.iter().map(|&us| f64::from(us)).sum();
        (!self.newest_us.is_empty()).then(|| sum / self.newest_us.len() as f64)
    }

    /// The quantiles: for each share, the smallest duration that this share of the events does not
    /// exceed.
    pub fn quantiles_us<const N: usize>(&self, shares: [f64; N]) -> [f32; N] {
        let mut sorted = self.newest_us.clone();
        sorted.sort_unstable_by(f32::total_cmp);
        shares.map(|share| {
            let rank = (share * sorted.len() as f64).ceil() as usize;
            sorted.get(rank.saturating_sub(1)).copied().unwrap_or(f32::NAN)
        })
    }

    /// Number of the newest measurements in each bucket.
    pub fn histogram(&self) -> Vec<u32> {
        let mut buckets = vec![0; BUCKETS + 1];
        for us in &self.newest_us {
            let bucket = ((us / 0.1).log2() * 4.0).floor().clamp(0.0, BUCKETS as f32);
            buckets[bucket as usize] += 1;
        }
        buckets
    }

    /// The section LATE.
    pub(crate) fn write(&self, to: &mut Bytes<'_>) {
        to.f64(self.measured as f64);
        to.f32s(&self.quantiles_us([0.5, 0.99, 0.999, 1.0]));
        to.f32(self.mean_us().map_or(f32::NAN, |us| (1e6 / us) as f32));
        let buckets = self.histogram();
        to.count(buckets.len());
        buckets.into_iter().for_each(|count| to.u32(count));
    }
}
