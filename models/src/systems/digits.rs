//! Handwritten digits in front of a moving event camera (N-MNIST, 34 x 34 pixels): 10 classes.
//!
//! - [`CLASSES`]: the digits, in the order of a network's outputs; [`SENSOR`]: the pixels; [`check`]: whether a network
//!   predicts the digits,
//! - [`trained_as`]: the network whose weights a network runs with,
//! - [`folds`]: the recordings that a cross-validation holds out together,
//! - [`correct_from`]: the first answer from which on all answers are right,
//! - [`DigitsError`]: networks and numbers of folds that do not belong here.

use meissner_engine::Sensor;
use thiserror::Error;

use super::{OutputsError, check_outputs};
use crate::Description;

/// A network does not predict the digits, or a cross-validation cannot have so many folds.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages explain the fields")]
#[non_exhaustive]
pub enum DigitsError {
    /// The network predicts other classes or values.
    #[error(transparent)]
    Outputs(#[from] OutputsError),
    /// A cross-validation cannot have so many folds.
    #[error("folds: expected 2 to {recordings}, the number of recordings, found {found}")]
    Folds { recordings: usize, found: usize },
}

/// Names of the classes, in the order of their indices.
pub const CLASSES: [&str; 10] = ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"];

/// The sensor of all recordings.
pub const SENSOR: Sensor = Sensor { width: 34, height: 34 };

/// Networks that run with the weights of another network, and that network.
const SHARED_WEIGHTS: &[(&str, &str)] = &[("digits-frozen", "digits-past")];

/// The network that the weights of `network` were trained as: itself, or the one that it shares them with.
pub fn trained_as(network: &str) -> &str {
    SHARED_WEIGHTS.iter().find(|(name, _)| *name == network).map_or(network, |(_, trained)| trained)
}

/// `Ok` where `description` predicts [`CLASSES`].
///
/// # Errors
/// [`DigitsError::Outputs`] where it predicts something else.
pub fn check(description: &Description) -> Result<(), DigitsError> {
    Ok(check_outputs(description.name(), description.outputs().0, &CLASSES)?)
}

/// The fold, from 0 to below `count`, of each recording; `classes` has the class of each. O(n log n).
///
/// Recordings are dealt like cards. They are sorted by class, and recordings of one class keep their order. The k-th (from
/// 0) goes to fold k mod `count`. Of each class, and of all classes together, no two folds differ by more than one
/// recording. The assignment depends on nothing but the order of the recordings.
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

/// The index of the first of `answers`, in order of time, from which on all are `truth`; `None` where the last one is not,
/// or where there are no answers. O(n).
pub fn correct_from(answers: &[usize], truth: usize) -> Option<usize> {
    let wrong = answers.iter().rposition(|&answer| answer != truth);
    let first = wrong.map_or(0, |last_wrong| last_wrong + 1);
    (first < answers.len()).then_some(first)
}

#[cfg(test)]
mod tests;
