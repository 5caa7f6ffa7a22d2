//! Figures of merit for predictions: of classes, over several trainings, and their uncertainty.
//!
//! Figures are fractions of integers, in a fixed order: equal on every machine.

use libm::{atan, log, sqrt};
pub use meissner_run::answer::largest;
use serde::ser::{Serialize, Serializer};

/// The index of the largest of the `values` of a prediction of an engine.
pub(crate) fn predicted(values: &[f32]) -> usize {
    largest(values).expect("an engine refuses predictions that are not numbers")
}

/// Counts of predictions: rows are true classes, columns are predicted classes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Confusion {
    classes: usize,
    /// Row-major.
    counts: Vec<u64>,
}

impl Confusion {
    /// A matrix for `classes` classes without counts. It takes 8 `classes`^2 bytes.
    ///
    /// # Panics
    /// Where memory does not suffice.
    pub fn new(classes: usize) -> Self {
        Self { classes, counts: vec![0; classes * classes] }
    }

    /// Counts a prediction.
    ///
    /// # Panics
    /// Where one of the two is not a class.
    pub fn add(&mut self, truth: usize, predicted: usize) {
        self.add_many(truth, predicted, 1);
    }

    /// Counts `count` equal predictions.
    ///
    /// # Panics
    /// As [`Self::add`].
    pub fn add_many(&mut self, truth: usize, predicted: usize, count: u64) {
        let index = self.index(truth, predicted);
        self.counts[index] += count;
    }

    fn index(&self, truth: usize, predicted: usize) -> usize {
        let classes = self.classes;
        assert!(truth < classes && predicted < classes, "{truth}, {predicted}: of {classes}");
        truth * classes + predicted
    }

    fn merge(&mut self, other: &Self) {
        assert_eq!(self.classes, other.classes, "classes of both");
        self.counts.iter_mut().zip(&other.counts).for_each(|(count, more)| *count += more);
    }

    /// The sum of `all`, which have the same classes; `None` for none.
    pub(crate) fn sum<'a>(all: impl IntoIterator<Item = &'a Self>) -> Option<Self> {
        let mut all = all.into_iter();
        let mut sum = all.next()?.clone();
        all.for_each(|other| sum.merge(other));
        Some(sum)
    }

    /// How often `predicted` was predicted for `truth`.
    pub(crate) fn count(&self, truth: usize, predicted: usize) -> u64 {
        self.counts[self.index(truth, predicted)]
    }

    /// The counts of each true class.
    pub fn rows(&self) -> impl Iterator<Item = &[u64]> {
        // Chunks of length 0 panic; without classes there are no rows.
        self.counts.chunks_exact(self.classes.max(1))
    }

    fn truths(&self, class: usize) -> u64 {
        (0..self.classes).map(|predicted| self.count(class, predicted)).sum()
    }

    fn predictions(&self, class: usize) -> u64 {
        (0..self.classes).map(|truth| self.count(truth, class)).sum()
    }

    /// How often the prediction was right.
    pub fn hits(&self) -> u64 {
        (0..self.classes).map(|class| self.count(class, class)).sum()
    }

    /// Number of predictions.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }
}

impl Serialize for Confusion {
    /// A list of rows.
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_seq(self.rows())
    }
}

/// Accuracy, and precision, recall and F1 as means over the classes, each from 0 to 1.
///
/// ```text
/// precision = TP / (TP + FP)    recall = TP / (TP + FN)    F1 = 2 TP / (2 TP + FP + FN)
/// ```
///
/// for each class. The means are over the classes that are true or predicted at least once. A class
/// that is never predicted has precision 0, and one that is never true has recall 0; both have F1
/// 0.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Scores<T = f64> {
    pub accuracy: T,
    pub precision: T,
    pub recall: T,
    pub f1: T,
}

impl Scores<MeanStd> {
    /// Mean and deviation of the scores of `each` training; `None` for no trainings.
    pub fn mean(each: &[Scores]) -> Option<Self> {
        Some(Self {
            accuracy: MeanStd::over(each, |scores| scores.accuracy)?,
            precision: MeanStd::over(each, |scores| scores.precision)?,
            recall: MeanStd::over(each, |scores| scores.recall)?,
            f1: MeanStd::over(each, |scores| scores.f1)?,
        })
    }
}

