//! Metrics against the definitions, written as directly as possible.

use proptest::prelude::*;

use super::{Confusion, MeanStd, Scores, Z, largest, wilson_95};

#[test]
fn the_first_of_the_largest_is_predicted() {
    assert_eq!(largest(&[1.0, 3.0, 3.0, -2.0]), Some(1));
    assert_eq!(largest(&[-1.0, f32::NEG_INFINITY]), Some(0));
    assert_eq!(largest(&[]), None);
    assert_eq!(largest(&[0.0, f32::NAN]), None);
}

#[test]
fn rows_are_true_and_columns_predicted() {
    let mut confusion = Confusion::new(3);
    [(0, 0), (0, 1), (0, 1), (2, 0)].iter().for_each(|&(truth, predicted)| confusion.add(truth, predicted));
    let rows: Vec<&[u64]> = confusion.rows().collect();
    assert_eq!(rows, [[1, 2, 0], [0, 0, 0], [1, 0, 0]]);
    assert_eq!((confusion.truths(0), confusion.predictions(0)), (3, 2));
    assert_eq!((confusion.hits(), confusion.total()), (1, 4));
    assert_eq!(serde_json::to_string(&confusion).expect("numbers"), "[[1,2,0],[0,0,0],[1,0,0]]");
}

#[test]
fn merged_counts_are_those_of_both() {
    let (mut a, mut b, mut both) = (Confusion::new(2), Confusion::new(2), Confusion::new(2));
    [(0, 1), (1, 1)].iter().for_each(|&(t, p)| {
        a.add(t, p);
        both.add(t, p);
    });
    b.add(1, 0);
    both.add(1, 0);
    a.merge(&b);
    assert_eq!(a, both);
}

#[test]
fn no_classes_have_no_rows() {
    assert_eq!(Confusion::new(0).rows().count(), 0);
    assert_eq!(Confusion::new(0).total(), 0);
}

#[test]
#[should_panic(expected = "of 2")]
fn a_prediction_of_no_class_is_a_mistake_of_the_caller() {
    Confusion::new(2).add(0, 2);
}

const CLASSES: usize = 5;

fn of_pairs(pairs: &[(usize, usize)]) -> Confusion {
    let mut confusion = Confusion::new(CLASSES);
    pairs.iter().for_each(|&(truth, predicted)| confusion.add(truth, predicted));
    confusion
}

/// The figures from the list of predictions itself, class by class.
fn slow_scores(pairs: &[(usize, usize)]) -> Option<Scores> {
    let count = |holds: &dyn Fn(usize, usize) -> bool| {
        pairs.iter().filter(|&&(truth, predicted)| holds(truth, predicted)).count() as f64
    };
    let mut classes: Vec<usize> = pairs.iter().flat_map(|&(truth, predicted)| [truth, predicted]).collect();
    classes.sort_unstable();
    classes.dedup();
    let mut lists = [vec![], vec![], vec![]];
    for class in classes {
        let hits = count(&|truth, predicted| truth == class && predicted == class);
        let precision = hits / count(&|_, predicted| predicted == class);
        let recall = hits / count(&|truth, _| truth == class);
        // 0 / 0 is NaN.
        let precision = if precision.is_nan() { 0.0 } else { precision };
        let recall = if recall.is_nan() { 0.0 } else { recall };
        let f1 = if hits > 0.0 { 2.0 / (1.0 / precision + 1.0 / recall) } else { 0.0 };
        lists[0].push(precision);
        lists[1].push(recall);
        lists[2].push(f1);
    }
    let [precision, recall, f1] = lists.map(|list| list.iter().sum::<f64>() / list.len() as f64);
    let accuracy = count(&|truth, predicted| truth == predicted) / pairs.len() as f64;
    (!pairs.is_empty()).then_some(Scores { accuracy, precision, recall, f1 })
}

#[test]
fn a_class_that_is_never_predicted_has_precision_0_and_counts() {
    let scores = Scores::of(&of_pairs(&[(0, 0), (0, 0), (1, 0), (1, 0)])).unwrap();
    assert_eq!(scores, Scores { accuracy: 0.5, precision: 0.25, recall: 0.5, f1: 1.0 / 3.0 });
}

