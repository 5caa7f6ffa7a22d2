//! How sure an accuracy is.
//!
//! The score interval (Wilson 1927): all p whose distance from the share h of n trials is at most z standard errors of p,
//!
//! ```text
//! |h - p| <= z sqrt(p (1 - p) / n)
//! p = (h + z^2 / 2n +- z sqrt(h (1 - h) / n + z^2 / 4n^2)) / (1 + z^2 / n)
//! ```
//!
//! It holds for trials that do not depend on each other: for windows of one recording it is too narrow.

/// 97.5 % quantile of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// The 95 % interval of a probability of which `hits` of `trials` are seen; `None` without trials.
///
/// # Panics
/// Where there are more hits than trials.
pub fn wilson_95(hits: u64, trials: u64) -> Option<(f64, f64)> {
    assert!(hits <= trials, "{hits} hits of {trials}");
    if trials == 0 {
        return None;
    }
    let (n, share) = (trials as f64, hits as f64 / trials as f64);
    let square = Z * Z / n;
    let centre = share + square / 2.0;
    let reach = Z * (share * (1.0 - share) / n + square / (4.0 * n)).sqrt();
    // At the ends the roots are 0 and 1, which rounding would miss.
    let low = if hits == 0 { 0.0 } else { (centre - reach) / (1.0 + square) };
    let high = if hits == trials { 1.0 } else { (centre + reach) / (1.0 + square) };
    Some((low, high))
}

#[cfg(test)]
mod tests {
    use super::{Z, wilson_95};
    use proptest::prelude::*;

    /// The bound between `share`, which is inside, and `end`, which is not or is the end, by bisection.
    fn slow(share: f64, end: f64, n: f64) -> f64 {
        let inside = |p: f64| (share - p).abs() <= Z * (p * (1.0 - p) / n).sqrt();
        let (mut within, mut without) = (share, end);
        for _ in 0..200 {
            let middle = f64::midpoint(within, without);
            if inside(middle) { within = middle } else { without = middle }
        }
        within
    }

    #[test]
    fn ninety_one_of_a_hundred_are_known_to_about_six_points() {
        let (low, high) = wilson_95(91, 100).unwrap();
        assert!((low - 0.8377).abs() < 1e-4 && (high - 0.9519).abs() < 1e-4, "{low} {high}");
    }

    #[test]
    fn certainty_is_not_claimed_and_nothing_is_known_of_nothing() {
        let (low, high) = wilson_95(10, 10).unwrap();
        assert!((low - 0.7225).abs() < 1e-4 && high == 1.0, "{low} {high}");
        assert_eq!(wilson_95(0, 10).unwrap().0, 0.0);
        assert_eq!(wilson_95(0, 0), None);
    }

    proptest! {
        #[test]
        fn the_bounds_are_where_the_score_test_ends(trials in 1_u64..5_000, part in 0.0..=1.0_f64) {
            let hits = (part * trials as f64).round() as u64;
            let (n, share) = (trials as f64, hits as f64 / trials as f64);
            let (low, high) = wilson_95(hits, trials).unwrap();
            prop_assert!(low <= share && share <= high);
            prop_assert!((low - slow(share, 0.0, n)).abs() < 1e-9, "{}", low);
            prop_assert!((high - slow(share, 1.0, n)).abs() < 1e-9, "{}", high);
        }
    }
}
