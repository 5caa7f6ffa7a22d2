//! A Gaussian kernel of the main modes, for functions that are neither linear nor quadratic in a
//! readout.
//!
//! ```text
//! k(x, c) = exp(-g |x - c|^2),   g = 1 / (2 w s^2)      s^2: the mean of |x - mean|^2
//! L L^T = K,  the kernel between the centres c,         z = L^-1 (k(x, c1), k(x, c2), ..)
//! ```
//!
//! A linear fit to z with a penalty on its weights is kernel ridge regression, or the kernel's
//! discriminant, on the centres (Williams and Seeger 2001, "Using the Nystroem method to speed up
//! kernel machines").

use libm::exp;
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};
use rayon::prelude::*;

use super::basis::landmarks;
use super::cholesky::Factor;

/// Values of w that are tried.
pub(super) const WIDTHS: [f64; 4] = [0.25, 0.5, 1.0, 2.0];
/// Maximum number of centres: each is a unit of a dense layer.
const MAX_CENTRES: usize = 1024;
/// Added to the diagonal, because presses may be alike.
const JITTER: f64 = 1e-6;
/// Rows that are converted together.
const PART: usize = 256;

/// Coordinates in the span of kernels around some rows.
pub(super) struct Kernel {
    /// The g above.
    pub(super) narrowness: f64,
    /// Centres by modes.
    pub(super) centres: Array2<f64>,
    factor: Factor,
}

impl Kernel {
    /// A kernel for rows of `modes` that count by `weights`, and the coordinates of the rows. With
    /// more rows than centres, `seed` draws these. `None` if all rows are alike. O(rows centres
    /// (centres + modes)).
    pub(super) fn new(
        (modes, weights): (&Array2<f64>, &[f64]),
        width: f64,
        seed: u64,
    ) -> Option<(Self, Array2<f64>)> {
        let drawn = landmarks(weights, MAX_CENTRES, seed);
        let weights = ArrayView1::from(weights);
        let mean: Array1<f64> = weights.dot(modes) / weights.sum();
        let squares = modes.rows().into_iter().map(|row| (&row - &mean).mapv(|x| x * x).sum());
        let spread =
            squares.zip(weights).map(|(square, weight)| square * weight).sum::<f64>() / weights.sum();
        if spread <= 0.0 {
            return None;
        }
        let (narrowness, centres) = (1.0 / (2.0 * width * spread), modes.select(Axis(0), &drawn));
        let mut found = Array2::zeros((modes.nrows(), drawn.len()));
        let rows = modes.axis_chunks_iter(Axis(0), PART);
        let parts: Vec<_> = rows.zip(found.axis_chunks_iter_mut(Axis(0), PART)).collect();
        parts.into_par_iter().for_each(|(rows, mut to)| to.assign(&values(rows, centres.view(), narrowness)));
        let factor = Factor::new(found.select(Axis(0), &drawn), JITTER)?;
        factor.forward(&mut found);
        Some((Self { narrowness, centres, factor }, found))
    }

    /// The linear function `of` the coordinates (outputs by coordinates), as weights of the
    /// kernels: outputs by centres.
    pub(super) fn of_kernels(&self, of: ArrayView2<'_, f64>) -> Array2<f64> {
        let mut of = of.to_owned();
        self.factor.backward(&mut of);
        of
    }
}

/// The kernel between `rows` and `centres`.
fn values(rows: ArrayView2<'_, f64>, centres: ArrayView2<'_, f64>, narrowness: f64) -> Array2<f64> {
    let square = |row: ArrayView1<'_, f64>| row.dot(&row);
    let of_centres: Vec<f64> = centres.rows().into_iter().map(square).collect();
    let mut found = rows.dot(&centres.t());
    for (mut found, row) in found.rows_mut().into_iter().zip(rows.rows()) {
        let own = square(row);
        for (value, centre) in found.iter_mut().zip(&of_centres) {
            *value = exp(-narrowness * (own + centre - 2.0 * *value).max(0.0));
        }
    }
    found
}
