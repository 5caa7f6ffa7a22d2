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
pub(crate) const MAX_ULP: f64 = 20_282_409_603_651_670_423_947_251_286_016.0;

/// Error of `got` in units in the last place of the f32 nearest to `want`. 0 if `got` is that f32
/// or both are NaN; infinite if only one is NaN.
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
