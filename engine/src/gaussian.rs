//! How far features lie from those of a training.
//!
//! Input: rows of features of a training. Output: the Mahalanobis distance of other rows from them
//! (Lee et al. 2018, "A simple unified framework for detecting out-of-distribution samples", eq. 2,
//! of one class), relative to a threshold. Besides the four operations, only square roots are used,
//! which every machine rounds in the same way; every sum has a fixed order.

/// Maximum number of features of a row.
pub(crate) const MAX_FEATURES: usize = 64;

/// The part of a training's rows that are more unlike than 1.
const BEYOND: f64 = 0.001;

/// The threshold is at least the square root of the number of features plus this: the distance that
/// 1 of 1,000 rows exceeds if nine features are normal (the quantile of chi squared), and a little
/// more for more features. A few rows lie closer by chance.
const NORMAL: f64 = 2.279;

/// Smaller differences of a feature have no meaning, however similar the rows of a training are.
const RESOLUTION: f64 = 0.005;

/// Mean and covariance of features.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Gaussian {
    mean: Vec<f64>,
    /// The Cholesky factor of the covariance times the square of the threshold: row i has the
    /// columns 0 to i.
    factor: Vec<Vec<f64>>,
    /// The inverse of the factor, column after column from its diagonal on.
    inverse: Vec<f64>,
}

impl Gaussian {
    /// The Gaussian of these rows of `features` features each; `None` for too few rows: they do not
    /// show how the features vary together. O(rows log rows).
    pub(crate) fn of<R: AsRef<[f64]>>(features: usize, rows: &[R]) -> Option<Self> {
        if rows.len() < 2 * (features + 1) {
            return None;
        }
        let count = rows.len() as f64;
        let value = |row: &R, i: usize| row.as_ref()[i];
        let mean: Vec<f64> =
            (0..features).map(|i| rows.iter().map(|row| value(row, i)).sum::<f64>() / count).collect();
        let covariance = |i: usize, j: usize| {
            let products = rows.iter().map(|row| (value(row, i) - mean[i]) * (value(row, j) - mean[j]));
            let own = if i == j { RESOLUTION * RESOLUTION } else { 0.0 };
            products.sum::<f64>() / (count - 1.0) + own
        };
        let mut factor: Vec<Vec<f64>> = Vec::with_capacity(features);
        for i in 0..features {
            let mut row: Vec<f64> = Vec::with_capacity(i + 1);
            let done = |row: &[f64], above: &[f64]| row.iter().zip(above).map(|(a, b)| a * b).sum::<f64>();
            for (j, above) in factor.iter().enumerate() {
                row.push((covariance(i, j) - done(&row, above)) / above[j]);
            }
            row.push((covariance(i, i) - done(&row, &row)).sqrt());
            factor.push(row);
        }
        let unscaled = Self::from_parts(&mean, factor)?;
        let mut distances: Vec<f64> =
            rows.iter().map(|row| unscaled.distance(|i| Some(value(row, i))).into()).collect();
        distances.sort_unstable_by(f64::total_cmp);
        let normal = (features as f64).sqrt() + NORMAL;
        let threshold = distances[((1.0 - BEYOND) * (count - 1.0)).round() as usize].max(normal);
        let mut factor = unscaled.factor;
        factor.iter_mut().flatten().for_each(|value| *value *= threshold);
        Self::from_parts(&mean, factor)
    }

    /// Mean features, and the rows of the factor of their covariance: row i has i + 1 values.
    pub(crate) fn parts(&self) -> (&[f64], &[Vec<f64>]) {
        (&self.mean, &self.factor)
    }

    /// The Gaussian with these [parts](Self::parts). `None` for numbers of values that do not fit,
    /// more than [`MAX_FEATURES`], values that are not finite, or a factor whose diagonal is not
    /// positive.
    pub(crate) fn from_parts(mean: &[f64], factor: Vec<Vec<f64>>) -> Option<Self> {
        let is_factor = (1..=MAX_FEATURES).contains(&mean.len())
            && factor.len() == mean.len()
            && factor.iter().enumerate().all(|(i, row)| row.len() == i + 1 && row[i] > 0.0);
        let is_finite = factor.iter().flatten().chain(mean).all(|value| value.is_finite());
        if !(is_factor && is_finite) {
            return None;
        }
        let mut inverse = Vec::with_capacity(mean.len() * (mean.len() + 1) / 2);
        for (j, diagonal) in factor.iter().enumerate() {
            let start = inverse.len();
            inverse.push(1.0 / diagonal[j]);
            for row in &factor[j + 1..] {
                let done: f64 = row[j..].iter().zip(&inverse[start..]).map(|(a, b)| a * b).sum();
                inverse.push(-done / row[row.len() - 1]);
            }
        }
        Some(Self { mean: mean.to_vec(), factor, inverse })
    }

    /// Number of features.
    pub(crate) fn features(&self) -> usize {
        self.mean.len()
    }

    /// The distance of a row. Features that are `None` do not count. Above 1: farther than 999 of
    /// 1,000 rows of the training. O(features^2).
    pub(crate) fn distance(&self, feature: impl Fn(usize) -> Option<f64>) -> f32 {
        let mut solved = [0.0; MAX_FEATURES];
        let solved = &mut solved[..self.mean.len()];
        let mut rest = &self.inverse[..];
        for (j, mean) in self.mean.iter().enumerate() {
            let (column, others) = rest.split_at(solved.len() - j);
            rest = others;
            let difference = feature(j).map_or(0.0, |feature| feature - mean);
            solved[j..].iter_mut().zip(column).for_each(|(sum, value)| *sum += value * difference);
        }
        let squares: f64 = solved.iter().map(|value| value * value).sum();
        // Given parts may overflow; for NaN, the minimum is `f32::MAX` as well.
        (squares.sqrt() as f32).min(f32::MAX)
    }
}
