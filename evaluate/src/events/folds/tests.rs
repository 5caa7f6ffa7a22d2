//! Folds against their definition.

use proptest::prelude::*;

use super::{folds, is_a_fold};

#[test]
fn recordings_are_dealt_class_after_class() {
    assert_eq!(folds(&[1, 0, 1, 0, 0, 1, 2], 2).unwrap(), [1, 0, 0, 1, 0, 1, 0]);
}

#[test]
fn too_few_and_too_many_folds_are_refused() {
    for count in [0, 1, 4] {
        let error = folds(&[0, 0, 1], count).unwrap_err().to_string();
        assert!(error.contains("2 to 3") && error.ends_with(&format!("found {count}")), "{error}");
    }
}

#[test]
fn a_fold_is_all_of_its_recordings_and_no_other() {
    let folds = [0, 1, 0, 1, 2];
    for chosen in [&[0, 2][..], &[1, 3], &[4]] {
        assert!(is_a_fold(chosen, 3, &folds).is_ok(), "{chosen:?}");
    }
    for (chosen, found) in [
        (
            &[0][..],
            "the 2 recordings of one fold of 3, as `meissner prepare` writes them with --folds 3, found 1",
        ),
        (&[0, 1], "found 2 recordings of 2 folds"),
        (&[], "found 0 recordings of 0 folds"),
    ] {
        let error = is_a_fold(chosen, 3, &folds).unwrap_err().to_string();
        assert!(error.contains(found), "{error}");
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
