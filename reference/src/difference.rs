//! Differences between f32 values and f64 ones.

/// Statistics of differences.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// Number of compared pairs.
    pub values: u64,
    /// Largest magnitude of the f64 values.
    pub largest: f64,
    /// Largest difference, over finite f32 values only.
    pub absolute: f64,
    /// Number of f32 values that are NaN.
    pub not_numbers: u64,
    /// Number of f32 values that are infinite.
    pub infinite: u64,
    squares: f64,
}

impl Difference {
    /// Adds one pair.
    pub fn add(&mut self, got: f32, want: f64) {
        self.values += 1;
        self.largest = self.largest.max(want.abs());
        self.not_numbers += u64::from(got.is_nan());
        self.infinite += u64::from(got.is_infinite());
        if got.is_finite() {
            let error = (f64::from(got) - want).abs();
            self.absolute = self.absolute.max(error);
            self.squares += error * error;
        }
    }

    /// Adds pairs of values, in order.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn add_all(&mut self, got: &[f32], want: &[f64]) {
        assert_eq!(got.len(), want.len(), "both sides must have as many values");
        got.iter().zip(want).for_each(|(&got, &want)| self.add(got, want));
    }

    /// The statistics of both sets of pairs.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self {
            values: self.values + other.values,
            largest: self.largest.max(other.largest),
            absolute: self.absolute.max(other.absolute),
            not_numbers: self.not_numbers + other.not_numbers,
            infinite: self.infinite + other.infinite,
            squares: self.squares + other.squares,
        }
    }

    /// Largest difference divided by the largest magnitude; 0 if there is no difference.
    pub fn relative(&self) -> f64 {
        if self.absolute == 0.0 { 0.0 } else { self.absolute / self.largest }
    }

    /// Root of the mean squared difference.
    pub fn rms(&self) -> f64 {
        if self.values == 0 { 0.0 } else { (self.squares / self.values as f64).sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_relative_to_the_largest_magnitude() {
        let mut difference = Difference::default();
        difference.add_all(&[1.0, 2.5], &[1.0, 2.0]);
        assert_eq!((difference.absolute, difference.relative(), difference.values), (0.5, 0.25, 2));
        assert_eq!(difference.rms(), (0.125f64).sqrt());
    }

    #[test]
    fn what_is_not_finite_is_counted_and_not_measured() {
        let mut difference = Difference::default();
        difference.add_all(&[f32::NAN, f32::INFINITY, 1.0], &[1.0, 1e60, 1.0]);
        assert_eq!((difference.not_numbers, difference.infinite, difference.absolute), (1, 1, 0.0));
        assert_eq!(difference.relative(), 0.0);
    }
}
