//! Folds and answers against their definitions.

use proptest::prelude::*;

use super::{check, correct_from, folds, trained_as};
use crate::Description;

#[test]
fn a_network_that_tells_no_digits_is_refused_with_its_outputs() {
    let network = Description::shipped("tactigraph").unwrap();
    let error = check(&network).unwrap_err().to_string();
    assert!(error.contains("tactigraph") && error.contains("roll, pitch"), "{error}");
}

#[test]
fn the_frozen_network_is_the_one_over_the_past() {
    assert_eq!(
        ["digits-frozen", "digits-past", "own"].map(trained_as),
        ["digits-past", "digits-past", "own"]
    );
}

#[test]
fn recordings_are_dealt_class_after_class() {
    assert_eq!(folds(&[1, 0, 1, 0, 0, 1, 2], 2), Ok(vec![1, 0, 0, 1, 0, 1, 0]));
}

#[test]
fn too_few_and_too_many_folds_are_refused() {
    for count in [0, 1, 4] {
        let error = folds(&[0, 0, 1], count).unwrap_err().to_string();
        assert!(error.contains("2 to 3") && error.ends_with(&format!("found {count}")), "{error}");
    }
}

/// How many recordings of those that `counts` takes each fold has.
fn sizes(folds: &[usize], count: usize, counts: impl Fn(usize) -> bool) -> Vec<usize> {
    let of_fold = |fold| (0..folds.len()).filter(|&i| folds[i] == fold && counts(i)).count();
    (0..count).map(of_fold).collect()
}

proptest! {
    #[test]
    fn no_two_folds_differ_by_more_than_one_recording_of_a_class_or_of_all(
        classes in proptest::collection::vec(0..4_usize, 2..60),
        part in 0.0..=1.0_f64,
    ) {
        let count = 2 + (part * (classes.len() - 2) as f64) as usize;
        let folds = folds(&classes, count).unwrap();
        let mut groups: Vec<Vec<usize>> =
            (0..4).map(|class| sizes(&folds, count, |i| classes[i] == class)).collect();
        groups.push(sizes(&folds, count, |_| true));
        for sizes in groups {
            let (least, most) = (sizes.iter().min().unwrap(), sizes.iter().max().unwrap());
            prop_assert!(most - least <= 1, "{:?}", sizes);
        }
    }

    #[test]
    fn a_recordings_fold_is_its_place_in_the_order_of_class_and_index(
        classes in proptest::collection::vec(0..4_usize, 2..60),
    ) {
        let folds = folds(&classes, 2).unwrap();
        for (i, fold) in folds.into_iter().enumerate() {
            let before = (0..classes.len()).filter(|&j| (classes[j], j) < (classes[i], i)).count();
            prop_assert_eq!(fold, before % 2);
        }
    }
}

#[test]
fn an_answer_that_is_right_for_a_while_has_not_settled_then() {
    assert_eq!(correct_from(&[3, 1, 3, 3], 3), Some(2));
    assert_eq!(correct_from(&[3, 3], 3), Some(0));
    assert_eq!(correct_from(&[3, 3, 1], 3), None);
    assert_eq!(correct_from(&[], 3), None);
}

proptest! {
    #[test]
    fn it_is_the_first_place_behind_which_nothing_is_wrong(
        answers in proptest::collection::vec(0..3_usize, 0..12)
    ) {
        let slow = (0..answers.len()).find(|&i| answers[i..].iter().all(|&answer| answer == 1));
        prop_assert_eq!(correct_from(&answers, 1), slow);
    }
}
