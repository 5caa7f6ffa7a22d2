//! Symmetric positive definite systems, by Cholesky's method in blocks.
//!
//! The order of every sum depends on the size alone: a tile of the matrix is computed by one
//! thread, so that their number changes no bit.
//!
//! ```text
//! A = L L^T:  L11 = chol(A11),  L21 = A21 L11^-T,  A22 <- A22 - L21 L21^T
//! ```
//! (Golub and Van Loan 2013, "Matrix computations", 4th edition, section 4.2.6)

use std::ops::Range;

use ndarray::linalg::general_mat_mul;
use ndarray::{Array2, ArrayView1, ArrayView2, ArrayViewMut2, Axis};
use rayon::prelude::*;

/// Rows of a tile.
const TILE: usize = 32;

/// The lower triangle of a factor.
#[derive(Clone, Debug)]
pub(crate) struct Factor(Array2<f64>);

/// The part of a matrix with these rows and columns.
pub(crate) fn block(
    mut of: ArrayView2<'_, f64>,
    rows: Range<usize>,
    columns: Range<usize>,
) -> ArrayView2<'_, f64> {
    of.slice_axis_inplace(Axis(0), rows.into());
    of.slice_axis_inplace(Axis(1), columns.into());
    of
}

/// [`block`], mutable.
pub(super) fn block_mut(
    mut of: ArrayViewMut2<'_, f64>,
    rows: Range<usize>,
    columns: Range<usize>,
) -> ArrayViewMut2<'_, f64> {
    of.slice_axis_inplace(Axis(0), rows.into());
    of.slice_axis_inplace(Axis(1), columns.into());
    of
}

/// Adds the products of all pairs of columns of `part` to the lower triangle of `sums`.
pub(crate) fn add_products(sums: &mut Array2<f64>, part: ArrayView2<'_, f64>) {
    let height = part.nrows();
    tiles(sums.view_mut(), |rows, tile| {
        let (left, right) = (block(part, 0..height, rows.clone()), block(part, 0..height, 0..rows.end));
        let mut lower = block_mut(tile, 0..rows.len(), 0..rows.end);
        general_mat_mul(1.0, &left.t(), &right, 1.0, &mut lower);
    });
}

/// Calls `work` for each tile of rows, with the range of these rows.
fn tiles(mut of: ArrayViewMut2<'_, f64>, work: impl Fn(Range<usize>, ArrayViewMut2<'_, f64>) + Sync) {
    let tiles: Vec<_> = of.axis_chunks_iter_mut(Axis(0), TILE).enumerate().collect();
    tiles.into_par_iter().for_each(|(i, tile)| work(i * TILE..i * TILE + tile.nrows(), tile));
}

impl Factor {
    /// The factor of the matrix with the lower triangle of `of` plus `shift` on its diagonal;
    /// `None` if that is not positive definite. O(size^3).
    pub(crate) fn new(mut of: Array2<f64>, shift: f64) -> Option<Self> {
        of.diag_mut().iter_mut().for_each(|value| *value += shift);
        let size = of.nrows();
        for begin in (0..size).step_by(TILE) {
            let end = size.min(begin + TILE);
            let (above, mut below) = of.view_mut().split_at(Axis(0), end);
            let mut corner = block_mut(above, begin..end, begin..end);
            factorise(&mut corner)?;
            let rest = size - end;
            tiles(block_mut(below.view_mut(), 0..rest, begin..end), |_, mut rows| {
                for mut row in rows.rows_mut() {
                    for j in 0..row.len() {
                        let known = along(row.view(), corner.row(j), j);
                        row[j] = (row[j] - known) / corner[[j, j]];
                    }
                }
            });
            let panel = block(below.view(), 0..rest, begin..end).to_owned();
            let width = end - begin;
            tiles(block_mut(below, 0..rest, end..size), |rows, tile| {
                let mut lower = block_mut(tile, 0..rows.len(), 0..rows.end);
                let (left, right) =
                    (block(panel.view(), rows.clone(), 0..width), block(panel.view(), 0..rows.end, 0..width));
                general_mat_mul(-1.0, &left, &right.t(), 1.0, &mut lower);
            });
        }
        Some(Self(of))
    }

    /// Replaces each row b of `of` by the x with A x = b. O(size^2) a row.
    pub(crate) fn solve(&self, of: &mut Array2<f64>) {
        self.forward(of);
        self.backward(of);
    }

    /// Replaces each row b of `of` by the x with L x = b.
    pub(super) fn forward(&self, of: &mut Array2<f64>) {
        let lower = &self.0;
        let rows: Vec<_> = of.axis_iter_mut(Axis(0)).collect();
        rows.into_par_iter().for_each(|mut x| {
            for i in 0..x.len() {
                let known = along(x.view(), lower.row(i), i);
                x[i] = (x[i] - known) / lower[[i, i]];
            }
        });
    }

    /// Replaces each row b of `of` by the x with L^T x = b.
    pub(super) fn backward(&self, of: &mut Array2<f64>) {
        let lower = &self.0;
        let rows: Vec<_> = of.axis_iter_mut(Axis(0)).collect();
        rows.into_par_iter().for_each(|mut x| {
            for i in (0..x.len()).rev() {
                x[i] /= lower[[i, i]];
                let solved = x[i];
                x.iter_mut().zip(lower.row(i)).take(i).for_each(|(x, l)| *x -= solved * l);
            }
        });
    }
}

/// The factor of a tile on the diagonal.
fn factorise(corner: &mut ArrayViewMut2<'_, f64>) -> Option<()> {
    for j in 0..corner.nrows() {
        let row = corner.row(j).to_owned();
        let square = corner[[j, j]] - along(row.view(), row.view(), j);
        if square <= 0.0 || !square.is_finite() {
            return None;
        }
        let diagonal = square.sqrt();
        corner[[j, j]] = diagonal;
        for i in j + 1..corner.nrows() {
            let known = along(corner.row(i), row.view(), j);
            corner[[i, j]] = (corner[[i, j]] - known) / diagonal;
        }
    }
    Some(())
}

/// The sum of the products of the first `count` values of `a` and `b`.
fn along(mut a: ArrayView1<'_, f64>, mut b: ArrayView1<'_, f64>, count: usize) -> f64 {
    a.slice_axis_inplace(Axis(0), (0..count).into());
    b.slice_axis_inplace(Axis(0), (0..count).into());
    a.dot(&b)
}