impl Scores {
    /// The scores of `confusion`; `None` where it has no counts. O(classes^2).
    pub fn of(confusion: &Confusion) -> Option<Self> {
        let total = confusion.total();
        if total == 0 {
            return None;
        }
        let (mut present, mut precision, mut recall, mut f1) = (0_u64, 0.0, 0.0, 0.0);
        for class in 0..confusion.classes {
            let (truths, predictions) = (confusion.truths(class), confusion.predictions(class));
            if truths + predictions == 0 {
                continue;
            }
            let hits = confusion.count(class, class);
            present += 1;
            precision += share(hits, predictions);
            recall += share(hits, truths);
            f1 += share(2 * hits, truths + predictions);
        }
        let mean = |sum: f64| sum / present as f64;
        Some(Self {
            accuracy: share(confusion.hits(), total),
            precision: mean(precision),
            recall: mean(recall),
            f1: mean(f1),
        })
    }
}

/// `part` of `whole`; 0 where `whole` is 0.
fn share(part: u64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

/// Mean and standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct MeanStd {
    pub mean: f64,
    /// Sample standard deviation, with n - 1 in the denominator; `None` for a single value.
    pub std: Option<f64>,
}

impl MeanStd {
    /// Mean and standard deviation of `values`, in two passes in their order; `None` for no values.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len();
        if count == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / count as f64;
        let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
        Some(Self { mean, std: (count > 1).then(|| (squares / (count - 1) as f64).sqrt()) })
    }

    /// [`Self::of`] a `figure` of each of `items`.
    pub fn over<I>(items: &[I], figure: impl Fn(&I) -> f64) -> Option<Self> {
        Self::of(&items.iter().map(figure).collect::<Vec<_>>())
    }
}

/// The means of the lower and of the upper bounds of `intervals`; `None` for no intervals.
pub(crate) fn mean_interval(intervals: &[(f64, f64)]) -> Option<(f64, f64)> {
    let mean = |bound: fn(&(f64, f64)) -> f64| MeanStd::over(intervals, bound).map(|bounds| bounds.mean);
    mean(|interval| interval.0).zip(mean(|interval| interval.1))
}

/// 97.5 % quantile of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// The 95 % confidence interval of a probability after `hits` in `trials`; `None` without trials.
///
/// The score interval (Wilson 1927): all p whose distance from the share h of n trials is at most z
/// standard errors of p,
///
/// ```text
/// |h - p| <= z sqrt(p (1 - p) / n)
/// p = (h + z^2 / 2n +- z sqrt(h (1 - h) / n + z^2 / 4n^2)) / (1 + z^2 / n)
/// ```
///
/// It holds for independent trials. For windows of one recording it is too narrow.
///
/// # Panics
/// Where there are more hits than trials.
pub fn wilson_95(hits: u64, trials: u64) -> Option<(f64, f64)> {
    assert!(hits <= trials, "{hits} hits of {trials}");
    if trials == 0 {
        return None;
    }
    let (n, share) = (trials as f64, hits as f64 / trials as f64);
    let square = Z * Z / n;
    let centre = share + square / 2.0;
    let reach = Z * (share * (1.0 - share) / n + square / (4.0 * n)).sqrt();
    // At the ends the roots are 0 and 1, which rounding would miss.
    let low = if hits == 0 { 0.0 } else { (centre - reach) / (1.0 + square) };
    let high = if hits == trials { 1.0 } else { (centre + reach) / (1.0 + square) };
    Some((low, high))
}

/// Sum and number of the figures of a cluster.
pub(crate) type Cluster = (f64, u64);

/// The 95 % interval of the mean of `clusters`; `None` for fewer than two with figures.
///
/// With sums s and sizes n of c clusters, the mean is a ratio (Cochran 1977, "Sampling techniques",
/// 3rd edition, section 2.11), and Student's t for c - 1 degrees of freedom (Student 1908, "The
/// probable error of a mean") is its quantile:
///
/// ```text
/// r = sum s / sum n     v = c / (c - 1) sum (s - r n)^2 / (sum n)^2     r +- t sqrt(v)
/// ```
///
/// For clusters of one size it is the interval of the mean of their means. O(clusters).
pub(crate) fn clustered_95(clusters: &[Cluster]) -> Option<(f64, f64)> {
    let filled: Vec<(f64, f64)> =
        clusters.iter().filter(|(_, size)| *size > 0).map(|&(sum, size)| (sum, size as f64)).collect();
    let freedom = filled.len().checked_sub(1).filter(|&freedom| freedom > 0)?;
    let (sum, size) = filled.iter().fold((0.0, 0.0), |(sum, size), one| (sum + one.0, size + one.1));
    let mean = sum / size;
    let squares: f64 = filled.iter().map(|(sum, size)| (sum - mean * size) * (sum - mean * size)).sum();
    let reach = student_95(freedom) * (filled.len() as f64 / freedom as f64 * squares).sqrt() / size;
    Some((mean - reach, mean + reach))
}

