//! Readouts as a linear problem: `(X^T X + strength) w = b` for centred and scaled readouts X.
//!
//! A channel has one scale, the standard deviation of its values, so that cells that rarely have
//! events stay small. With fewer rows than columns the system of the rows is solved instead
//! (Woodbury's identity):
//!
//! ```text
//! (X^T X + s)^-1 b = (b - X^T (X X^T + s)^-1 X b) / s
//! ```

use ndarray::{Array2, ArrayView1, Axis, concatenate};

use super::cholesky::{Factor, add_products, block, block_mut};

/// Rows or columns that are converted together.
const PART: usize = 256;

/// Readouts of all samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Design<'a> {
    pub(super) values: &'a [f32],
    pub(super) columns: usize,
    pub(super) channels: usize,
}

/// Values that are linear in a readout.
#[derive(Clone, Debug)]
pub(super) struct Linear {
    /// Outputs by columns.
    pub(super) weight: Array2<f64>,
    pub(super) bias: Vec<f64>,
}

/// The system of some rows of a design.
pub(super) struct System<'a> {
    design: Design<'a>,
    rows: &'a [usize],
    /// The group of each row, whose mean it is centred by.
    group: &'a [usize],
    /// The mean of each group, by columns.
    pub(super) means: Array2<f64>,
    /// The mean of all rows.
    pub(super) mean: Vec<f64>,
    /// What the difference of a column is multiplied by.
    pub(super) scale: Vec<f64>,
    /// Products of pairs of columns, or of pairs of rows.
    products: Array2<f64>,
    by_columns: bool,
}

impl<'a> Design<'a> {
    fn row(&self, row: usize) -> &'a [f32] {
        &self.values[row * self.columns..(row + 1) * self.columns]
    }

    /// The system of `rows`, each centred by the mean of its `group`, of which there are `groups`.
    /// O(rows columns min(rows, columns)).
    pub(super) fn system(self, rows: &'a [usize], group: &'a [usize], groups: usize) -> System<'a> {
        let (mut sums, mut counts) = (Array2::<f64>::zeros((groups, self.columns)), vec![0.0; groups]);
        for (&row, &group) in rows.iter().zip(group) {
            counts[group] += 1.0;
            sums.row_mut(group).iter_mut().zip(self.row(row)).for_each(|(sum, &x)| *sum += f64::from(x));
        }
        let count = rows.len().max(1) as f64;
        let mean: Vec<f64> = sums.sum_axis(Axis(0)).iter().map(|sum| sum / count).collect();
        for (mut sums, &count) in sums.rows_mut().into_iter().zip(&counts) {
            if count > 0.0 {
                sums /= count;
            } else {
                sums.iter_mut().zip(&mean).for_each(|(of, &mean)| *of = mean);
            }
        }
        let mut squares = vec![0.0; self.channels];
        for &row in rows {
            for (column, (&x, mean)) in self.row(row).iter().zip(&mean).enumerate() {
                squares[column % self.channels] += (f64::from(x) - mean) * (f64::from(x) - mean);
            }
        }
        let values = count * (self.columns / self.channels) as f64;
        let of_channel: Vec<f64> =
            squares.iter().map(|&square| if square > 0.0 { (values / square).sqrt() } else { 1.0 }).collect();
        let scale = (0..self.columns).map(|column| of_channel[column % self.channels]).collect();
        let by_columns = self.columns <= rows.len();
        let size = if by_columns { self.columns } else { rows.len() };
        let products = Array2::zeros((size, size));
        let mut system = System { design: self, rows, group, means: sums, mean, scale, products, by_columns };
        system.multiply();
        system
    }

    /// What each of `heads` gives for `rows`, by outputs.
    pub(super) fn predict(&self, heads: &[&Linear], rows: &[usize]) -> Vec<Array2<f64>> {
        let weights: Vec<_> = heads.iter().map(|head| head.weight.view()).collect();
        if weights.is_empty() {
            return Vec::new();
        }
        let weights = concatenate(Axis(0), &weights).expect("all have the columns of the design");
        let mut all = Array2::zeros((rows.len(), weights.nrows()));
        for (part, mut out) in rows.chunks(PART).zip(all.axis_chunks_iter_mut(Axis(0), PART)) {
            let mut x = Array2::zeros((part.len(), self.columns));
            for (&row, mut to) in part.iter().zip(x.rows_mut()) {
                to.iter_mut().zip(self.row(row)).for_each(|(to, &x)| *to = f64::from(x));
            }
            out.assign(&x.dot(&weights.t()));
        }
        let mut from = 0;
        let of_head = |head: &&Linear| {
            let to = from + head.bias.len();
            let found = &block(all.view(), 0..rows.len(), from..to) + &ArrayView1::from(&head.bias);
            from = to;
            found
        };
        heads.iter().map(of_head).collect()
    }
}

