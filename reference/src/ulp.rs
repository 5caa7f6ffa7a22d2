//! Errors in units in the last place.

/// 2^104, the distance of the two largest f32.
const LARGEST_ULP: f64 = 20_282_409_603_651_670_423_947_251_286_016.0;

/// Error of `got` in units in the last place of the f32 nearest to `want`: the distance from its magnitude to the next
/// larger f32. 0 if `got` is that f32, or both are NaN; infinite if only one is NaN.
pub fn ulps(got: f32, want: f64) -> f64 {
    let nearest = want as f32;
    if got == nearest || (got.is_nan() && want.is_nan()) {
        return 0.0;
    }
    if got.is_nan() || want.is_nan() {
        return f64::INFINITY;
    }
    let magnitude = nearest.abs();
    let ulp = if magnitude < f32::MAX {
        f64::from(f32::from_bits(magnitude.to_bits() + 1)) - f64::from(magnitude)
    } else {
        LARGEST_ULP
    };
    (f64::from(got) - want).abs() / ulp
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_value_has_no_error_and_its_neighbour_about_one() {
        let third = 1.0 / 3.0;
        let nearest = third as f32;
        assert_eq!(ulps(nearest, third), 0.0);
        let next = f32::from_bits(nearest.to_bits() + 1);
        assert!((0.5..1.5).contains(&ulps(next, third)), "{}", ulps(next, third));
    }

    #[test]
    fn subnormal_values_are_measured_by_the_smallest_distance() {
        assert_eq!(ulps(0.0, f64::from(f32::from_bits(3))), 3.0);
        assert_eq!(ulps(f32::from_bits(1), f64::from(f32::from_bits(3))), 2.0);
    }

    #[test]
    fn what_is_not_a_number_on_one_side_is_infinitely_wrong() {
        assert_eq!(ulps(f32::NAN, 1.0), f64::INFINITY);
        assert_eq!(ulps(1.0, f64::NAN), f64::INFINITY);
        assert_eq!(ulps(f32::NAN, f64::NAN), 0.0);
    }

    #[test]
    fn the_largest_value_and_infinity_are_as_far_apart_as_the_largest_two() {
        assert_eq!(LARGEST_ULP, 2f64.powi(104));
        assert_eq!(ulps(f32::INFINITY, f64::from(f32::MAX)), f64::INFINITY);
        assert_eq!(ulps(f32::MAX, f64::from(f32::MAX) - LARGEST_ULP), 1.0);
    }
}
