//! Figures of several trainings as one.

use serde::Serialize;

/// Mean and standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanStd {
    /// Mean.
    pub mean: f64,
    /// Sample standard deviation, with n - 1 in the denominator; `None` of a single value.
    pub std: Option<f64>,
}

impl MeanStd {
    /// Mean and standard deviation of `values`, in two passes in their order; `None` where there are none.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len();
        if count == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / count as f64;
        let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
        Some(Self { mean, std: (count > 1).then(|| (squares / (count - 1) as f64).sqrt()) })
    }
}

#[cfg(test)]
mod tests {
    use super::MeanStd;
    use proptest::prelude::*;

    #[test]
    fn the_deviation_is_that_of_a_sample() {
        assert_eq!(MeanStd::of(&[1.0, 3.0]), Some(MeanStd { mean: 2.0, std: Some(2.0_f64.sqrt()) }));
        assert_eq!(MeanStd::of(&[0.25; 8]), Some(MeanStd { mean: 0.25, std: Some(0.0) }));
    }

    #[test]
    fn a_single_value_has_no_deviation() {
        assert_eq!(MeanStd::of(&[0.7]), Some(MeanStd { mean: 0.7, std: None }));
        assert_eq!(MeanStd::of(&[]), None);
    }

    proptest! {
        #[test]
        fn the_variance_is_half_the_mean_square_of_all_differences(
            values in proptest::collection::vec(0.0..1.0_f64, 2..20)
        ) {
            let n = values.len() as f64;
            let pairs = values.iter().flat_map(|a| values.iter().map(move |b| (a - b) * (a - b)));
            let slow = pairs.sum::<f64>() / (2.0 * n * (n - 1.0));
            let std = MeanStd::of(&values).unwrap().std.unwrap();
            prop_assert!((std * std - slow).abs() < 1e-12, "{} {}", std * std, slow);
        }
    }
}
