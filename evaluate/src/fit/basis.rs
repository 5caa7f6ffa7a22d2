//! Readouts as coordinates: at most as many as readouts, and at most [`MAX_LANDMARKS`].
//!
//! A readout has thousands of values, and presses are few. The weights of a linear fit to readouts
//! X with a penalty are a sum of readouts, so that the span of the readouts, or of some of them,
//! contains them (Williams and Seeger 2001, "Using the Nystroem method to speed up kernel
//! machines"). In coordinates z of that span, products are those of the readouts:
//!
//! ```text
//! x~ = (x - mean) scale,   L L^T = M M^T,   z = L^-1 M x~          for landmarks M, rows of X~
//! ```
//!
//! A channel has one scale, so that cells that rarely have events stay small.

use ndarray::{Array2, ArrayView2, Axis};
use rayon::prelude::*;

use meissner_kernels::random::Random;

use super::cholesky::Factor;

/// Readouts that span the coordinates.
const MAX_LANDMARKS: usize = 2048;
/// Added to the diagonal, as a part of its mean, because readouts may depend on each other.
const JITTER: f64 = 1e-9;
/// Rows that are converted together.
const PART: usize = 256;

/// Readouts of all samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Design<'a> {
    pub(super) values: &'a [f32],
    pub(super) columns: usize,
    pub(super) channels: usize,
    /// Weight of each row in a fit: the heaviest rows become landmarks.
    pub(super) weights: &'a [f64],
    /// Number of channels at the end that count events; they weigh as much as all others.
    pub(super) counts: usize,
}

/// Values that are linear in others.
#[derive(Clone, Debug)]
pub(super) struct Linear {
    /// Outputs by inputs.
    pub(super) weight: Array2<f64>,
    pub(super) bias: Vec<f64>,
}

/// Coordinates in the span of landmarks.
pub(super) struct Basis {
    mean: Vec<f64>,
    scale: Vec<f64>,
    /// Centred and scaled.
    landmarks: Array2<f64>,
    factor: Factor,
}

impl Design<'_> {
    fn rows(&self) -> usize {
        self.values.len() / self.columns
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.columns..(row + 1) * self.columns]
    }

    /// The mean and the factor of each column.
    fn scales(&self) -> (Vec<f64>, Vec<f64>) {
        let count = self.rows() as f64;
        let mut mean = vec![0.0; self.columns];
        for row in 0..self.rows() {
            mean.iter_mut().zip(self.row(row)).for_each(|(mean, &x)| *mean += f64::from(x) / count);
        }
        let mut squares = vec![0.0; self.channels];
        for row in 0..self.rows() {
            for (cell, means) in self.row(row).chunks(self.channels).zip(mean.chunks(self.channels)) {
                for ((square, &x), mean) in squares.iter_mut().zip(cell).zip(means) {
                    *square += (f64::from(x) - mean) * (f64::from(x) - mean);
                }
            }
        }
        let values = count * (self.columns / self.channels) as f64;
        let layers = self.channels - self.counts;
        let weight = if self.counts > 0 { (layers as f64 / self.counts as f64).sqrt() } else { 1.0 };
        let scale = |(channel, &square): (usize, &f64)| {
            let own = if square > 0.0 { (values / square).sqrt() } else { 1.0 };
            if channel < layers { own } else { own * weight }
        };
        let of_channel: Vec<f64> = squares.iter().enumerate().map(scale).collect();
        let scale = (0..self.columns).map(|column| of_channel[column % self.channels]).collect();
        (mean, scale)
    }

    /// Rows, centred and scaled.
    fn scaled(&self, rows: &[usize], mean: &[f64], scale: &[f64]) -> Array2<f64> {
        let mut found = Array2::zeros((rows.len(), self.columns));
        for (&row, mut to) in rows.iter().zip(found.rows_mut()) {
            for (((to, &x), mean), scale) in to.iter_mut().zip(self.row(row)).zip(mean).zip(scale) {
                *to = (f64::from(x) - mean) * scale;
            }
        }
        found
    }
}

/// At most `count` rows, those with the largest of `weights`; of equal ones `seed` draws.
pub(super) fn landmarks(weights: &[f64], count: usize, seed: u64) -> Vec<usize> {
    let mut drawn: Vec<usize> = (0..weights.len()).collect();
    if drawn.len() > count {
        let mut random = Random::new(seed);
        (1..drawn.len()).rev().for_each(|i| drawn.swap(i, random.below(i as u64 + 1) as usize));
        drawn.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]));
        drawn.truncate(count);
        drawn.sort_unstable();
    }
    drawn
}

impl Basis {
    /// A basis for `design`, and the coordinates of its rows. With more rows than landmarks, `seed`
    /// draws these. O(rows columns landmarks).
    pub(super) fn new(design: Design<'_>, seed: u64) -> Option<(Self, Array2<f64>)> {
        let rows = design.rows();
        let (mean, scale) = design.scales();
        let drawn = landmarks(design.weights, MAX_LANDMARKS, seed);
        let landmarks = design.scaled(&drawn, &mean, &scale);
        let all: Vec<usize> = (0..rows).collect();
        let mut found = Array2::zeros((rows, drawn.len()));
        let parts: Vec<_> = all.chunks(PART).zip(found.axis_chunks_iter_mut(Axis(0), PART)).collect();
        parts.into_par_iter().for_each(|(rows, mut to)| {
            to.assign(&design.scaled(rows, &mean, &scale).dot(&landmarks.t()));
        });
        let products = found.select(Axis(0), &drawn);
        let size = products.diag().sum() / drawn.len().max(1) as f64;
        let factor = Factor::new(products, if size > 0.0 { JITTER * size } else { 1.0 })?;
        factor.forward(&mut found);
        Some((Self { mean, scale, landmarks, factor }, found))
    }

    /// The linear function `of` the coordinates (outputs by coordinates), as a function of the
    /// readout that is 0 at the mean.
    pub(super) fn of_readout(&self, of: ArrayView2<'_, f64>) -> Linear {
        let mut of = of.to_owned();
        self.factor.backward(&mut of);
        let mut weight = of.dot(&self.landmarks);
        weight.rows_mut().into_iter().for_each(|mut row| {
            row.iter_mut().zip(&self.scale).for_each(|(w, scale)| *w *= scale);
        });
        let at_mean =
            |row: ndarray::ArrayView1<'_, f64>| row.iter().zip(&self.mean).map(|(w, x)| w * x).sum::<f64>();
        let bias = weight.rows().into_iter().map(|row| -at_mean(row)).collect();
        Linear { weight, bias }
    }
}
