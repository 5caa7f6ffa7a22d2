//! Cross-validation by press: predictions of heads for presses that they were not fitted to.
//!
//! The choice for a fold is the best one on the other folds, so that no press affects the choice
//! for its own prediction. The choice for the final head is the best one on all folds.

use libm::{exp, exp2, log};
use ndarray::{Array1, Array2, Axis};
use rayon::prelude::*;

use super::basis::Linear;
use super::heads::{Choice, Sums};
use super::modes::Features;
use super::perceptron::{Part, Perceptron, Truth};
use super::samples::{Instant, Target};
use crate::error::Result;
use crate::metrics::largest;
use crate::workers::ProgressHandle;

/// The data of a validation.
pub(super) struct Validation<'a> {
    pub(super) features: &'a Features,
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
    /// Predictions by instants and outputs.
    pub(super) predicted: Array2<f64>,
    /// For each output, the best choice on all folds; one for all classes.
    pub(super) choices: Vec<Choice>,
    /// The perceptrons of the folds. Their sum is added to the linear part; for classes, it
    /// replaces it. Empty if they predict held-out presses no better.
    pub(super) perceptrons: Vec<Perceptron>,
}

impl Validation<'_> {
    /// Holds out each fold, from presses that are `taken`, for the best of `choices`.
    pub(super) fn held_out(&self, taken: impl Fn(usize) -> bool, choices: &[Choice]) -> Result<HeldOut> {
        let outputs = self.target.outputs().len();
        let mut predicted = vec![Array2::zeros((self.instants.len(), outputs)); choices.len()];
        let mut fits = vec![true; choices.len()];
        let rows = |chosen: &dyn Fn(usize) -> bool| -> Vec<usize> {
            (0..self.instants.len()).filter(|&row| chosen(self.instants[row].press)).collect()
        };
        let all = self.sums(&rows(&taken));
        for fold in 0..self.folds {
            self.watch.check()?;
            let part = self.sums(&rows(&|press| self.fold[press] == fold && taken(press)));
            let heads = all.clone().without(&part).heads(self.features.linear, choices);
            let held = rows(&|press| self.fold[press] == fold);
            let features = self.features.values.select(Axis(0), &held);
            for ((head, predicted), fits) in heads.iter().zip(&mut predicted).zip(&mut fits) {
                *fits &= head.is_some();
                let Some(head) = head else { continue };
                for (&row, found) in held.iter().zip(head.of(features.view()).rows()) {
                    predicted.row_mut(row).assign(&found);
                }
            }
        }
        let losses: Vec<Array2<f64>> = predicted.iter().map(|predicted| self.losses(predicted)).collect();
        // If losses are equal, the choice with the least freedom.
        let best = |output: usize, without: Option<usize>| {
            let loss = |choice: usize| {
                let folds = (0..self.folds).filter(|fold| Some(*fold) != without);
                folds.map(|fold| losses[choice][[fold, output]]).sum::<f64>()
            };
            let able = (0..choices.len()).rev().filter(|&choice| fits[choice]);
            able.min_by(|&a, &b| loss(a).total_cmp(&loss(b))).unwrap_or(choices.len() - 1)
        };
        let mut chosen = Array2::zeros((self.instants.len(), outputs));
        for output in 0..outputs {
            let of_fold: Vec<usize> = (0..self.folds).map(|fold| best(output, Some(fold))).collect();
            for (row, instant) in self.instants.iter().enumerate() {
                chosen[[row, output]] = predicted[of_fold[self.fold[instant.press]]][[row, output]];
            }
        }
        let choices = (0..outputs).map(|output| choices[best(output, None)]).collect();
        Ok(HeldOut { predicted: chosen, choices, perceptrons: Vec::new() })
    }

    /// Adds perceptrons of `hidden` units to `held_out`, one a fold, from presses that are `taken`.
    ///
    /// The perceptron of a fold learns from all folds except it and the next one, which chooses the
    /// epoch. For quantities, it learns the residuals of the held-out predictions.
    pub(super) fn with_perceptrons(
        &self,
        mut held_out: HeldOut,
        taken: impl Fn(usize) -> bool + Sync,
        (hidden, seed): (usize, u64),
    ) -> Result<HeldOut> {
        let mut inputs = self.features.of_modes();
        let square: f64 = inputs.iter().map(|value| value * value).sum();
        let scale = if square > 0.0 { (inputs.len() as f64 / square).sqrt() } else { 1.0 };
        inputs *= scale;
        let outputs = held_out.predicted.ncols();
        let (truth, sizes) = match self.target {
            Target::Quantities(_) => {
                let left = |(row, output): (usize, usize)| {
                    self.instants[row].truth[output] - held_out.predicted[[row, output]]
                };
                let mut left = Array2::from_shape_fn((self.instants.len(), outputs), left);
                let rows = left.nrows() as f64;
                let size = |of: ndarray::ArrayView1<'_, f64>| (of.dot(&of) / rows).sqrt();
                let sizes: Array1<f64> = left
                    .columns()
                    .into_iter()
                    .map(|of| Some(size(of)).filter(|size| *size > 0.0).unwrap_or(1.0))
                    .collect();
                left /= &sizes;
                (Truth::Quantities(left), sizes)
            }
            Target::Classes { .. } => {
                let of = self.instants.iter().map(|instant| instant.truth[0] as usize).collect();
                (Truth::Classes(of, outputs), Array1::ones(outputs))
            }
        };
        let rows = |chosen: &dyn Fn(usize) -> bool| -> Vec<usize> {
            (0..self.instants.len()).filter(|&row| chosen(self.instants[row].press)).collect()
        };
        let of_fold = |fold: usize| -> Result<Perceptron> {
            let next = (fold + 1) % self.folds;
            let others = |press: usize| self.fold[press] != fold && self.fold[press] != next;
            // With two folds, one would be left to learn from and none to choose the epoch.
            let train =
                rows(&|press| taken(press) && (others(press) || self.folds == 2 && self.fold[press] == next));
            let mut choose = rows(&|press| self.fold[press] == next);
            choose.retain(|&row| self.instants[row].moved == [0, 0]);
            let part = Part { train: &train, choose: &choose, seed: seed ^ fold as u64 };
            Perceptron::train(&inputs, &truth, &part, hidden, self.watch)
        };
        let found: Vec<Result<Perceptron>> = (0..self.folds).into_par_iter().map(of_fold).collect();
        let mut perceptrons = found.into_iter().collect::<Result<Vec<_>>>()?;
        let mut predicted = held_out.predicted.clone();
        for (fold, of) in perceptrons.iter().enumerate() {
            let held = rows(&|press| self.fold[press] == fold);
            for (&row, found) in held.iter().zip(of.of(&inputs.select(Axis(0), &held)).rows()) {
                let mut to = predicted.row_mut(row);
                match self.target {
                    Target::Quantities(_) => to += &(&found * &sizes),
                    Target::Classes { .. } => to.assign(&found),
                }
            }
        }
        let [before, after] = [&held_out.predicted, &predicted].map(|of| self.losses(of).sum_axis(Axis(0)));
        let is_better = |output: usize| after[output] < before[output];
        if !(0..outputs).any(is_better) {
            return Ok(held_out);
        }
        for of in &mut perceptrons {
            of.first.weight *= scale;
            for output in 0..outputs {
                let factor = if is_better(output) { sizes[output] / self.folds as f64 } else { 0.0 };
                of.second.weight.row_mut(output).mapv_inplace(|weight| weight * factor);
                of.second.bias[output] *= factor;
            }
        }
        for output in (0..outputs).filter(|&output| is_better(output)) {
            held_out.predicted.column_mut(output).assign(&predicted.column(output));
        }
        held_out.perceptrons = perceptrons;
        Ok(held_out)
    }

    /// The head of all presses with the `choices` of the outputs.
    pub(super) fn whole(&self, choices: &[Choice]) -> Option<Linear> {
        let rows: Vec<usize> = (0..self.instants.len()).collect();
        let mut distinct: Vec<Choice> = Vec::new();
        for choice in choices {
            if !distinct.contains(choice) {
                distinct.push(*choice);
            }
        }
        let heads = self.sums(&rows).heads(self.features.linear, &distinct);
        let mut whole = Linear {
            weight: Array2::zeros((choices.len(), self.features.values.ncols())),
            bias: vec![0.0; choices.len()],
        };
        for (output, choice) in choices.iter().enumerate() {
            let head = heads[distinct.iter().position(|one| one == choice)?].as_ref()?;
            let mut row = whole.weight.row_mut(output);
            row.iter_mut().zip(head.weight.row(output)).for_each(|(to, &weight)| *to = weight);
            whole.bias[output] = head.bias[output];
        }
        Some(whole)
    }

    /// The loss of `of` as a part of that of `other`: the mean over outputs.
    pub(super) fn ratio(&self, of: &HeldOut, other: &HeldOut) -> f64 {
        let [of, other] = [of, other].map(|held_out| self.losses(&held_out.predicted).sum_axis(Axis(0)));
        let ratio = |(of, other): (&f64, &f64)| if of == other { 1.0 } else { of / other };
        of.iter().zip(&other).map(ratio).sum::<f64>() / of.len() as f64
    }

    fn sums(&self, rows: &[usize]) -> Sums {
        Sums::of(self.features, self.target, self.instants, rows)
    }

    /// The weighted sum of squared errors, or the weighted number of wrong classes, by folds and
    /// outputs.
    fn losses(&self, predicted: &Array2<f64>) -> Array2<f64> {
        let mut losses = Array2::zeros((self.folds, predicted.ncols()));
        let all = self.instants.iter().zip(predicted.rows());
        for (instant, predicted) in all.filter(|(instant, _)| instant.moved == [0, 0]) {
            let mut of = losses.row_mut(self.fold[instant.press]);
            match self.target {
                Target::Quantities(_) => {
                    for ((loss, value), truth) in of.iter_mut().zip(predicted).zip(&instant.truth) {
                        *loss += instant.weight * (value - truth) * (value - truth);
                    }
                }
                Target::Classes { .. } => {
                    let is_wrong = class(predicted.iter().copied()) != instant.truth[0] as usize;
                    of += if is_wrong { instant.weight } else { 0.0 };
                }
            }
        }
        losses
    }
}

/// The factor of logits (rows by classes) that calibrates the confidence of their softmax: the
/// power of 2^(1/4) with the smallest cross-entropy (Guo et al. 2017, "On calibration of modern
/// neural networks").
pub(super) fn sureness(logits: &Array2<f64>, truth: &[usize]) -> f64 {
    let loss = |factor: f64| {
        let rows = logits.rows().into_iter().zip(truth);
        let of = |(row, &class): (ndarray::ArrayView1<'_, f64>, &usize)| {
            let most = row.fold(f64::NEG_INFINITY, |most, &logit| most.max(logit));
            let sum: f64 = row.iter().map(|logit| exp(factor * (logit - most))).sum();
            log(sum) + factor * (most - row[class])
        };
        rows.map(of).sum::<f64>()
    };
    let factors = (-40..=12).map(|step| exp2(f64::from(step) / 4.0)).map(|factor| (loss(factor), factor));
    factors.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(1.0, |(_, factor)| factor)
}

/// The class with the largest of `logits`, the first of equal ones.
pub(super) fn class(logits: impl Iterator<Item = f64>) -> usize {
    let logits: Vec<f32> = logits.map(|value| value as f32).collect();
    largest(&logits).unwrap_or(0)
}
