//! Cross-validation by press: what heads predict for presses that they were not fitted to.
//!
//! The strength of a fold is the one that is best on the other folds, so that no press chooses how
//! it is predicted itself. That of the head that is kept is the best one on all folds.

use ndarray::Array2;

use super::design::{Design, Linear};
use super::heads::fit;
use super::samples::{Instant, Target};
use crate::error::Result;
use crate::metrics::largest;
use crate::workers::ProgressHandle;

/// What is validated.
pub(super) struct Validation<'a> {
    pub(super) design: Design<'a>,
    pub(super) target: &'a Target,
    pub(super) instants: &'a [Instant],
    /// The fold of each press.
    pub(super) fold: &'a [usize],
    pub(super) folds: usize,
    pub(super) watch: &'a ProgressHandle,
}

/// Predictions for presses that were held out.
#[derive(Clone, Debug)]
pub(super) struct HeldOut {
    /// By instants and outputs.
    pub(super) predicted: Array2<f64>,
    /// For each output, the strength that is best on all folds.
    pub(super) strengths: Vec<f64>,
}

impl Validation<'_> {
    /// Holds out each fold, from presses that are `taken`, for the best of `strengths`.
    pub(super) fn held_out(&self, taken: impl Fn(usize) -> bool, strengths: &[f64]) -> Result<HeldOut> {
        let outputs = self.outputs();
        let mut predicted = vec![Array2::zeros((self.instants.len(), outputs)); strengths.len()];
        let mut fits = vec![true; strengths.len()];
        for fold in 0..self.folds {
            self.watch.check()?;
            let of = |held: bool| -> Vec<usize> {
                let chosen = |press: usize| (self.fold[press] == fold) == held && (held || taken(press));
                (0..self.instants.len()).filter(|&row| chosen(self.instants[row].press)).collect()
            };
            let (rows, held) = (of(false), of(true));
            let heads = fit(self.design, self.target, self.instants, &rows, strengths);
            let able: Vec<&Linear> = heads.iter().flatten().collect();
            let mut found = self.design.predict(&able, &held).into_iter();
            for ((head, predicted), fits) in heads.iter().zip(&mut predicted).zip(&mut fits) {
                *fits &= head.is_some();
                let Some(found) = head.as_ref().and_then(|_| found.next()) else { continue };
                for (&row, found) in held.iter().zip(found.rows()) {
                    predicted.row_mut(row).assign(&found);
                }
            }
        }
        let losses: Vec<Array2<f64>> = predicted.iter().map(|predicted| self.losses(predicted)).collect();
        // Of equal losses, the strongest.
        let best = |output: usize, without: Option<usize>| {
            let loss = |strength: usize| {
                let folds = (0..self.folds).filter(|fold| Some(*fold) != without);
                folds.map(|fold| losses[strength][[fold, output]]).sum::<f64>()
            };
            let able = (0..strengths.len()).rev().filter(|&strength| fits[strength]);
            able.min_by(|&a, &b| loss(a).total_cmp(&loss(b))).unwrap_or(strengths.len() - 1)
        };
        let mut chosen = Array2::zeros((self.instants.len(), outputs));
        for output in 0..outputs {
            let of_fold: Vec<usize> = (0..self.folds).map(|fold| best(output, Some(fold))).collect();
            for (row, instant) in self.instants.iter().enumerate() {
                chosen[[row, output]] = predicted[of_fold[self.fold[instant.press]]][[row, output]];
            }
        }
        let strengths = (0..outputs).map(|output| strengths[best(output, None)]).collect();
        Ok(HeldOut { predicted: chosen, strengths })
    }

    /// The head of all presses with the `strengths` of the outputs.
    pub(super) fn whole(&self, strengths: &[f64]) -> Option<Linear> {
        let rows: Vec<usize> = (0..self.instants.len()).collect();
        let mut distinct = strengths.to_vec();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        let heads = fit(self.design, self.target, self.instants, &rows, &distinct);
        let mut chosen: Option<Linear> = None;
        for (output, strength) in strengths.iter().enumerate() {
            let of = distinct.iter().position(|one| one == strength)?;
            let head = heads[of].as_ref()?;
            let chosen = chosen.get_or_insert_with(|| head.clone());
            chosen.weight.row_mut(output).assign(&head.weight.row(output));
            chosen.bias[output] = head.bias[output];
        }
        chosen
    }

    fn outputs(&self) -> usize {
        self.target.outputs().len()
    }

    /// By folds and outputs: the sum of squared errors, or the number of wrong classes.
    fn losses(&self, predicted: &Array2<f64>) -> Array2<f64> {
        let mut losses = Array2::zeros((self.folds, predicted.ncols()));
        for (instant, predicted) in self.instants.iter().zip(predicted.rows()) {
            let mut of = losses.row_mut(self.fold[instant.press]);
            match self.target {
                Target::Quantities(_) => {
                    for ((loss, value), truth) in of.iter_mut().zip(predicted).zip(&instant.truth) {
                        *loss += (value - truth) * (value - truth);
                    }
                }
                Target::Classes { .. } => {
                    of += f64::from(u8::from(class(predicted.iter().copied()) != instant.truth[0] as usize));
                }
            }
        }
        losses
    }
}

/// The class with the largest of `logits`, the first of equal ones.
pub(super) fn class(logits: impl Iterator<Item = f64>) -> usize {
    let logits: Vec<f32> = logits.map(|value| value as f32).collect();
    largest(&logits).unwrap_or(0)
}
