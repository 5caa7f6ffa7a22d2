//! Which recordings a cross-validation holds out together.
//!
//! Enters: the class of each recording. Leaves: the fold of each. Recordings are dealt like cards: sorted by class, those
//! of a class in their order, the k-th (from 0) goes to fold k mod count. So of each class, and of all together, no two
//! folds differ by more than one recording, and the assignment depends on nothing but the order of the recordings.

use super::DigitsError;

/// The fold, from 0 to below `count`, of each recording, whose classes are `classes`. O(n log n).
///
/// # Errors
/// [`DigitsError::Folds`] for fewer than two folds, and for more folds than recordings.
pub fn folds(classes: &[usize], count: usize) -> Result<Vec<usize>, DigitsError> {
    if count < 2 || count > classes.len() {
        return Err(DigitsError::Folds { recordings: classes.len(), found: count });
    }
    let mut order: Vec<usize> = (0..classes.len()).collect();
    order.sort_by_key(|&recording| classes[recording]);
    let mut folds = vec![0; classes.len()];
    for (k, recording) in order.into_iter().enumerate() {
        folds[recording] = k % count;
    }
    Ok(folds)
}

#[cfg(test)]
mod tests {
    use super::folds;
    use proptest::prelude::*;

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
}
