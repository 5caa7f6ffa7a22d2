//! What is expected of readings beyond their form, and what is counted where it is not met.

use std::ops::RangeInclusive;

use super::Reading;

/// What the rounding of times may add to an interval, as a part of it.
const ROUNDING: f64 = 1e-4;

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
    /// Longest interval, in periods of `rate_hz`, after which a reading still follows the one before; 5 by default, at
    /// 100 Hz 50 ms.
    pub longest_gap: f64,
}

impl Default for ElectrodeSettings {
    fn default() -> Self {
        Self { range: 0.0..=4095.0, rate_hz: 100.0, rate_tolerance: 0.2, longest_gap: 5.0 }
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
    /// Readings after a gap: later than the one before by more than [`ElectrodeSettings::longest_gap`].
    pub gaps: u64,
    /// Readings with the time of the one before.
    pub times_repeated: u64,
    /// Readings with an earlier time than the one before.
    pub times_backwards: u64,
}

impl ElectrodeSettings {
    /// Counts what is suspicious in a reading; `last_s` is the time of the row before. Whether the reading follows that
    /// row as far as times tell: neither a gap nor a step back in time lies between.
    pub(super) fn count(
        &self,
        reading: &Reading,
        last_s: Option<f64>,
        warnings: &mut ElectrodeWarnings,
    ) -> bool {
        let outside = reading.values.iter().filter(|value| !self.range.contains(value)).count();
        warnings.values_out_of_range += outside as u64;
        let Some((last_s, now_s)) = last_s.zip(reading.time_s) else { return true };
        // In intervals, of which one is expected. Times of day since 1970 in f64 are known to 0.24 us, so bounds are
        // widened by far less than it means and by more than their rounding.
        let interval = (now_s - last_s) * self.rate_hz;
        warnings.rows_off_rate += u64::from((interval - 1.0).abs() - self.rate_tolerance > ROUNDING);
        let (gap, backwards) = (interval - self.longest_gap > ROUNDING, now_s < last_s);
        warnings.gaps += u64::from(gap);
        warnings.times_repeated += u64::from(now_s == last_s);
        warnings.times_backwards += u64::from(backwards);
        !(gap || backwards)
    }
}
