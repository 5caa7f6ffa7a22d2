//! The instruction set that the build's target guarantees.

use super::vector::{Exponent, Simd, Task, Vector};
use crate::lanes::{LANES, Lanes, Wide};

/// Plain arrays, which the compiler vectorises for the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Portable;

impl Simd for Portable {
    type V8 = [f32; LANES];
    type V16 = [f32; 2 * LANES];
    const WIDE: bool = false;
    const FUSED: bool = cfg!(any(target_feature = "fma", target_arch = "aarch64"));

    #[inline(never)]
    fn apart<T: Task>(self, task: T) -> T::Output {
        task.run(self)
    }
}

macro_rules! array {
    ($n:expr, $memory:ty) => {
        impl Vector<Portable> for [f32; $n] {
            type Memory = $memory;
            type Sum = Self;
            const LANES: usize = $n;
            const ZEROS: $memory = <$memory>::ZERO;

            #[inline(always)]
            fn splat(_: Portable, value: f32) -> Self {
                [value; $n]
            }
            #[inline(always)]
            fn load(_: Portable, from: &Self::Memory) -> Self {
                from.0
            }
            #[inline(always)]
            fn load_slice(_: Portable, from: &[f32]) -> Self {
                let mut out = [0.0; $n];
                out.copy_from_slice(&from[..$n]);
                out
            }
            #[inline(always)]
            fn store(self, to: &mut Self::Memory) {
                to.0 = self;
            }
            #[inline(always)]
            fn store_slice(self, to: &mut [f32]) {
                to[..$n].copy_from_slice(&self);
            }
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                std::array::from_fn(|i| self[i] + other[i])
            }
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                std::array::from_fn(|i| self[i] - other[i])
            }
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                std::array::from_fn(|i| self[i] * other[i])
            }
            #[inline(always)]
            fn add_product(self, a: Self, b: Self) -> Self {
                fused_each(a, b, self)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                std::array::from_fn(|i| if other[i] > self[i] { other[i] } else { self[i] })
            }
            #[inline(always)]
            fn at_most(self, other: Self) -> u32 {
                (0..$n).fold(0, |bits, i| bits | u32::from(self[i] <= other[i]) << i)
            }
            #[inline(always)]
            fn differs(self, other: Self) -> u32 {
                (0..$n).fold(0, |bits, i| bits | u32::from(self[i].to_bits() != other[i].to_bits()) << i)
            }
        }

        impl Exponent<Portable> for [f32; $n] {
            #[inline(always)]
            fn div(self, other: Self) -> Self {
                std::array::from_fn(|i| self[i] / other[i])
            }
            #[inline(always)]
            fn power_of_two(self, _: Portable, more: i32) -> Self {
                std::array::from_fn(|i| power_of_two(self[i], more))
            }
            #[inline(always)]
            fn with_sign(self, _: Portable, of: Self) -> Self {
                std::array::from_fn(|i| self[i].copysign(of[i]))
            }
            #[inline(always)]
            fn where_negative(self, of: Self, other: Self) -> Self {
                std::array::from_fn(|i| if of[i].is_sign_negative() { self[i] } else { other[i] })
            }
        }
    };
}

array!(8, Lanes);
array!(16, Wide);

/// 2^(n + more), where `shifted` is 1.5 2^23 + n.
#[inline(always)]
fn power_of_two(shifted: f32, more: i32) -> f32 {
    // The shift moves n, modulo 2^9, into the exponent.
    f32::from_bits((shifted.to_bits() << 23).wrapping_add(((127 + more) << 23) as u32))
}

/// a b + c, rounded once.
///
/// Without such an instruction: the product of two f32 is exact in f64; its sum with c is rounded
/// *to odd* in f64, which makes the final rounding to f32 correct (Boldo and Melquiond 2008,
/// Theorem 1: 53 >= 2 * 24 + 2).
#[inline(always)]
pub fn fused(a: f32, b: f32, c: f32) -> f32 {
    if Portable::FUSED {
        return a.mul_add(b, c);
    }
    let (product, c) = (f64::from(a) * f64::from(b), f64::from(c));
    let sum = product + c;
    // The error of the sum, exactly (Knuth's two-sum).
    let of_c = sum - product;
    let lost = (product - (sum - of_c)) + (c - of_c);
    let bits = sum.to_bits();
    // Away from zero if the error has the sum's sign; false for NaN, infinities stay.
    let up = (lost > 0.0 && sum > 0.0) || (lost < 0.0 && sum < 0.0);
    let down = (lost < 0.0 && sum > 0.0) || (lost > 0.0 && sum < 0.0);
    let even = 1 - (bits & 1);
    f64::from_bits(bits + u64::from(up) * even - u64::from(down) * even) as f32
}

/// The bits of an f64 below the last of an f32.
const BELOW: u64 = (1 << 29) - 1;
/// The highest of them.
const HALF_WAY: u64 = 1 << 28;

/// [`fused`] of each element.
#[inline(always)]
pub fn fused_each<const N: usize>(a: [f32; N], b: [f32; N], c: [f32; N]) -> [f32; N] {
    if Portable::FUSED {
        return std::array::from_fn(|i| fused(a[i], b[i], c[i]));
    }
    fused_in_f64(a, b, c)
}

/// [`fused_each`] without such an instruction.
///
/// A sum in f64 that is not half-way between two f32 rounds to the f32 of the exact sum. This is
/// nearly always the case, and the test needs only the bits below an f32's last.
///
/// Not inlined: with a copy in each of their sums, kernels are 1.5 times as large, and not faster.
#[inline(never)]
fn fused_in_f64<const N: usize>(a: [f32; N], b: [f32; N], c: [f32; N]) -> [f32; N] {
    let mut sums = [0.0; N];
    let mut hard = 0;
    for i in 0..N {
        sums[i] = f64::from(a[i]) * f64::from(b[i]) + f64::from(c[i]);
        let bits = sums[i].to_bits();
        // For subnormal f32, half-way is elsewhere. Zero, NaN and infinity round to themselves.
        let subnormal = u64::from(sums[i].abs() < f64::from(f32::MIN_POSITIVE)) & u64::from(sums[i] != 0.0);
        hard |= u64::from(bits & BELOW == HALF_WAY) | subnormal;
    }
    if hard == 0 { sums.map(|sum| sum as f32) } else { each_fused(a, b, c) }
}

/// [`fused`] of each element, whatever the sums are.
#[cold]
#[inline(never)]
fn each_fused<const N: usize>(a: [f32; N], b: [f32; N], c: [f32; N]) -> [f32; N] {
    std::array::from_fn(|i| fused(a[i], b[i], c[i]))
}