impl System<'_> {
    /// Columns `from` to below `to` of the rows in `part`, centred and scaled.
    fn part(&self, part: std::ops::Range<usize>, [from, to]: [usize; 2]) -> Array2<f64> {
        let mut x = Array2::zeros((part.len(), to - from));
        for (i, mut row) in part.zip(x.rows_mut()) {
            let values = &self.design.row(self.rows[i])[from..to];
            let means = self.means.row(self.group[i]);
            let means = means.iter().skip(from);
            for (((x, &value), mean), scale) in
                row.iter_mut().zip(values).zip(means).zip(&self.scale[from..to])
            {
                *x = (f64::from(value) - mean) * scale;
            }
        }
        x
    }

    fn multiply(&mut self) {
        let (rows, columns) = (self.rows.len(), self.design.columns);
        let mut products = std::mem::take(&mut self.products);
        if self.by_columns {
            for from in (0..rows).step_by(PART) {
                let part = self.part(from..rows.min(from + PART), [0, columns]);
                add_products(&mut products, part.view());
            }
        } else {
            for from in (0..columns).step_by(PART) {
                let part = self.part(0..rows, [from, columns.min(from + PART)]);
                add_products(&mut products, part.t());
            }
        }
        self.products = products;
    }

    /// The mean square of the directions that the rows have.
    pub(super) fn size(&self) -> f64 {
        self.products.diag().sum() / self.products.nrows().max(1) as f64
    }

    /// `X^T y` for each column y of `of`, a row each.
    pub(super) fn transposed(&self, of: &Array2<f64>) -> Array2<f64> {
        let (rows, columns) = (self.rows.len(), self.design.columns);
        let mut found = Array2::zeros((of.ncols(), columns));
        for from in (0..rows).step_by(PART) {
            let to = rows.min(from + PART);
            let part = block(of.view(), from..to, 0..of.ncols());
            found += &part.t().dot(&self.part(from..to, [0, columns]));
        }
        found
    }

    /// The w of each row b of `of`, for each of `strengths`; `None` where rounding has made the
    /// matrix indefinite.
    pub(super) fn solve(&self, of: &Array2<f64>, strengths: &[f64]) -> Vec<Option<Array2<f64>>> {
        let (rows, columns) = (self.rows.len(), self.design.columns);
        // Of each row b, X b.
        let mut seen = Array2::zeros((of.nrows(), if self.by_columns { 0 } else { rows }));
        if !self.by_columns {
            for from in (0..rows).step_by(PART) {
                let to = rows.min(from + PART);
                let part = of.dot(&self.part(from..to, [0, columns]).t());
                block_mut(seen.view_mut(), 0..of.nrows(), from..to).assign(&part);
            }
        }
        let solve = |&strength: &f64| {
            let mut found = if self.by_columns { of.clone() } else { seen.clone() };
            Factor::new(self.products.clone(), strength)?.solve(&mut found);
            Some(found)
        };
        let found: Vec<Option<Array2<f64>>> = strengths.iter().map(solve).collect();
        let views: Vec<_> = found.iter().flatten().map(|found| found.view()).collect();
        if self.by_columns || views.is_empty() {
            return found;
        }
        let all = concatenate(Axis(0), &views).expect("all have the rows of the system");
        let all = self.transposed(&all.reversed_axes());
        let mut from = 0;
        let of_strength = |(found, strength): (Option<Array2<f64>>, &f64)| {
            let to = from + found?.nrows();
            let seen = block(all.view(), from..to, 0..columns);
            from = to;
            Some((of - &seen) / *strength)
        };
        found.into_iter().zip(strengths).map(of_strength).collect()
    }
}
