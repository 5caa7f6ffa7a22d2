//! The folds of a cross-validation over labelled recordings: dealing them, and recognising one.

use crate::error::{EvaluateError, TrainingError};

/// The fold, from 0 to below `count`, of each recording; `classes` has the class of each. O(n log
/// n).
///
/// Recordings are dealt like cards. They are sorted by class, and recordings of one class keep
/// their order. The k-th (from 0) goes to fold k mod `count`. Of each class, and of all classes
/// together, no two folds differ by more than one recording. The assignment depends on nothing but
/// the order of the recordings.
///
/// # Errors
/// [`EvaluateError::Folds`] for fewer than two folds, and for more folds than recordings.
pub fn folds(classes: &[usize], count: usize) -> Result<Vec<usize>, EvaluateError> {
    if count < 2 || count > classes.len() {
        return Err(EvaluateError::Folds { recordings: classes.len(), found: count });
    }
    let mut order: Vec<usize> = (0..classes.len()).collect();
    order.sort_by_key(|&recording| classes[recording]);
    let mut folds = vec![0; classes.len()];
    for (k, recording) in order.into_iter().enumerate() {
        folds[recording] = k % count;
    }
    Ok(folds)
}

/// `Ok` where the recordings `chosen` are one of the `folds`, of which there are `count`.
pub(super) fn is_a_fold(chosen: &[usize], count: usize, folds: &[usize]) -> Result<(), TrainingError> {
    let mut met: Vec<usize> = chosen.iter().map(|&recording| folds[recording]).collect();
    met.sort_unstable();
    met.dedup();
    let expected = met.first().map_or(0, |first| folds.iter().filter(|fold| *fold == first).count());
    if met.len() == 1 && chosen.len() == expected {
        return Ok(());
    }
    Err(TrainingError::OtherFold { count, expected, found: chosen.len(), folds: met.len() })
}

#[cfg(test)]
mod tests;
