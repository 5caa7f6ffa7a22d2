//! Differences between f32 values and f64 ones, and errors in units in the last place.

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

    /// Largest difference divided by the largest magnitude; 0 if there is no difference.
    pub fn relative(&self) -> f64 {
        if self.absolute == 0.0 { 0.0 } else { self.absolute / self.largest }
    }

    /// Root of the mean squared difference.
    pub fn rms(&self) -> f64 {
        if self.values == 0 { 0.0 } else { (self.squares / self.values as f64).sqrt() }
    }
}

/// 2^104, the distance of the two largest f32.
const MAX_ULP: f64 = 20_282_409_603_651_670_423_947_251_286_016.0;

/// Error of `got` in units in the last place of the f32 nearest to `want`: the distance from its magnitude to the next
/// larger f32. 0 if `got` is that f32, or both are NaN; infinite if only one is NaN.
pub fn ulps(got: f32, want: f64) -> f64 {
    let nearest = want as f32;
    if got == nearest || (got.is_nan() && want.is_nan()) {
        return 0.0;
    }
    if got.is_nan() || want.is_nan() {
        return f64::INFINITY;
    }
    let magnitude = nearest.abs();
    let ulp = if magnitude < f32::MAX {
        f64::from(f32::from_bits(magnitude.to_bits() + 1)) - f64::from(magnitude)
    } else {
        MAX_ULP
    };
    (f64::from(got) - want).abs() / ulp
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

    #[test]
    fn the_nearest_value_has_no_error_and_its_neighbour_about_one() {
        let third = 1.0 / 3.0;
        let nearest = third as f32;
        assert_eq!(ulps(nearest, third), 0.0);
        let next = f32::from_bits(nearest.to_bits() + 1);
        assert!((0.5..1.5).contains(&ulps(next, third)), "{}", ulps(next, third));
    }

    #[test]
    fn subnormal_values_are_measured_by_the_smallest_distance() {
        assert_eq!(ulps(0.0, f64::from(f32::from_bits(3))), 3.0);
        assert_eq!(ulps(f32::from_bits(1), f64::from(f32::from_bits(3))), 2.0);
    }

    #[test]
    fn what_is_not_a_number_on_one_side_is_infinitely_wrong() {
        assert_eq!(ulps(f32::NAN, 1.0), f64::INFINITY);
        assert_eq!(ulps(1.0, f64::NAN), f64::INFINITY);
        assert_eq!(ulps(f32::NAN, f64::NAN), 0.0);
    }

    #[test]
    fn the_largest_value_and_infinity_are_as_far_apart_as_the_largest_two() {
        assert_eq!(MAX_ULP, 2f64.powi(104));
        assert_eq!(ulps(f32::INFINITY, f64::from(f32::MAX)), f64::INFINITY);
        assert_eq!(ulps(f32::MAX, f64::from(f32::MAX) - MAX_ULP), 1.0);
    }
}
