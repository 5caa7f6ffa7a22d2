//! The mean of figures that come in clusters, such as the pictures of a press, and how sure it is.
//!
//! Figures of one cluster depend on each other, so the cluster is the independent unit. Clusters
//! may differ in size.

use libm::atan;

/// Sum and number of the figures of a cluster.
pub(crate) type Cluster = (f64, u64);

/// The 95 % interval of the mean over all figures of `clusters`; `None` for fewer than two clusters
/// with figures.
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
    // Those of an infinite number of degrees, and of one, with some room.
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

/// The probability that Student's distribution is within `t` (Abramowitz and Stegun 1964, equations
/// 26.7.3 and 26.7.4).
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

#[cfg(test)]
mod tests {
    use super::{clustered_95, student_95};

    #[test]
    fn quantiles_are_those_of_the_tables() {
        let table = [
            (1, 12.706_204_736),
            (2, 4.302_652_730),
            (3, 3.182_446_305),
            (4, 2.776_445_105),
            (5, 2.570_581_836),
            (10, 2.228_138_852),
            (29, 2.045_229_642),
            (30, 2.042_272_456),
            (100, 1.983_971_519),
        ];
        for (freedom, expected) in table {
            let found = student_95(freedom);
            assert!((found - expected).abs() < 1e-8, "{freedom}: {found}");
        }
        assert!((student_95(100_000) - 1.959_988).abs() < 1e-6);
    }

    #[test]
    fn clusters_of_one_size_give_the_interval_of_their_means() {
        // Means 1, 2 and 6 of two figures each: mean 3, deviation sqrt(7), t of 2 degrees.
        let (low, high) = clustered_95(&[(2.0, 2), (4.0, 2), (12.0, 2)]).expect("three clusters");
        let reach = 4.302_652_730 * (7.0_f64 / 3.0).sqrt();
        assert!((low - (3.0 - reach)).abs() < 1e-8 && (high - (3.0 + reach)).abs() < 1e-8, "{low} {high}");
    }

    #[test]
    fn larger_clusters_weigh_more_and_empty_ones_nothing() {
        // One figure of 4 and three of 1: mean 7/4; s - r n is 9/4 and -9/4, so v is 2 * (81/8) /
        // 16.
        let (low, high) = clustered_95(&[(4.0, 1), (0.0, 0), (3.0, 3)]).expect("two clusters");
        let reach = 12.706_204_736 * (81.0_f64 / 64.0).sqrt();
        assert!((low - (1.75 - reach)).abs() < 1e-7 && (high - (1.75 + reach)).abs() < 1e-7, "{low} {high}");
        assert_eq!(clustered_95(&[(4.0, 2), (0.0, 0)]), None);
        assert_eq!(clustered_95(&[]), None);
        assert_eq!(clustered_95(&[(1.0, 1), (1.0, 1)]), Some((1.0, 1.0)));
    }
}
