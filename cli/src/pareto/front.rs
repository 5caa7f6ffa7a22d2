//! What nothing beats.
//!
//! A point is beaten by one that is at most as large in both coordinates and smaller in one. Of equal points none beats the
//! other, so that all of them are on the front, or none.

/// Places of the points (time, error) that no other one beats, by ascending time, then error, then place. Points with a
/// coordinate that is not finite are left out. O(n log n).
pub(super) fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|&i| points[i].0.is_finite() && points[i].1.is_finite()).collect();
    order.sort_by(|&a, &b| {
        let ((ta, ea), (tb, eb)) = (points[a], points[b]);
        ta.total_cmp(&tb).then(ea.total_cmp(&eb)).then(a.cmp(&b))
    });
    let mut last: Option<(f64, f64)> = None;
    // All that came before are at most as slow: what is not better than the best of them, or equal to it, is beaten.
    order.retain(|&i| {
        let stays = last.is_none_or(|last| points[i].1 < last.1 || points[i] == last);
        if stays {
            last = Some(points[i]);
        }
        stays
    });
    order
}

#[cfg(test)]
mod tests {
    use super::front;
    use proptest::prelude::*;

    /// Every point against every other.
    fn slow(points: &[(f64, f64)]) -> Vec<usize> {
        let beats = |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
        (0..points.len()).filter(|&i| !points.iter().any(|&other| beats(other, points[i]))).collect()
    }

    #[test]
    fn a_slower_point_with_the_same_error_is_beaten() {
        assert_eq!(front(&[(2.0, 0.1), (1.0, 0.1), (0.5, 0.2), (0.5, 0.3)]), [2, 1]);
    }

    #[test]
    fn equal_points_are_all_on_the_front() {
        assert_eq!(front(&[(1.0, 0.1), (1.0, 0.1), (2.0, 0.2)]), [0, 1]);
    }

    #[test]
    fn what_is_no_number_is_left_out() {
        assert_eq!(front(&[(f64::NAN, 0.0), (1.0, f64::INFINITY), (3.0, 3.0)]), [2]);
        assert_eq!(front(&[]), [0_usize; 0]);
    }

    proptest! {
        #[test]
        fn it_is_what_no_other_point_beats(
            // Few values, so that many are equal.
            points in proptest::collection::vec((0..8_u8, 0..8_u8), 0..40)
        ) {
            let points: Vec<(f64, f64)> =
                points.into_iter().map(|(time, error)| (f64::from(time) - 3.0, f64::from(error) / 3.0)).collect();
            let mut fast = front(&points);
            prop_assert!(fast.windows(2).all(|pair| points[pair[0]].0 <= points[pair[1]].0));
            fast.sort_unstable();
            prop_assert_eq!(fast, slow(&points));
        }
    }
}
