//! Elementary functions of f32, the same bits everywhere.
//!
//! Both reduce x = n ln 2 + r with |r| <= ln 2 / 2 (Cody and Waite's two-part ln 2, whose high part times n is exact)
//! and evaluate expm1(r) = r + r^2 P(r) with P of degree 5, a weighted minimax fit whose relative error is below
//! 0.01 ULP; what is left is rounding. Branch-free, so that a loop over lanes vectorises.

/// log2(e).
const LOG2_E: f32 = std::f32::consts::LOG2_E;
/// ln 2 to 15 bits: exact when multiplied by any n that occurs.
const LN2_HIGH: f32 = 0.693_145_75;
/// ln 2 - `LN2_HIGH`.
const LN2_LOW: f32 = 1.428_606_8e-6;
/// 1.5 * 2^23: adding it rounds to an integer, ties to even, and leaves that integer in the low bits.
const ROUND: f32 = 12_582_912.0;
/// P, lowest power first.
const P: [f32; 6] = [0.5, 0.166_666_66, 0.041_666_36, 8.333_39e-3, 1.394_082_3e-3, 1.984_589_3e-4];

/// Splits x into n (also as an integer) and expm1(x - n ln 2).
#[inline(always)]
fn reduce(x: f32) -> (i32, f32) {
    let shifted = x * LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = (x - n * LN2_HIGH) - n * LN2_LOW;
    let p = ((((P[5] * r + P[4]) * r + P[3]) * r + P[2]) * r + P[1]) * r + P[0];
    (shifted.to_bits() as i32 - ROUND.to_bits() as i32, r + (r * r) * p)
}

/// 2^n for -126 <= n <= 127.
#[inline(always)]
fn power_of_two(n: i32) -> f32 {
    f32::from_bits(((n + 127) << 23) as u32)
}

/// e^x. Largest error 1.1 ULP over all f32, subnormal results included; `exp(-inf)` is 0, `exp(inf)` is infinite,
/// NaN stays NaN.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    // Beyond these bounds the result has become 0 or infinite already; inside, both halves of n are normal powers.
    let (n, p) = reduce(x.clamp(-104.0, 89.0));
    let half = n >> 1;
    (1.0 + p) * power_of_two(half) * power_of_two(n - half)
}

/// e^x - 1, accurate near 0. Largest error 1.5 ULP over all f32; `expm1(-inf)` is -1, `expm1(inf)` is infinite, the
/// sign of zero and NaN are kept.
#[inline(always)]
pub fn expm1(x: f32) -> f32 {
    // Below -30 the result is -1. Half of the power keeps n = 128, the last before overflow, representable.
    let (n, p) = reduce(x.clamp(-30.0, 89.0));
    let half = power_of_two(n - 1);
    // For n = 0 the result is p, exactly; the additions lose the sign of zero, which is always that of x.
    (2.0 * (half * p + (half - 0.5))).copysign(x)
}

/// The exponential linear unit with alpha 1: x for x > 0, else e^x - 1 (Clevert et al. 2016, Eq. 15).
#[inline(always)]
pub fn elu(x: f32) -> f32 {
    let negative = expm1(x);
    if x > 0.0 { x } else { negative }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error of `got` in units of the last place of the f32 nearest to `want`.
    fn ulps(got: f32, want: f64) -> f64 {
        let nearest = want as f32;
        if got == nearest || (got.is_nan() && nearest.is_nan()) {
            return 0.0;
        }
        let ulp = if nearest.is_infinite() || nearest.abs() >= f32::MAX {
            2f64.powi(104)
        } else {
            f64::from(f32::from_bits(nearest.abs().to_bits() + 1)) - f64::from(nearest.abs())
        };
        (f64::from(got) - want).abs() / ulp
    }

    /// Every `stride`th bit pattern: all exponents, both signs, NaNs and infinities.
    fn sweep(stride: usize) -> impl Iterator<Item = f32> {
        (0..=u32::MAX).step_by(stride).map(f32::from_bits)
    }

    fn worst(f: impl Fn(f32) -> f32, exact: impl Fn(f64) -> f64) -> (f64, f32) {
        sweep(251).fold((0.0, 0.0), |worst, x| {
            let error = ulps(f(x), exact(f64::from(x)));
            if error > worst.0 { (error, x) } else { worst }
        })
    }

    #[test]
    fn exp_is_within_its_stated_bound() {
        let (error, x) = worst(exp, f64::exp);
        assert!(error <= 1.1, "{error} ULP at {x:e}");
    }

    #[test]
    fn expm1_is_within_its_stated_bound() {
        let (error, x) = worst(expm1, f64::exp_m1);
        assert!(error <= 1.5, "{error} ULP at {x:e}");
    }

    #[test]
    fn special_values_are_kept() {
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(exp(f32::NEG_INFINITY), 0.0);
        assert_eq!(exp(f32::INFINITY), f32::INFINITY);
        assert_eq!(expm1(f32::NEG_INFINITY), -1.0);
        assert_eq!(expm1(f32::INFINITY), f32::INFINITY);
        assert_eq!(expm1(-0.0).to_bits(), (-0.0f32).to_bits());
        assert_eq!(expm1(1e-40).to_bits(), 1e-40f32.to_bits());
        assert!(exp(f32::NAN).is_nan() && expm1(f32::NAN).is_nan() && elu(f32::NAN).is_nan());
    }

    #[test]
    fn elu_is_the_identity_above_zero() {
        for x in [1e-38, 0.3, 7.5, 1e30, f32::INFINITY] {
            assert_eq!(elu(x), x);
        }
    }
}