#[test]
fn classes_that_are_neither_true_nor_predicted_are_left_out() {
    let scores = Scores::of(&of_pairs(&[(3, 3), (4, 4)])).unwrap();
    assert_eq!(scores, Scores { accuracy: 1.0, precision: 1.0, recall: 1.0, f1: 1.0 });
}

#[test]
fn nothing_has_no_figures() {
    assert_eq!(Scores::of(&of_pairs(&[])), None);
}

proptest! {
    #[test]
    fn counts_give_what_the_list_gives(
        pairs in proptest::collection::vec((0..CLASSES, 0..CLASSES), 0..60)
    ) {
        let values = |scores: Scores| [scores.accuracy, scores.precision, scores.recall, scores.f1];
        let (fast, slow) = (Scores::of(&of_pairs(&pairs)).map(values), slow_scores(&pairs).map(values));
        prop_assert_eq!(fast.is_some(), slow.is_some());
        for (fast, slow) in fast.into_iter().flatten().zip(slow.into_iter().flatten()) {
            prop_assert!((fast - slow).abs() < 1e-12, "{} {}", fast, slow);
            prop_assert!((0.0..=1.0).contains(&fast));
        }
    }
}

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

/// The bound between `share`, which is inside, and `end`, which is outside or is the bound, by
/// bisection.
fn slow_bound(share: f64, end: f64, n: f64) -> f64 {
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
        prop_assert!((low - slow_bound(share, 0.0, n)).abs() < 1e-9, "{}", low);
        prop_assert!((high - slow_bound(share, 1.0, n)).abs() < 1e-9, "{}", high);
    }
}

mod clusters {
    use crate::metrics::{clustered_95, student_95};

    #[test]
    fn quantiles_are_those_of_the_tables() {
        let table = [
            (1, 12.706_204_736),
            (2, 4.302_652_730),
            (3, 3.182_446_305),
            (4, 2.776_445_105),
            (5, 2.570_581_836),
            (10, 2.228_138_852),
            (29, 2.045_229_642),
            (30, 2.042_272_456),
            (100, 1.983_971_519),
        ];
        for (freedom, expected) in table {
            let found = student_95(freedom);
            assert!((found - expected).abs() < 1e-8, "{freedom}: {found}");
        }
        assert!((student_95(100_000) - 1.959_988).abs() < 1e-6);
    }

    #[test]
    fn clusters_of_one_size_give_the_interval_of_their_means() {
        // Means 1, 2 and 6 of two figures each: mean 3, deviation sqrt(7), t of 2 degrees.
        let (low, high) = clustered_95(&[(2.0, 2), (4.0, 2), (12.0, 2)]).expect("three clusters");
        let reach = 4.302_652_730 * (7.0_f64 / 3.0).sqrt();
        assert!((low - (3.0 - reach)).abs() < 1e-8 && (high - (3.0 + reach)).abs() < 1e-8, "{low} {high}");
    }

    #[test]
    fn larger_clusters_weigh_more_and_empty_ones_nothing() {
        // One figure of 4 and three of 1: mean 7/4; s - r n is 9/4 and -9/4, so v is 2 * (81/8) /
        // 16.
        let (low, high) = clustered_95(&[(4.0, 1), (0.0, 0), (3.0, 3)]).expect("two clusters");
        let reach = 12.706_204_736 * (81.0_f64 / 64.0).sqrt();
        assert!((low - (1.75 - reach)).abs() < 1e-7 && (high - (1.75 + reach)).abs() < 1e-7, "{low} {high}");
        assert_eq!(clustered_95(&[(4.0, 2), (0.0, 0)]), None);
        assert_eq!(clustered_95(&[]), None);
        assert_eq!(clustered_95(&[(1.0, 1), (1.0, 1)]), Some((1.0, 1.0)));
    }
}

mod distances {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use crate::metrics::{bhattacharyya, time_warping};

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
