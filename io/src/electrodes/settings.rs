//! What is expected of readings beyond their form, and what is counted where it is not met.

use std::ops::RangeInclusive;

use super::Reading;

/// What readings should be like; none of it refuses a reading.
#[derive(Clone, Debug, PartialEq)]
pub struct ElectrodeSettings {
    /// Values that the sensor gives, in its counts; 0 to 4095 (12 bits) by default.
    pub range: RangeInclusive<f32>,
    /// Readings a second, where the text has times; 100 by default.
    pub rate_hz: f64,
    /// How far the interval between two readings may be from `1 / rate_hz`, as a part of it; 0.2 by default, so that
    /// at 100 Hz intervals from 8 to 12 ms are fine.
    pub rate_tolerance: f64,
}

impl Default for ElectrodeSettings {
    fn default() -> Self {
        Self { range: 0.0..=4095.0, rate_hz: 100.0, rate_tolerance: 0.2 }
    }
}

/// What was suspicious in the readings that were delivered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ElectrodeWarnings {
    /// Values beyond [`ElectrodeSettings::range`]; a reading counts up to 24 times.
    pub values_out_of_range: u64,
    /// Readings that came too early or too late after the reading of the row before, or with an earlier time. After a
    /// row that was refused, the next reading is not judged.
    pub rows_off_rate: u64,
}

impl ElectrodeSettings {
    /// Counts what is suspicious in a reading; `last_s` is the time of the row before.
    pub(super) fn count(&self, reading: &Reading, last_s: Option<f64>, warnings: &mut ElectrodeWarnings) {
        let outside = reading.values.iter().filter(|value| !self.range.contains(value)).count();
        warnings.values_out_of_range += outside as u64;
        if let Some((last_s, now_s)) = last_s.zip(reading.time_s) {
            // In intervals, of which one is expected. Times of day since 1970 in f64 are known to 0.24 us, so the bound
            // is widened by far less than it means and by more than their rounding.
            let off = ((now_s - last_s) * self.rate_hz - 1.0).abs() - self.rate_tolerance;
            warnings.rows_off_rate += u64::from(off > 1e-4);
        }
    }
}
