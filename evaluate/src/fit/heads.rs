//! Heads that are linear or quadratic in the readout: ridge regression, and a shrunken
//! discriminant.
//!
//! ```text
//! quantities  w = (F^T F + s)^-1 F^T (y - mean y)
//! classes     w = n (W + s)^-1 (m_c - m),  bias = log p_c - (m_c + m) w / 2
//! ```
//! for n rows, weighted, of centred features F, the scatter W within classes and the share p of a
//! class (Hoerl and Kennard 1970, "Ridge regression"; Friedman 1989, "Regularized discriminant
//! analysis"). A strength r is relative: `s = r trace / n`, with the trace of the matrix to which s
//! is added.

use libm::log;
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};

use super::basis::Linear;
use super::cholesky::{Factor, add_products, block};
use super::modes::Features;
use super::samples::{Instant, Target};

/// Strengths that are tried.
const STRENGTHS: [f64; 6] = [1e-3, 1e-2, 3.2e-2, 0.1, 0.32, 1.0];
/// Factors of the products; with 0 a head is linear.
const PRODUCTS: [f64; 4] = [0.0, 0.7, 1.4, 2.8];
/// Rows that are copied together.
const PART: usize = 256;

/// How a head is regularised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Choice {
    /// Factor of the products.
    pub(super) products: f64,
    /// The width of a kernel, whose coordinates are read instead of the readout's; 0 for none.
    pub(super) width: f64,
    /// Relative strength.
    pub(super) strength: f64,
}

impl Choice {
    /// All choices that are tried, those with less freedom last.
    pub(super) fn all() -> Vec<Self> {
        let of = |&products: &f64| STRENGTHS.map(|strength| Self { products, width: 0.0, strength });
        PRODUCTS.iter().rev().flat_map(of).collect()
    }

    /// All choices that are tried with a kernel of this width.
    pub(super) fn of_kernel(width: f64) -> Vec<Self> {
        STRENGTHS.map(|strength| Self { products: 0.0, width, strength }).to_vec()
    }

    /// The choices among `tried` with the products of one of `chosen`, and its strength or the next
    /// weaker or stronger one.
    pub(super) fn near(chosen: &[Self], tried: &[Self]) -> Vec<Self> {
        let place = |of: f64| STRENGTHS.iter().position(|&strength| strength == of).unwrap_or(0);
        let is_near = |choice: &Self| {
            let close = |of: &Self| {
                of.products == choice.products && place(of.strength).abs_diff(place(choice.strength)) <= 1
            };
            chosen.iter().any(close)
        };
        tried.iter().copied().filter(is_near).collect()
    }
}

/// Sums over weighted rows. A head depends on nothing else.
#[derive(Clone)]
pub(super) struct Sums {
    /// Sums of products of pairs of features; the lower triangle.
    products: Array2<f64>,
    /// Sums of features, by classes; one row for quantities.
    features: Array2<f64>,
    /// Weights of the rows, by classes.
    counts: Vec<f64>,
    /// Sums of outputs times features, and of outputs; none for classes.
    truth: Array2<f64>,
    outputs: Vec<f64>,
}

impl Sums {
    /// The sums over `rows`. O(rows features^2).
    pub(super) fn of(features: &Features, target: &Target, instants: &[Instant], rows: &[usize]) -> Self {
        let size = features.values.ncols();
        let (groups, outputs) = match target {
            Target::Quantities(each) => (1, each.len()),
            Target::Classes { names, .. } => (names.len(), 0),
        };
        let mut sums = Self {
            products: Array2::zeros((size, size)),
            features: Array2::zeros((groups, size)),
            counts: vec![0.0; groups],
            truth: Array2::zeros((outputs, size)),
            outputs: vec![0.0; outputs],
        };
        for rows in rows.chunks(PART) {
            let mut part = features.values.select(Axis(0), rows);
            for (&row, mut values) in rows.iter().zip(part.rows_mut()) {
                let Instant { truth, weight, .. } = &instants[row];
                let group = if groups == 1 { 0 } else { truth[0] as usize };
                sums.counts[group] += weight;
                sums.features.row_mut(group).scaled_add(*weight, &values);
                for (output, &truth) in truth.iter().enumerate().take(outputs) {
                    sums.outputs[output] += weight * truth;
                    sums.truth.row_mut(output).scaled_add(weight * truth, &values);
                }
                values *= weight.sqrt();
            }
            add_products(&mut sums.products, part.view());
        }
        sums
    }

