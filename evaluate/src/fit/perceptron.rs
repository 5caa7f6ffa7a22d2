//! A small perceptron over the main modes of the readout, for functions that are neither linear nor
//! quadratic.
//!
//! ```text
//! y = B elu(A u + a) + b      u: modes, scaled together
//! ```
//!
//! It learns classes from cross-entropy, or the residuals of a ridge regression of quantities from
//! squared errors, by `AdamW` (Loshchilov and Hutter 2019, "Decoupled weight decay regularization")
//! with dropout and a rate that falls to 0 along a cosine. The epoch is kept that is best on
//! presses outside the training. The order of samples and the dropout follow from the seed.

use std::f64::consts::PI;

use libm::{cos, exp, expm1, log};
use meissner_kernels::random::Random;
use ndarray::{Array1, Array2, ArrayView1, Axis, Zip};

use super::basis::Linear;
use crate::error::Result;
use crate::workers::ProgressHandle;

const EPOCHS: usize = 60;
const BATCH: usize = 32;
const RATE: f64 = 3e-3;
const DECAY: f64 = 1e-2;
/// Parts of the inputs and of the units that are left out at a step.
const DROPOUT: [f64; 2] = [0.15, 0.3];
/// The part of a label that is spread over all classes.
const SMOOTHING: f64 = 0.05;
/// Decay of the means of gradients, and of their squares.
const MEANS: [f64; 2] = [0.9, 0.999];

/// The values to be predicted, by rows.
pub(super) enum Truth {
    /// Quantities in units of their own deviation, rows by outputs.
    Quantities(Array2<f64>),
    /// The class of each row, and the number of classes.
    Classes(Vec<usize>, usize),
}

/// Two dense layers, with ELU between them.
#[derive(Clone, Debug)]
pub(super) struct Perceptron {
    pub(super) first: Linear,
    pub(super) second: Linear,
}

/// The rows that it learns from, and those that choose the epoch.
pub(super) struct Part<'a> {
    pub(super) train: &'a [usize],
    pub(super) choose: &'a [usize],
    pub(super) seed: u64,
}

/// Values with the means that `AdamW` keeps.
struct Learnt {
    values: Array2<f64>,
    means: Array2<f64>,
    squares: Array2<f64>,
    decay: f64,
}

impl Truth {
    fn outputs(&self) -> usize {
        match self {
            Self::Quantities(truth) => truth.ncols(),
            Self::Classes(_, classes) => *classes,
        }
    }

    /// The loss of a row, and its gradient.
    fn loss(&self, row: usize, predicted: ArrayView1<'_, f64>, gradient: &mut Array1<f64>) -> f64 {
        match self {
            Self::Quantities(truth) => {
                gradient.assign(&(&predicted - &truth.row(row)));
                gradient.dot(gradient) / 2.0
            }
            Self::Classes(of, classes) => {
                let most = predicted.fold(f64::NEG_INFINITY, |most, &logit| most.max(logit));
                gradient.assign(&predicted.mapv(|logit| exp(logit - most)));
                let sum = gradient.sum();
                let loss = log(sum) + most - predicted[of[row]];
                *gradient /= sum;
                *gradient -= SMOOTHING / *classes as f64;
                gradient[of[row]] -= 1.0 - SMOOTHING;
                loss
            }
        }
    }
}

impl Learnt {
    fn new(values: Array2<f64>, decay: f64) -> Self {
        let (means, squares) = (Array2::zeros(values.dim()), Array2::zeros(values.dim()));
        Self { values, means, squares, decay }
    }

    fn step(&mut self, gradient: &Array2<f64>, rate: f64, steps: i32) {
        let [first, second] = MEANS;
        let [of_means, of_squares] = MEANS.map(|decay| 1.0 / (1.0 - decay.powi(steps)));
        Zip::from(&mut self.values).and(&mut self.means).and(&mut self.squares).and(gradient).for_each(
            |value, mean, square, gradient| {
                *mean = first * *mean + (1.0 - first) * gradient;
                *square = second * *square + (1.0 - second) * gradient * gradient;
                let step = *mean * of_means / ((*square * of_squares).sqrt() + 1e-8);
                *value -= rate * (step + self.decay * *value);
            },
        );
    }
}

