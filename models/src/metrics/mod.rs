//! How well classes are predicted, and how sure that is.
//!
//! - [`Confusion`]: how often each class was predicted for each, and [`Scores`] of it,
//! - [`largest`]: the class that a network's values predict,
//! - [`MeanStd`]: figures of several trainings,
//! - [`wilson_95`]: the interval around an accuracy.
//!
//! Counts are integers; figures are fractions in f64, from counts and in a fixed order, so that they are equal on every
//! machine.

mod confusion;
mod interval;
mod scores;
mod spread;

pub use confusion::Confusion;
pub use interval::wilson_95;
pub use scores::Scores;
pub use spread::MeanStd;

/// The place of the largest value, the first of equal ones; `None` where there are none or one is NaN.
pub fn largest(values: &[f32]) -> Option<usize> {
    if values.iter().any(|value| value.is_nan()) {
        return None;
    }
    (0..values.len()).reduce(|best, i| if values[i] > values[best] { i } else { best })
}

#[cfg(test)]
mod tests {
    use super::largest;

    #[test]
    fn the_first_of_the_largest_is_predicted() {
        assert_eq!(largest(&[1.0, 3.0, 3.0, -2.0]), Some(1));
        assert_eq!(largest(&[-1.0, f32::NEG_INFINITY]), Some(0));
        assert_eq!(largest(&[]), None);
        assert_eq!(largest(&[0.0, f32::NAN]), None);
    }
}
