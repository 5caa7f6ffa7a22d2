//! Elementary functions of f32, with the same bits on every machine.
//!
//! All functions reduce x = n ln 2 + r, |r| <= ln 2 / 2 (Cody and Waite's two-part ln 2, whose high
//! part times n is exact), and use expm1(r) = r + r^2 P(r), with P of degree 5, a weighted minimax
//! fit within 0.01 ULP; the remaining error is rounding. Branch-free, so that loops over lanes
//! vectorise.

use crate::isa::{Exponent, Isa, Portable, Simd, Task, Vector};
use crate::lanes::{LANES, Wide};

const LOG2_E: f32 = std::f32::consts::LOG2_E;
/// ln 2 to 15 bits: exact when multiplied by any n that occurs.
const LN2_HIGH: f32 = 0.693_145_75;
const LN2_LOW: f32 = 1.428_606_8e-6;
/// 1.5 * 2^23: adding it rounds to an integer, ties to even, in the low bits.
const ROUND: f32 = 12_582_912.0;
const TWO_TO_MINUS_24: f32 = 5.960_464_5e-8;
/// P, lowest power first.
const P: [f32; 6] = [0.5, 0.166_666_66, 0.041_666_36, 8.333_39e-3, 1.394_082_3e-3, 1.984_589_3e-4];

#[inline(always)]
fn power_of_two(n: i32) -> f32 {
    f32::from_bits(((n + 127) << 23) as u32)
}

/// e^x. Largest error 1.1 ULP over all f32, subnormal results included; `exp(-inf)` is 0,
/// `exp(inf)` infinite, NaN stays NaN.
// Vectors map over it, and it vectorises only in its caller. The scalar functions below have
// forms for vectors instead.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    // Beyond these the result is 0 or infinite; within, both halves of n are normal powers.
    let x = x.clamp(-104.0, 89.0);
    let shifted = x * LOG2_E + ROUND;
    let (n, integer) = (shifted.to_bits() as i32 - ROUND.to_bits() as i32, shifted - ROUND);
    let r = (x - integer * LN2_HIGH) - integer * LN2_LOW;
    let p = ((((P[5] * r + P[4]) * r + P[3]) * r + P[2]) * r + P[1]) * r + P[0];
    let p = r + (r * r) * p;
    let half = n >> 1;
    (1.0 + p) * power_of_two(half) * power_of_two(n - half)
}

/// e^x - 1, accurate near 0. Largest error 1.4 ULP over all f32; `expm1(-inf)` is -1, `expm1(inf)`
/// infinite; the sign of zero and NaN are kept.
pub fn expm1(x: f32) -> f32 {
    // The other seven lanes are never read: the compiler removes them.
    expm1s(Portable, [[x; 8]])[0][0]
}

/// [`expm1`] of N vectors, interleaved.
#[inline(always)]
pub(crate) fn expm1s<S: Copy, V: Exponent<S>, const N: usize>(simd: S, mut x: [V; N]) -> [V; N] {
    let mut bounded = x;
    for x in &mut bounded {
        *x = x.map(simd, |x| if x > 89.0 { 89.0 } else { x });
    }
    for (x, y) in x.iter_mut().zip(expm1s_below(simd, bounded)) {
        // The additions lose the sign of zero, which is always that of x.
        *x = y.with_sign(simd, *x);
    }
    x
}

/// [`expm1`] of N vectors of at most 89, interleaved; the sign of zero is lost.
#[inline(always)]
fn expm1s_below<S: Copy, V: Exponent<S>, const N: usize>(simd: S, mut x: [V; N]) -> [V; N] {
    let splat = |v: f32| V::splat(simd, v);
    for x in &mut x {
        // Below -30 the result is -1.
        *x = x.max(splat(-30.0));
    }
    let p = reduces(simd, &mut x);
    for (x, p) in x.iter_mut().zip(p) {
        // Half of the power keeps n = 128, the last before overflow, representable.
        let half = x.power_of_two(simd, -1);
        *x = splat(2.0).mul(half.sub(splat(0.5)).add_product(half, p));
    }
    x
}

