//! The median of the last few values of a stream.

use super::error::{ContactError, setting};

/// The running median of an odd number of values.
///
/// Until the window is full, the median of what is there; of an even number of values that is the mean of the two in
/// the middle (a / 2 + b / 2). Values are ordered by [`f64::total_cmp`]. O(window) a value; nothing is allocated after
/// construction.
///
/// Invariant: `sorted` holds the values of `ring` in order.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningMedian {
    window: usize,
    /// The last values; from `oldest` on in order of arrival once it is full.
    ring: Vec<f64>,
    oldest: usize,
    sorted: Vec<f64>,
}

impl RunningMedian {
    /// The median of `window` values.
    ///
    /// # Errors
    /// [`ContactError::Setting`] where `window` is even (0 included) or above 65535.
    pub fn new(window: usize) -> Result<Self, ContactError> {
        let holds = window % 2 == 1 && window < 1 << 16;
        setting("window of the running median", "an odd number up to 65535", window as f64, holds)?;
        Ok(Self { window, ring: Vec::with_capacity(window), oldest: 0, sorted: Vec::with_capacity(window) })
    }

    /// Takes the next value; the median of the last values, this one included.
    pub fn push(&mut self, value: f64) -> f64 {
        if self.ring.len() < self.window {
            self.ring.push(value);
        } else {
            let left = std::mem::replace(&mut self.ring[self.oldest], value);
            self.oldest = (self.oldest + 1) % self.window;
            let at = self.sorted.partition_point(|v| v.total_cmp(&left).is_lt());
            self.sorted.remove(at);
        }
        let at = self.sorted.partition_point(|v| v.total_cmp(&value).is_lt());
        self.sorted.insert(at, value);
        let middle = self.sorted.len() / 2;
        match self.sorted.len() % 2 {
            1 => self.sorted[middle],
            _ => self.sorted[middle - 1] / 2.0 + self.sorted[middle] / 2.0,
        }
    }

    /// Forgets all values.
    pub fn reset(&mut self) {
        self.ring.clear();
        self.sorted.clear();
        self.oldest = 0;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::RunningMedian;

    #[test]
    fn an_outlier_does_not_pass() {
        let mut median = RunningMedian::new(5).unwrap();
        let found = [1.0, 2.0, 90.0, 3.0, 4.0, 5.0, 6.0].map(|value| median.push(value));
        assert_eq!(found, [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn a_window_of_one_gives_the_value_itself() {
        let mut median = RunningMedian::new(1).unwrap();
        assert_eq!([3.0, -1.0, 2.0].map(|value| median.push(value)), [3.0, -1.0, 2.0]);
    }

    #[test]
    fn after_a_reset_nothing_is_remembered() {
        let mut median = RunningMedian::new(3).unwrap();
        for value in [7.0, 8.0, 9.0, 10.0] {
            median.push(value);
        }
        median.reset();
        assert_eq!([1.0, 2.0].map(|value| median.push(value)), [1.0, 1.5]);
    }

    #[test]
    fn an_even_window_is_refused() {
        assert!(RunningMedian::new(0).is_err());
        assert!(RunningMedian::new(usize::MAX).is_err());
        let error = RunningMedian::new(4).unwrap_err().to_string();
        assert_eq!(error, "window of the running median: expected an odd number up to 65535, found 4");
    }

    proptest! {
        #[test]
        fn the_median_is_that_of_the_sorted_window(
            half in 0_usize..5,
            values in prop::collection::vec(prop_oneof![any::<f64>(), (-3_i8..3).prop_map(f64::from)], 0..40),
        ) {
            let window = 2 * half + 1;
            let mut median = RunningMedian::new(window).unwrap();
            for end in 1..=values.len() {
                let mut last = values[end.saturating_sub(window)..end].to_vec();
                last.sort_by(f64::total_cmp);
                let middle = last.len() / 2;
                let expected = if last.len() % 2 == 1 {
                    last[middle]
                } else {
                    last[middle - 1] / 2.0 + last[middle] / 2.0
                };
                prop_assert_eq!(median.push(values[end - 1]).to_bits(), expected.to_bits());
            }
        }
    }
}
