//! Points of a picture in a JSON report: all of them if they are few, some if they are many.
//!
//! Input: any number of points. Output: at most [`MAX_POINTS`] of them, in their order.

use serde::ser::{Serialize, Serializer};

/// Maximum number of points of one list in a JSON report.
const MAX_POINTS: usize = 512;

/// All `points` if there are at most [`MAX_POINTS`]. Otherwise every n-th from the first one on,
/// with the lowest and the highest of each of the `values` of a point, so that a picture has the
/// density of all points and loses no extreme. O(n).
fn thinned<T: Copy, const N: usize>(points: &[T], values: impl Fn(&T) -> [f64; N]) -> Vec<T> {
    if points.len() <= MAX_POINTS {
        return points.to_vec();
    }
    let step = points.len().div_ceil(MAX_POINTS - 2 * N);
    let mut kept: Vec<usize> = (0..points.len()).step_by(step).collect();
    for value in 0..N {
        let at = |&i: &usize| values(&points[i])[value];
        let finite = || (0..points.len()).filter(|i| at(i).is_finite());
        kept.extend(finite().min_by(|a, b| at(a).total_cmp(&at(b))));
        kept.extend(finite().max_by(|a, b| at(a).total_cmp(&at(b))));
    }
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|i| points[i]).collect()
}

/// A true and a predicted value.
type Pair = (f64, f64);

/// Pairs in the order of the truth, with the extremes of both values and of their difference.
fn of_pairs(pairs: impl IntoIterator<Item = Pair>) -> Vec<Pair> {
    let mut pairs: Vec<Pair> = pairs.into_iter().collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    thinned(&pairs, |&(truth, found)| [truth, found, found - truth])
}

/// Serialises pairs.
pub(crate) fn pairs<S: Serializer>(pairs: &[Pair], s: S) -> Result<S::Ok, S::Error> {
    of_pairs(pairs.iter().copied()).serialize(s)
}

/// Serialises the pairs of each output.
pub(crate) fn of_each<S: Serializer>(each: &[Vec<Pair>], s: S) -> Result<S::Ok, S::Error> {
    s.collect_seq(each.iter().map(|pairs| of_pairs(pairs.iter().copied())))
}

/// Serialises the pairs of all parts together.
pub(crate) fn of_all<S: Serializer>(parts: &[Vec<Pair>], s: S) -> Result<S::Ok, S::Error> {
    of_pairs(parts.iter().flatten().copied()).serialize(s)
}

/// Serialises the time, the goal and the reached value.
pub(crate) fn trace<S: Serializer>(trace: &[(f64, f64, f64)], s: S) -> Result<S::Ok, S::Error> {
    thinned(trace, |&(_, goal, is)| [goal, is, is - goal]).serialize(s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_points_are_all_there_and_many_are_thinned_evenly_with_every_extreme() {
        let few: Vec<Pair> = (0..MAX_POINTS).map(|i| (i as f64, 0.5)).collect();
        assert_eq!(of_pairs(few.clone()), few);
        // The pair with the largest error has neither the smallest nor the largest value.
        let pair = |i: usize| (i as f64, if i == 7_777 { 50_000.0 } else { i as f64 + 0.1 });
        let mut many: Vec<Pair> = (0..100_000).map(pair).collect();
        many.reverse();
        let kept = of_pairs(many.clone());
        assert!((256..=MAX_POINTS).contains(&kept.len()), "{}", kept.len());
        for extreme in [pair(0), pair(99_999), pair(7_777)] {
            assert!(kept.contains(&extreme), "{extreme:?}");
        }
        assert!(kept.is_sorted_by(|a, b| a.0 <= b.0) && kept.iter().all(|pair| many.contains(pair)));
        let widest = kept.windows(2).map(|two| two[1].0 - two[0].0).fold(0.0, f64::max);
        assert!(widest <= 200.0, "{widest}");
    }

    #[test]
    fn what_is_not_finite_is_no_extreme() {
        let many: Vec<Pair> =
            (0..1_000).map(|i| (f64::from(i), if i == 3 { f64::NAN } else { 1.0 })).collect();
        assert!(of_pairs(many).iter().any(|pair| pair.0 == 999.0));
    }
}