    /// The sums over the rows that are not in `part`.
    pub(super) fn without(mut self, part: &Self) -> Self {
        self.products -= &part.products;
        self.features -= &part.features;
        self.truth -= &part.truth;
        self.counts.iter_mut().zip(&part.counts).for_each(|(sum, part)| *sum -= part);
        self.outputs.iter_mut().zip(&part.outputs).for_each(|(sum, part)| *sum -= part);
        self
    }

    /// The heads of these rows for each of `choices`, linear in the features: `linear` coordinates,
    /// then products. `None` where rounding forbids it. O(features^3) each.
    pub(super) fn heads(&self, linear: usize, choices: &[Choice]) -> Vec<Option<Linear>> {
        let mut made: Vec<(f64, Problem)> = Vec::new();
        let mut heads = Vec::new();
        for choice in choices {
            if made.last().is_none_or(|(products, _)| *products != choice.products) {
                made.push((choice.products, Problem::new(self, linear, choice.products)));
            }
            heads.push(made.last().and_then(|(_, problem)| problem.solve(self, choice.strength)));
        }
        heads
    }

    fn count(&self) -> f64 {
        self.counts.iter().sum::<f64>().max(1.0)
    }
}

/// A linear system without its strength.
struct Problem {
    /// Factors of the features; products with a factor of 0 are left out.
    scale: Array1<f64>,
    /// The lower triangle of centred products.
    matrix: Array2<f64>,
    /// Right-hand sides, by outputs.
    right: Array2<f64>,
    /// The mean of the features.
    mean: Array1<f64>,
    /// The mean of each class.
    means: Array2<f64>,
}

impl Problem {
    fn new(sums: &Sums, linear: usize, products: f64) -> Self {
        let size = if products > 0.0 { sums.products.nrows() } else { linear };
        let count = sums.count();
        let scale = Array1::from_shape_fn(size, |i| if i < linear { 1.0 } else { products });
        let within = |of: &Array2<f64>| block(of.view(), 0..of.nrows(), 0..size).to_owned();
        let features = within(&sums.features);
        let mean = features.sum_axis(Axis(0)) / count;
        let mut means = features;
        for (mut of, &count) in means.rows_mut().into_iter().zip(&sums.counts) {
            if count > 0.0 {
                of /= count;
            } else {
                of.assign(&mean);
            }
        }
        let mut matrix = block(sums.products.view(), 0..size, 0..size).to_owned();
        for (of, &count) in means.rows().into_iter().zip(&sums.counts) {
            subtract_square(&mut matrix, of, count);
        }
        for ((i, j), value) in matrix.indexed_iter_mut() {
            *value *= scale[i] * scale[j];
        }
        let mut right = if sums.outputs.is_empty() {
            (&means - &mean) * count
        } else {
            let mut right = within(&sums.truth);
            for (mut of, &sum) in right.rows_mut().into_iter().zip(&sums.outputs) {
                of.scaled_add(-sum, &mean);
            }
            right
        };
        right *= &scale;
        Self { scale, matrix, right, mean, means }
    }

    fn solve(&self, sums: &Sums, strength: f64) -> Option<Linear> {
        let count = sums.count();
        let size = self.matrix.diag().sum() / count;
        let mut weight = self.right.clone();
        Factor::new(self.matrix.clone(), strength * if size > 0.0 { size } else { 1.0 })?.solve(&mut weight);
        weight *= &self.scale;
        let bias = if sums.outputs.is_empty() {
            let of = |(class, weight): (usize, ArrayView1<'_, f64>)| {
                let between = weight.dot(&self.means.row(class)) + weight.dot(&self.mean);
                // A class that these rows lack gets half a row.
                log(sums.counts[class].max(0.5) / count) - between / 2.0
            };
            weight.rows().into_iter().enumerate().map(of).collect()
        } else {
            let outputs = weight.rows().into_iter().zip(&sums.outputs);
            outputs.map(|(weight, sum)| sum / count - weight.dot(&self.mean)).collect()
        };
        Some(Linear { weight, bias })
    }
}

impl Linear {
    /// The outputs for rows of inputs; it may read only the first inputs of a row.
    pub(super) fn of(&self, inputs: ArrayView2<'_, f64>) -> Array2<f64> {
        let read = inputs.split_at(Axis(1), self.weight.ncols()).0;
        read.dot(&self.weight.t()) + ArrayView1::from(&self.bias)
    }
}

/// Subtracts `count` times the products of pairs of values of `of`.
fn subtract_square(from: &mut Array2<f64>, of: ArrayView1<'_, f64>, count: f64) {
    for (i, mut row) in from.rows_mut().into_iter().enumerate() {
        let factor = -count * of[i];
        row.iter_mut().zip(of).take(i + 1).for_each(|(value, x)| *value += factor * x);
    }
}
