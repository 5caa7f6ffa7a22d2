//! Distances between two series of values.

use libm::{log, sqrt};

/// The distance of dynamic time warping between `a` and `b`: the least sum of `|a[i] - b[j]|` over
/// all paths of pairs from the first two values to the last two, each step of which moves on in one
/// series or in both (Sakoe and Chiba 1978, "Dynamic programming algorithm optimization for spoken
/// word recognition", without window and with equal weights). In the unit of the values; infinite
/// where one series is empty and the other is not, 0 where both are. O(length of a times length of
/// b), in memory for one series.
pub fn time_warping(a: &[f64], b: &[f64]) -> f64 {
    let mut before = vec![f64::INFINITY; b.len() + 1];
    before[0] = 0.0;
    for &value in a {
        let mut row = vec![f64::INFINITY; b.len() + 1];
        for (j, other) in b.iter().enumerate() {
            row[j + 1] = (value - other).abs() + before[j].min(before[j + 1]).min(row[j]);
        }
        before = row;
    }
    before[b.len()]
}

/// Bhattacharyya's distance `-ln sum sqrt(p q)` between the histograms p and q of `a` and `b`, in
/// bins of `width` from 0 on (Bhattacharyya 1943, "On a measure of divergence between two
/// statistical populations defined by their probability distributions"). 0 for equal histograms;
/// `None` where they share no bin, or a series is empty. O(n log n).
///
/// # Panics
/// Where a value is not finite, or `width` is not above 0.
pub fn bhattacharyya(a: &[f64], b: &[f64], width: f64) -> Option<f64> {
    assert!(width > 0.0 && a.iter().chain(b).all(|value| value.is_finite()), "bins of finite values");
    let binned = |values: &[f64]| {
        let mut bins: Vec<i64> = values.iter().map(|value| (value / width).floor() as i64).collect();
        bins.sort_unstable();
        let runs = bins.chunk_by(|one, next| one == next);
        runs.map(|run| (run[0], run.len() as f64 / values.len() as f64)).collect::<Vec<_>>()
    };
    let (p, q) = (binned(a), binned(b));
    let shared = p.iter().filter_map(|(bin, p)| {
        let found = q.binary_search_by_key(bin, |(bin, _)| *bin).ok()?;
        Some(sqrt(p * q[found].1))
    });
    let coefficient: f64 = shared.sum();
    // Rounding can lift the sum above 1.
    (coefficient > 0.0).then(|| (-log(coefficient)).max(0.0))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::{bhattacharyya, time_warping};

    /// The least cost over every path, one after the other.
    fn over_all_paths(a: &[f64], b: &[f64]) -> f64 {
        let here = (a[0] - b[0]).abs();
        let mut rest = Vec::new();
        if a.len() > 1 {
            rest.push(over_all_paths(&a[1..], b));
        }
        if b.len() > 1 {
            rest.push(over_all_paths(a, &b[1..]));
        }
        if a.len() > 1 && b.len() > 1 {
            rest.push(over_all_paths(&a[1..], &b[1..]));
        }
        here + rest.into_iter().reduce(f64::min).unwrap_or(0.0)
    }

    fn naive_bhattacharyya(a: &[f64], b: &[f64], width: f64) -> Option<f64> {
        let share = |values: &[f64]| {
            let mut bins = BTreeMap::new();
            for value in values {
                *bins.entry((value / width).floor() as i64).or_insert(0.0) += 1.0 / values.len() as f64;
            }
            bins
        };
        let (p, q) = (share(a), share(b));
        let sum: f64 = p.iter().map(|(bin, p): (_, &f64)| (p * q.get(bin).unwrap_or(&0.0)).sqrt()).sum();
        (sum > 0.0).then(|| -sum.ln())
    }

    proptest! {
        #[test]
        fn time_warping_is_the_cheapest_of_all_paths(
            a in prop::collection::vec(-3.0..3.0, 1..6),
            b in prop::collection::vec(-3.0..3.0, 1..6),
        ) {
            let (found, expected) = (time_warping(&a, &b), over_all_paths(&a, &b));
            prop_assert!((found - expected).abs() < 1e-9, "{found}, {expected}");
            prop_assert!((found - time_warping(&b, &a)).abs() < 1e-9, "it is symmetric");
            let point_by_point: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum();
            prop_assert!(a.len() != b.len() || found <= point_by_point + 1e-9);
        }

        #[test]
        fn bhattacharyyas_distance_is_that_of_histograms(
            a in prop::collection::vec(-3.0..3.0, 1..40),
            b in prop::collection::vec(-3.0..3.0, 1..40),
            width in 0.05..2.0,
        ) {
            match (bhattacharyya(&a, &b, width), naive_bhattacharyya(&a, &b, width)) {
                (Some(found), Some(expected)) => prop_assert!((found - expected).abs() < 1e-9),
                (found, expected) => prop_assert_eq!(found.is_some(), expected.is_some()),
            }
            prop_assert!(bhattacharyya(&a, &a, width).expect("equal histograms") < 1e-12);
        }
    }

    #[test]
    fn a_series_that_only_comes_later_is_near_in_time_warping() {
        let (early, late) = ([0.0, 1.0, 2.0, 0.0, 0.0], [0.0, 0.0, 1.0, 2.0, 0.0]);
        assert_eq!(time_warping(&early, &late), 0.0);
        assert_eq!(time_warping(&[], &[]), 0.0);
        assert_eq!(time_warping(&[], &late), f64::INFINITY);
    }

    #[test]
    fn histograms_that_share_nothing_have_no_distance() {
        assert_eq!(bhattacharyya(&[0.0], &[5.0], 1.0), None);
        assert_eq!(bhattacharyya(&[], &[5.0], 1.0), None);
    }
}