/// The exponential linear unit: x for x > 0, else e^x - 1 (Clevert et al. 2016, Eq. 15).
pub fn elu(x: f32) -> f32 {
    // The other seven lanes are never read: the compiler removes them.
    elus(Portable, [[x; 8]])[0][0]
}

/// [`elu`] of N vectors, interleaved: a single chain does not fill the processor's pipeline.
#[inline(always)]
pub fn elus<S: Copy, V: Exponent<S>, const N: usize>(simd: S, mut x: [V; N]) -> [V; N] {
    // For x > 0 the values computed here are not used.
    let negative = expm1s_below(simd, x);
    for (x, negative) in x.iter_mut().zip(negative) {
        *x = negative.with_sign(simd, *x).where_negative(*x, *x);
    }
    x
}

/// 1 / (1 + e^-x). Largest error 2.5 ULP over all f32, subnormal results included; `sigmoid(-inf)`
/// is 0, `sigmoid(inf)` 1, NaN stays NaN.
pub fn sigmoid(x: f32) -> f32 {
    // The other seven lanes are never read: the compiler removes them.
    divided(sigmoid_quotients(Portable, [[x; 8]]))[0][0]
}

/// The hyperbolic tangent. Largest error 2.5 ULP over all f32; `tanh(-inf)` is -1, `tanh(inf)` 1;
/// the sign of zero and NaN are kept.
pub fn tanh(x: f32) -> f32 {
    // The other seven lanes are never read: the compiler removes them.
    divided(tanh_quotients(Portable, [[x; 8]]))[0][0]
}

/// Quotients before division: numerators and denominators of N vectors.
pub(crate) type Quotients<V, const N: usize> = ([V; N], [V; N]);

/// Replaces each x by 1.5 2^23 + n, n the integer nearest to x / ln 2, and returns expm1(x - n ln
/// 2). Vectors are interleaved; each product is rounded once with its sum.
///
/// Loops: an array's `map` does not inline closures, which then miss the instruction set.
#[inline(always)]
fn reduces<S: Copy, V: Vector<S>, const N: usize>(simd: S, x: &mut [V; N]) -> [V; N] {
    let splat = |v: f32| V::splat(simd, v);
    let mut r = *x;
    for (x, r) in x.iter_mut().zip(&mut r) {
        *x = splat(ROUND).add_product(*x, splat(LOG2_E));
        let n = x.sub(splat(ROUND));
        *r = r.add_product(n, splat(-LN2_HIGH)).add_product(n, splat(-LN2_LOW));
    }
    let mut p = [splat(P[5]); N];
    for c in [P[4], P[3], P[2], P[1], P[0]] {
        for (p, &r) in p.iter_mut().zip(&r) {
            *p = splat(c).add_product(*p, r);
        }
    }
    for (p, &r) in p.iter_mut().zip(&r) {
        *p = r.add_product(r.mul(r), *p);
    }
    p
}

/// [`sigmoid`] of N interleaved vectors as quotients with denominators from 1 to 2.
#[inline(always)]
pub(crate) fn sigmoid_quotients<S: Copy, V: Exponent<S>, const N: usize>(
    simd: S,
    x: [V; N],
) -> Quotients<V, N> {
    let splat = |v: f32| V::splat(simd, v);
    let one = splat(1.0);
    // Computed for -|x|, so that it neither overflows nor cancels. As in `exp`, 0 is reached at
    // -104.
    let mut shifted = x;
    for x in &mut shifted {
        *x = x.with_sign(simd, splat(-1.0)).max(splat(-104.0));
    }
    let mut above = reduces(simd, &mut shifted);
    let mut below = above;
    for (i, shifted) in shifted.into_iter().enumerate() {
        // The power is 2^24 times too large, and therefore normal; only the last product rounds.
        let power = shifted.power_of_two(simd, 24);
        let e = power.add_product(power, above[i]).mul(splat(TWO_TO_MINUS_24));
        above[i] = e.where_negative(x[i], one);
        below[i] = one.add(e);
    }
    (above, below)
}