impl Perceptron {
    /// A perceptron of `hidden` units that learns `truth` from `inputs` (rows by inputs, with a
    /// mean square of 1).
    ///
    /// # Errors
    /// The caller cancelled it.
    pub(super) fn train(
        inputs: &Array2<f64>,
        truth: &Truth,
        part: &Part<'_>,
        hidden: usize,
        watch: &ProgressHandle,
    ) -> Result<Self> {
        let (width, outputs) = (inputs.ncols(), truth.outputs());
        let mut random = Random::new(part.seed);
        // A sum of four uniform values is nearly normal.
        let mut normal = |deviation: f64| {
            let sum: f64 = (0..4).map(|_| random.uniform()).sum();
            (sum - 2.0) * 3.0_f64.sqrt() * deviation
        };
        let of_first = (2.0 / width as f64).sqrt();
        let of_second = 0.1 / (hidden as f64).sqrt();
        let mut first = Learnt::new(Array2::from_shape_fn((hidden, width), |_| normal(of_first)), DECAY);
        let mut second = Learnt::new(Array2::from_shape_fn((outputs, hidden), |_| normal(of_second)), DECAY);
        let [mut first_bias, mut second_bias] =
            [hidden, outputs].map(|count| Learnt::new(Array2::zeros((1, count)), 0.0));
        let own = |first: &Learnt, first_bias: &Learnt, second: &Learnt, second_bias: &Learnt| {
            let linear = |weight: &Learnt, bias: &Learnt| Linear {
                weight: weight.values.clone(),
                bias: bias.values.iter().copied().collect(),
            };
            Self { first: linear(first, first_bias), second: linear(second, second_bias) }
        };
        let mut best = (f64::INFINITY, own(&first, &first_bias, &second, &second_bias));
        let of_choice = inputs.select(Axis(0), part.choose);
        let (mut order, mut steps) = (part.train.to_vec(), 0);
        let total = EPOCHS * order.len().div_ceil(BATCH).max(1);
        let mut gradient = Array1::zeros(outputs);
        for _ in 0..EPOCHS {
            watch.check()?;
            (1..order.len()).rev().for_each(|i| order.swap(i, random.below(i as u64 + 1) as usize));
            for rows in order.chunks(BATCH) {
                let rate = RATE * (1.0 + cos(PI * f64::from(steps) / total as f64)) / 2.0;
                steps += 1;
                let mut drop = |of: &mut Array2<f64>, part: f64| {
                    let kept = of.mapv(|_| if random.uniform() < part { 0.0 } else { 1.0 / (1.0 - part) });
                    *of *= &kept;
                    kept
                };
                let mut x = inputs.select(Axis(0), rows);
                drop(&mut x, DROPOUT[0]);
                let sums = x.dot(&first.values.t()) + &first_bias.values;
                let mut units = sums.mapv(elu);
                let kept = drop(&mut units, DROPOUT[1]);
                let found = units.dot(&second.values.t()) + &second_bias.values;
                let mut of_found = Array2::zeros(found.dim());
                for ((&row, predicted), mut to) in rows.iter().zip(found.rows()).zip(of_found.rows_mut()) {
                    truth.loss(row, predicted, &mut gradient);
                    to.assign(&(&gradient / rows.len() as f64));
                }
                let mut of_sums = of_found.dot(&second.values) * &kept;
                of_sums.zip_mut_with(&sums, |of, &sum| *of *= if sum < 0.0 { exp(sum) } else { 1.0 });
                let summed = |of: &Array2<f64>| of.sum_axis(Axis(0)).insert_axis(Axis(0));
                second.step(&of_found.t().dot(&units), rate, steps);
                second_bias.step(&summed(&of_found), rate, steps);
                first.step(&of_sums.t().dot(&x), rate, steps);
                first_bias.step(&summed(&of_sums), rate, steps);
            }
            let now = own(&first, &first_bias, &second, &second_bias);
            let rows = part
                .choose
                .iter()
                .zip(now.of(&of_choice).rows().into_iter().map(|row| row.to_owned()).collect::<Vec<_>>());
            let loss: f64 = rows.map(|(&row, found)| truth.loss(row, found.view(), &mut gradient)).sum();
            if loss < best.0 {
                best = (loss, now);
            }
        }
        Ok(best.1)
    }

    /// The outputs for rows of inputs.
    pub(super) fn of(&self, inputs: &Array2<f64>) -> Array2<f64> {
        self.second.of(self.first.of(inputs.view()).mapv(elu).view())
    }
}

fn elu(sum: f64) -> f64 {
    if sum < 0.0 { expm1(sum) } else { sum }
}