/// The t that Student's distribution with `freedom` degrees of freedom, at least 1, exceeds in
/// absolute value with a probability of 5 %. Bisection; O(freedom).
fn student_95(freedom: usize) -> f64 {
    // The t of an infinite number of degrees, and of one degree, with some margin.
    let (mut low, mut high) = (1.959, 12.707);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if within(middle, freedom) < 0.95 {
            low = middle;
        } else {
            high = middle;
        }
    }
    f64::midpoint(low, high)
}

/// The probability of Student's distribution within `t` (Abramowitz, Stegun 1964, 26.7.3 and 4).
fn within(t: f64, freedom: usize) -> f64 {
    let n = freedom as f64;
    let (sine, square) = (t / (n + t * t).sqrt(), n / (n + t * t));
    let is_odd = freedom % 2 == 1;
    // Each term is the one before it times (k - 1) / k times the square of the cosine.
    let (first, rest) = if is_odd { (square.sqrt(), 3) } else { (1.0, 2) };
    let ratios = (rest..freedom).step_by(2).map(|k| (k - 1) as f64 / k as f64 * square);
    let terms = ratios.scan(first, |term, ratio| {
        *term *= ratio;
        Some(*term)
    });
    let series = sine * (first + terms.sum::<f64>());
    match (is_odd, freedom) {
        (false, _) => series,
        (true, 1) => std::f64::consts::FRAC_2_PI * atan(t),
        (true, _) => std::f64::consts::FRAC_2_PI * (atan(t / n.sqrt()) + series),
    }
}

/// The distance of dynamic time warping between `a` and `b`: the least sum of `|a[i] - b[j]|` over
/// all paths of pairs from the first two values to the last two. Each step of a path advances in
/// one series or in both (Sakoe and Chiba 1978, "Dynamic programming algorithm optimization for
/// spoken word recognition", without window and with equal weights). In the unit of the values;
/// infinite where one series is empty and the other is not, 0 where both are. O(length of a times
/// length of b), in memory for one series.
pub fn time_warping(a: &[f64], b: &[f64]) -> f64 {
    let mut before = vec![f64::INFINITY; b.len() + 1];
    before[0] = 0.0;
    for &value in a {
        let mut row = vec![f64::INFINITY; b.len() + 1];
        for (j, other) in b.iter().enumerate() {
            row[j + 1] = (value - other).abs() + before[j].min(before[j + 1]).min(row[j]);
        }
        before = row;
    }
    before[b.len()]
}

/// Bhattacharyya's distance `-ln sum sqrt(p q)` between the histograms p and q of `a` and `b`, in
/// bins of `width` from 0 on (Bhattacharyya 1943, "On a measure of divergence between two
/// statistical populations defined by their probability distributions"). 0 for equal histograms;
/// `None` where they share no bin, or a series is empty. O(n log n).
///
/// # Panics
/// Where a value is not finite, or `width` is not above 0.
pub fn bhattacharyya(a: &[f64], b: &[f64], width: f64) -> Option<f64> {
    assert!(width > 0.0 && a.iter().chain(b).all(|value| value.is_finite()), "bins of finite values");
    let binned = |values: &[f64]| {
        let mut bins: Vec<i64> = values.iter().map(|value| (value / width).floor() as i64).collect();
        bins.sort_unstable();
        let runs = bins.chunk_by(|one, next| one == next);
        runs.map(|run| (run[0], run.len() as f64 / values.len() as f64)).collect::<Vec<_>>()
    };
    let (p, q) = (binned(a), binned(b));
    let shared = p.iter().filter_map(|(bin, p)| {
        let found = q.binary_search_by_key(bin, |(bin, _)| *bin).ok()?;
        Some(sqrt(p * q[found].1))
    });
    let coefficient: f64 = shared.sum();
    // Rounding can lift the sum above 1.
    (coefficient > 0.0).then(|| (-log(coefficient)).max(0.0))
}

#[cfg(test)]
mod tests;