/// [`tanh`] of N vectors as quotients whose denominators are 1 to 2, interleaved.
#[inline(always)]
pub(crate) fn tanh_quotients<S: Copy, V: Exponent<S>, const N: usize>(simd: S, x: [V; N]) -> Quotients<V, N> {
    let splat = |v: f32| V::splat(simd, v);
    // -m / (2 + m) with m = expm1(-2 |x|), -1 below -30. n <= 0: no power to be halved.
    let mut shifted = x;
    for x in &mut shifted {
        *x = x.with_sign(simd, splat(1.0)).mul(splat(-2.0)).max(splat(-30.0));
    }
    let mut above = reduces(simd, &mut shifted);
    let mut below = above;
    for (i, shifted) in shifted.into_iter().enumerate() {
        let power = shifted.power_of_two(simd, 0);
        let m = power.sub(splat(1.0)).add_product(power, above[i]);
        above[i] = m.with_sign(simd, x[i]);
        below[i] = m.add(splat(2.0));
    }
    (above, below)
}

#[inline(always)]
pub(crate) fn divided<S, V: Exponent<S>, const N: usize>((mut above, below): Quotients<V, N>) -> [V; N] {
    for (above, below) in above.iter_mut().zip(below) {
        *above = above.div(below);
    }
    above
}

/// values(i) = e^(values(i) - m) / s, m the largest value and s the sum of powers, ascending.
///
/// Does nothing if `values` is empty. If any value is NaN, all become NaN.
pub fn softmax(values: &mut [f32]) {
    let largest = values.iter().fold(f32::NEG_INFINITY, |m, &v| if v > m { v } else { m });
    let mut sum = 0.0;
    for value in &mut *values {
        *value = exp(*value - largest);
        sum += *value;
    }
    values.iter_mut().for_each(|value| *value /= sum);
}

/// An elementary function of one f32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elementary {
    /// [`exp`].
    Exp,
    /// [`expm1`].
    Expm1,
    /// [`elu`].
    Elu,
    /// [`sigmoid`].
    Sigmoid,
    /// [`tanh`].
    Tanh,
}

impl Elementary {
    /// All functions.
    pub const ALL: [Self; 5] = [Self::Exp, Self::Expm1, Self::Elu, Self::Sigmoid, Self::Tanh];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exp => "exp",
            Self::Expm1 => "expm1",
            Self::Elu => "elu",
            Self::Sigmoid => "sigmoid",
            Self::Tanh => "tanh",
        }
    }

    /// Its largest error over all f32, in ULP of the correctly rounded result.
    pub fn bound(self) -> f64 {
        match self {
            Self::Exp => 1.1,
            Self::Expm1 | Self::Elu => 1.4,
            Self::Sigmoid | Self::Tanh => 2.5,
        }
    }

    /// Its value at `x`.
    pub fn of(self, x: f32) -> f32 {
        match self {
            Self::Exp => exp(x),
            Self::Expm1 => expm1(x),
            Self::Elu => elu(x),
            Self::Sigmoid => sigmoid(x),
            Self::Tanh => tanh(x),
        }
    }

    /// Replaces each of `values` by the function's value. O(values).
    pub fn apply(self, isa: Isa, values: &mut [f32]) {
        isa.run(Apply { function: self, values });
    }
}

struct Apply<'a> {
    function: Elementary,
    values: &'a mut [f32],
}

impl Task for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for values in self.values.chunks_mut(2 * LANES) {
            let mut padded = Wide::ZERO;
            padded.0[..values.len()].copy_from_slice(values);
            let x = S::V16::load(simd, &padded);
            let [y] = match self.function {
                Elementary::Exp => [x.map(simd, exp)],
                Elementary::Expm1 => expm1s(simd, [x]),
                Elementary::Elu => elus(simd, [x]),
                Elementary::Sigmoid => divided(sigmoid_quotients(simd, [x])),
                Elementary::Tanh => divided(tanh_quotients(simd, [x])),
            };
            y.store(&mut padded);
            values.copy_from_slice(&padded.0[..values.len()]);
        }
    }
}
