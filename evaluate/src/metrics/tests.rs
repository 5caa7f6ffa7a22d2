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

/// The bound between `share`, which is inside, and `end`, which is not or is the end, by bisection.
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
