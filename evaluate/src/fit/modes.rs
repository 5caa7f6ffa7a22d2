//! The main modes of the coordinates, and their products, which are quadratic in a readout.
//!
//! ```text
//! P = Z V                   V: the eigenvectors of Z^T W Z with the largest eigenvalues, by
//!                           orthogonal iteration, for weights W of the rows
//! Q_ij = c P_i P_j / s      for i <= j;  c is 1 for i = j, else sqrt 2;  s^2 is the mean of P_1^2
//! ```
//!
//! With this c, the products of Q are the squares of those of P / sqrt s, whatever basis V has
//! (Golub and Van Loan 2013, section 7.3.2, for the iteration).

use ndarray::{Array2, ArrayView2, Axis, concatenate};

use meissner_kernels::random::Random;

use super::cholesky::add_products;

/// Maximum number of modes whose products are features.
const MAX_SQUARED: usize = 32;
/// Number of coordinates for each of these modes.
const COORDINATES: usize = 8;
/// Maximum number of modes that a kernel or a perceptron reads.
const MAX_READ: usize = 160;
/// Steps of the iteration.
const STEPS: usize = 40;
const ROWS: usize = 256;
/// Modes with less than this part of the main mode's variance are rounding.
const FAINT: f64 = 1e-6;

/// Coordinates, and the products of their main modes.
pub(super) struct Features {
    /// Rows by coordinates, then products.
    pub(super) values: Array2<f64>,
    /// The number of coordinates.
    pub(super) linear: usize,
    /// Coordinates by modes.
    pub(super) modes: Array2<f64>,
    /// Number of modes with products.
    pub(super) squared: usize,
    /// The s of the products.
    pub(super) size: f64,
}

impl Features {
    /// The features of `coordinates`, whose rows count by `weights`. O(rows coordinates^2).
    pub(super) fn new(coordinates: Array2<f64>, weights: &[f64], seed: u64) -> Self {
        let linear = coordinates.ncols();
        let squared = MAX_SQUARED.min(linear / COORDINATES);
        let modes = main_modes((&coordinates, weights), MAX_READ.min(linear), seed);
        let of_modes = coordinates.dot(&modes);
        let squares = of_modes.rows().into_iter().zip(weights);
        let first: f64 = squares.filter_map(|(row, weight)| Some(weight * row.first()?.powi(2))).sum();
        let size = (first / weights.iter().sum::<f64>()).sqrt();
        let size = if size > 0.0 { size } else { 1.0 };
        let pairs = pairs(squared);
        let mut products = Array2::zeros((coordinates.nrows(), pairs.len()));
        for (row, mut to) in of_modes.rows().into_iter().zip(products.rows_mut()) {
            to.iter_mut().zip(&pairs).for_each(|(to, &[i, j])| *to = factor(i, j) * row[i] * row[j] / size);
        }
        let values = concatenate(Axis(1), &[coordinates.view(), products.view()]).expect("as many rows");
        Self { values, linear, modes, squared, size }
    }

    /// Only `coordinates` as features, without products.
    pub(super) fn linear(coordinates: Array2<f64>) -> Self {
        let (linear, modes) = (coordinates.ncols(), Array2::zeros((coordinates.ncols(), 0)));
        Self { values: coordinates, linear, modes, squared: 0, size: 1.0 }
    }

    /// The values of the modes at all rows.
    pub(super) fn of_modes(&self) -> Array2<f64> {
        let coordinates = self.values.view().split_at(Axis(1), self.linear).0;
        coordinates.dot(&self.modes)
    }
}

/// The indices of the modes of each product.
pub(super) fn pairs(modes: usize) -> Vec<[usize; 2]> {
    (0..modes).flat_map(|i| (i..modes).map(move |j| [i, j])).collect()
}

/// The c of a product.
pub(super) fn factor(i: usize, j: usize) -> f64 {
    if i == j { 1.0 } else { std::f64::consts::SQRT_2 }
}

fn main_modes((coordinates, weights): (&Array2<f64>, &[f64]), count: usize, seed: u64) -> Array2<f64> {
    let size = coordinates.ncols();
    let mut products = Array2::zeros((size, size));
    for (part, weights) in coordinates.axis_chunks_iter(Axis(0), ROWS).zip(weights.chunks(ROWS)) {
        let mut part = part.to_owned();
        part.rows_mut().into_iter().zip(weights).for_each(|(mut row, weight)| row *= weight.sqrt());
        add_products(&mut products, part.view());
    }
    for i in 0..size {
        for j in i + 1..size {
            products[[i, j]] = products[[j, i]];
        }
    }
    let mut random = Random::new(seed);
    let mut modes = Array2::from_shape_fn((size, count), |_| f64::from(random.symmetric()));
    for _ in 0..STEPS {
        modes = orthonormal(products.dot(&modes).view());
    }
    modes
}

/// The columns of `of`, each made orthogonal to those before it, twice because of rounding (Giraud,
/// Langou, Rozloznik and van den Eshof 2005). Columns that are left with less than [`FAINT`] of the
/// first one's length become 0.
fn orthonormal(of: ArrayView2<'_, f64>) -> Array2<f64> {
    // As rows, so that products are of matrices in order.
    let (mut found, mut longest): (Array2<f64>, f64) = (Array2::zeros([of.ncols(), of.nrows()]), 0.0);
    for (i, column) in of.columns().into_iter().enumerate() {
        let (before, _) = found.view().split_at(Axis(0), i);
        let mut own = column.to_owned().insert_axis(Axis(0));
        for _ in 0..2 {
            own -= &own.dot(&before.t()).dot(&before);
        }
        let own = own.remove_axis(Axis(0));
        let length = own.dot(&own).sqrt();
        longest = longest.max(length);
        if length > FAINT * longest {
            found.row_mut(i).assign(&(own / length));
        }
    }
    found.reversed_axes()
}
