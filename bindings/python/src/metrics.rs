//! Figures of merit, for `meissner/metrics.py`.

use meissner::models::systems::contact_area;
use meissner_evaluate::metrics::{Confusion, MeanStd, Scores, wilson_95};
use meissner_evaluate::pareto::pareto_front;
use pyo3::prelude::*;

use crate::error::{Failure, Outcome};

/// Rows of a confusion matrix: true classes by row, predicted ones by column.
#[pyfunction]
pub(crate) fn _confusion(truth: Vec<usize>, predicted: Vec<usize>, classes: usize) -> Outcome<Vec<Vec<u64>>> {
    if truth.len() != predicted.len() {
        let (expected, found) = (truth.len(), predicted.len());
        return Err(Failure::input(format!("predicted: expected {expected} classes, found {found}")));
    }
    Ok(confusion(truth.into_iter().zip(predicted).map(|pair| (pair, 1)), classes)?
        .rows()
        .map(<[u64]>::to_vec)
        .collect())
}

/// A matrix of pairs (truth, predicted), each with its count.
fn confusion(pairs: impl Iterator<Item = ((usize, usize), u64)>, classes: usize) -> Outcome<Confusion> {
    if classes > 4096 {
        return Err(Failure::input(format!("classes: expected at most 4096, found {classes}")));
    }
    let mut confusion = Confusion::new(classes);
    for ((truth, predicted), count) in pairs {
        let largest = truth.max(predicted);
        if largest >= classes {
            return Err(Failure::input(format!("expected classes below {classes}, found {largest}")));
        }
        confusion.add_many(truth, predicted, count);
    }
    Ok(confusion)
}

/// Accuracy, and the means of precision, recall and F1.
#[pyfunction]
pub(crate) fn _scores(rows: Vec<Vec<u64>>) -> Outcome<Option<[f64; 4]>> {
    let classes = rows.len();
    if let Some(row) = rows.iter().find(|row| row.len() != classes) {
        return Err(Failure::input(format!("confusion: expected {classes} columns, found {}", row.len())));
    }
    let pairs = rows.iter().enumerate().flat_map(|(truth, row)| {
        row.iter().enumerate().map(move |(predicted, &count)| ((truth, predicted), count))
    });
    let scores = Scores::of(&confusion(pairs, classes)?);
    Ok(scores.map(|scores| [scores.accuracy, scores.precision, scores.recall, scores.f1]))
}

/// The bounds of an interval.
#[pyfunction]
pub(crate) fn _wilson_95(hits: u64, trials: u64) -> Outcome<Option<(f64, f64)>> {
    if hits > trials {
        return Err(Failure::input(format!("hits: expected at most {trials}, found {hits}")));
    }
    Ok(wilson_95(hits, trials))
}

/// Mean and sample standard deviation.
#[pyfunction]
pub(crate) fn _mean_std(values: Vec<f64>) -> Option<(f64, Option<f64>)> {
    MeanStd::of(&values).map(|found| (found.mean, found.std))
}

/// Intersection over union.
#[pyfunction]
pub(crate) fn _iou(found: Vec<bool>, truth: Vec<bool>) -> Outcome<f64> {
    contact_area::iou(&found, &truth).map_err(|error| Failure::input(error.to_string()))
}

/// Indices of the points that no other point beats.
#[pyfunction]
pub(crate) fn _pareto_front(points: Vec<[f64; 2]>) -> Vec<usize> {
    pareto_front(&points.into_iter().map(<(f64, f64)>::from).collect::<Vec<_>>())
}
