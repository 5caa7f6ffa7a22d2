//! Accuracy, and precision, recall and F1 as means over classes.
//!
//! ```text
//! precision = TP / (TP + FP)    recall = TP / (TP + FN)    F1 = 2 TP / (2 TP + FP + FN)
//! ```
//!
//! for each class; the macro figure is the mean over the classes that are true or predicted at least once, each counting
//! the same. A class that is never predicted has precision 0, one that is only ever predicted has recall 0, and both have
//! F1 0: a network that passes over a class is not better for it. Classes that are neither are left out.

use serde::Serialize;

use super::Confusion;

/// The figures that predictions of classes are judged by, each from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Scores {
    /// Share of predictions that are true.
    pub accuracy: f64,
    /// Mean precision of the classes.
    pub precision: f64,
    /// Mean recall of the classes.
    pub recall: f64,
    /// Mean F1 of the classes.
    pub f1: f64,
}

impl Scores {
    /// The figures of `confusion`; `None` where it counts nothing. O(classes^2).
    pub fn of(confusion: &Confusion) -> Option<Self> {
        let total = confusion.total();
        if total == 0 {
            return None;
        }
        let (mut present, mut precision, mut recall, mut f1) = (0_u64, 0.0, 0.0, 0.0);
        for class in 0..confusion.classes() {
            let (truths, predictions) = (confusion.truths(class), confusion.predictions(class));
            if truths + predictions == 0 {
                continue;
            }
            let hits = confusion.count(class, class);
            present += 1;
            precision += share(hits, predictions);
            recall += share(hits, truths);
            f1 += share(2 * hits, truths + predictions);
        }
        let mean = |sum: f64| sum / present as f64;
        Some(Self {
            accuracy: share(confusion.hits(), total),
            precision: mean(precision),
            recall: mean(recall),
            f1: mean(f1),
        })
    }
}

/// `part` of `whole`; 0 of nothing.
fn share(part: u64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

#[cfg(test)]
mod tests {
    use super::{Confusion, Scores};
    use proptest::prelude::*;

    const CLASSES: usize = 5;

    fn confusion(pairs: &[(usize, usize)]) -> Confusion {
        let mut confusion = Confusion::new(CLASSES);
        pairs.iter().for_each(|&(truth, predicted)| confusion.add(truth, predicted));
        confusion
    }

    /// The figures from the list of predictions itself, class by class.
    fn slow(pairs: &[(usize, usize)]) -> Option<Scores> {
        let count = |holds: &dyn Fn(usize, usize) -> bool| {
            pairs.iter().filter(|&&(truth, predicted)| holds(truth, predicted)).count() as f64
        };
        let mut classes: Vec<usize> =
            pairs.iter().flat_map(|&(truth, predicted)| [truth, predicted]).collect();
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
        let scores = Scores::of(&confusion(&[(0, 0), (0, 0), (1, 0), (1, 0)])).unwrap();
        assert_eq!(scores, Scores { accuracy: 0.5, precision: 0.25, recall: 0.5, f1: 1.0 / 3.0 });
    }

    #[test]
    fn classes_that_are_neither_true_nor_predicted_are_left_out() {
        let scores = Scores::of(&confusion(&[(3, 3), (4, 4)])).unwrap();
        assert_eq!(scores, Scores { accuracy: 1.0, precision: 1.0, recall: 1.0, f1: 1.0 });
    }

    #[test]
    fn nothing_has_no_figures() {
        assert_eq!(Scores::of(&confusion(&[])), None);
    }

    proptest! {
        #[test]
        fn counts_give_what_the_list_gives(
            pairs in proptest::collection::vec((0..CLASSES, 0..CLASSES), 0..60)
        ) {
            let values = |scores: Scores| [scores.accuracy, scores.precision, scores.recall, scores.f1];
            let (fast, slow) = (Scores::of(&confusion(&pairs)).map(values), slow(&pairs).map(values));
            prop_assert_eq!(fast.is_some(), slow.is_some());
            for (fast, slow) in fast.into_iter().flatten().zip(slow.into_iter().flatten()) {
                prop_assert!((fast - slow).abs() < 1e-12, "{} {}", fast, slow);
                prop_assert!((0.0..=1.0).contains(&fast));
            }
        }
    }
}
