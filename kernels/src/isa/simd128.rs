//! SIMD128 of WebAssembly: registers of four f32, without a fused multiply-add.
//!
//! A module with these instructions cannot be loaded without support for them, so they exist if the
//! build has them. *Relaxed* SIMD has a fused product, but the standard lets each implementation
//! round once or twice, so it is not used.

use std::arch::wasm32::{
    f32x4_add, f32x4_demote_f64x2_zero, f32x4_div, f32x4_le, f32x4_mul, f32x4_pmax, f32x4_splat, f32x4_sub,
    f64x2_add, f64x2_gt, f64x2_lt, f64x2_mul, f64x2_promote_low_f32x4, f64x2_splat, f64x2_sub, i32x4_add,
    i32x4_bitmask, i32x4_eq, i32x4_lt, i32x4_ne, i32x4_shl, i32x4_shr, i32x4_shuffle, i32x4_splat, i32x4_sub,
    i64x2_add, i64x2_eq, i64x2_shl, i64x2_shr, i64x2_splat, u8x16, u8x16_swizzle, u32x4_ge, u32x4_lt,
    u32x4_max, u32x4_min, v128, v128_and, v128_any_true, v128_bitselect, v128_load, v128_or, v128_store,
    v128_xor,
};
use std::array;

use super::vector::{Exponent, Simd, Sum, Task, Vector};
use crate::lanes::{LANES, Lanes, Wide};

/// f32 in a register.
const FOUR: usize = 4;

/// The instructions, which the whole build has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Simd128;

impl Simd for Simd128 {
    type V8 = Registers<2>;
    type V16 = Registers<4>;
    const WIDE: bool = false;
    const FUSED: bool = false;

    #[inline(never)]
    fn apart<T: Task>(self, task: T) -> T::Output {
        task.run(self)
    }
}

/// N registers used as one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Registers<const N: usize>([v128; N]);

impl<const N: usize> Registers<N> {
    #[inline(always)]
    fn each(self, f: impl Fn(v128) -> v128) -> Self {
        Self(array::from_fn(|i| f(self.0[i])))
    }

    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(v128, v128) -> v128) -> Self {
        Self(array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    /// Bit i is the sign of element i.
    #[inline(always)]
    fn signs(self) -> u32 {
        (0..N).fold(0, |bits, i| bits | u32::from(i32x4_bitmask(self.0[i])) << (FOUR * i))
    }
}

macro_rules! vector {
    ($n:expr, $memory:ty) => {
        impl Vector<Simd128> for Registers<$n> {
            type Memory = $memory;
            type Sum = Doubles<{ 2 * $n }>;
            const LANES: usize = FOUR * $n;
            const ZEROS: $memory = <$memory>::ZERO;

            #[inline(always)]
            fn splat(_: Simd128, value: f32) -> Self {
                Self([f32x4_splat(value); $n])
            }
            #[inline(always)]
            fn load(simd: Simd128, from: &$memory) -> Self {
                Self::load_slice(simd, &from.0)
            }
            #[inline(always)]
            fn load_slice(_: Simd128, from: &[f32]) -> Self {
                let from = &from[..Self::LANES];
                // SAFETY: register i is readable, from value 4 i on; no alignment is needed.
                Self(array::from_fn(|i| unsafe { v128_load(from.as_ptr().add(FOUR * i).cast()) }))
            }
            #[inline(always)]
            fn store(self, to: &mut $memory) {
                self.store_slice(&mut to.0);
            }
            #[inline(always)]
            fn store_slice(self, to: &mut [f32]) {
                let to = &mut to[..Self::LANES];
                for (i, register) in self.0.into_iter().enumerate() {
                    // SAFETY: register i is writable, from value 4 i on; no alignment is needed.
                    unsafe { v128_store(to.as_mut_ptr().add(FOUR * i).cast(), register) };
                }
            }
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                self.with(other, |a, b| f32x4_add(a, b))
            }
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                self.with(other, |a, b| f32x4_sub(a, b))
            }
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                self.with(other, |a, b| f32x4_mul(a, b))
            }
            #[inline(always)]
            fn add_product(self, a: Self, b: Self) -> Self {
                let (mut sums, mut hard) = (self.0, i32x4_splat(0));
                for (i, sum) in sums.iter_mut().enumerate() {
                    let (rounded, of_these) = add_product(a.0[i], b.0[i], *sum);
                    *sum = rounded;
                    hard = v128_or(hard, of_these);
                }
                if v128_any_true(hard) {
                    return Self(array::from_fn(|i| exact(a.0[i], b.0[i], self.0[i])));
                }
                Self(sums)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                self.with(other, |a, b| f32x4_pmax(a, b))
            }
            #[inline(always)]
            fn at_most(self, other: Self) -> u32 {
                self.with(other, |a, b| f32x4_le(a, b)).signs()
            }
            #[inline(always)]
            fn differs(self, other: Self) -> u32 {
                self.with(other, |a, b| i32x4_ne(a, b)).signs()
            }
        }

        impl Exponent<Simd128> for Registers<$n> {
            #[inline(always)]
            fn div(self, other: Self) -> Self {
                self.with(other, |a, b| f32x4_div(a, b))
            }
            #[inline(always)]
            fn power_of_two(self, _: Simd128, more: i32) -> Self {
                self.each(|x| i32x4_add(i32x4_shl(x, 23), i32x4_splat((127 + more) << 23)))
            }
            #[inline(always)]
            fn with_sign(self, _: Simd128, of: Self) -> Self {
                self.with(of, |x, of| v128_bitselect(of, x, i32x4_splat(i32::MIN)))
            }
            #[inline(always)]
            fn where_negative(self, of: Self, other: Self) -> Self {
                let negative = of.each(|of| i32x4_shr(of, 31));
                Self(array::from_fn(|i| v128_bitselect(self.0[i], other.0[i], negative.0[i])))
            }
        }
    };
}

vector!(2, Lanes);
vector!(4, Wide);

/// Sums of products in N registers of two f64, each of them the value of an f32.
///
/// The product of two f32 is exact in f64. Its sum s with a third value is rounded to f64, and then
/// to 24 bits without a conversion, which would cost more than everything else: with q = (2^29 + 1)
/// s, q + (s - q) is s rounded to nearest (Boldo 2006, "Pitfalls of a full floating-point proof",
/// section 4), in some direction if it is half-way: [`half_way`] rounds such sums. The result is
/// the f32 of the exact sum if
///
/// - factors other than 0 are from 2^-51 on: sums are multiples of 2^-148 then, so that those below
///   2^-126 are exact, and subnormal f32 have all their bits,
/// - factors and the first value are below 2^50, so that no sum of 2^26 products leaves f32,
/// - the first value is not -0, whose sign q + (s - q) loses. No other sum is -0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doubles<const N: usize>([v128; N]);

/// Bounds on all factors and first values.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doubt {
    /// Twice the least magnitude of a factor other than 0, less one, as unsigned integers.
    least: v128,
    /// Twice the largest magnitude, as unsigned integers; all bits if a first value is -0.
    largest: v128,
}

/// Bits of twice a magnitude of 2^`exponent`.
const fn twice(exponent: i32) -> i32 {
    (127 + exponent) << 24
}

macro_rules! doubles {
    ($n:expr) => {
        impl Sum<Simd128> for Doubles<{ 2 * $n }> {
            type Vector = Registers<$n>;
            type Factor = [v128; 2 * $n];
            type Doubt = Doubt;

            #[inline(always)]
            fn no_doubt(_: Simd128) -> Doubt {
                Doubt { least: i32x4_splat(-1), largest: i32x4_splat(0) }
            }
            #[inline(always)]
            fn is_right(Doubt { least, largest }: Doubt) -> bool {
                let small = u32x4_lt(least, i32x4_splat(twice(-51) - 1));
                let large = u32x4_ge(largest, i32x4_splat(twice(50)));
                !v128_any_true(v128_or(small, large))
            }
            #[inline(always)]
            fn from_vector(_: Simd128, vector: Registers<$n>, doubt: &mut Doubt) -> Self {
                for of in vector.0 {
                    let zero = i32x4_eq(of, i32x4_splat(i32::MIN));
                    doubt.largest = u32x4_max(doubt.largest, v128_or(i32x4_shl(of, 1), zero));
                }
                Self(vector.in_doubles())
            }
            #[inline(always)]
            fn to_vector(self) -> Registers<$n> {
                Registers(array::from_fn(|i| rounded([self.0[2 * i], self.0[2 * i + 1]])))
            }
            #[inline(always)]
            fn factor(_: Simd128, vector: Registers<$n>, doubt: &mut Doubt) -> Self::Factor {
                for of in vector.0 {
                    doubt.meet(of);
                }
                vector.in_doubles()
            }
            #[inline(always)]
            fn factor_of_all(_: Simd128, value: f32, doubt: &mut Doubt) -> Self::Factor {
                doubt.meet(f32x4_splat(value));
                [f64x2_splat(f64::from(value)); 2 * $n]
            }
            #[inline(always)]
            fn plus_product(self, a: Self::Factor, b: Self::Factor, _: &mut Doubt) -> Self {
                let sums: [v128; 2 * $n] = array::from_fn(|i| f64x2_add(f64x2_mul(a[i], b[i]), self.0[i]));
                let below = |sum| i64x2_eq(i64x2_shl(sum, 64 - 29), i64x2_splat(i64::MIN));
                if v128_any_true(sums.into_iter().fold(i32x4_splat(0), |any, sum| v128_or(any, below(sum)))) {
                    return Self(array::from_fn(|i| half_way(f64x2_mul(a[i], b[i]), self.0[i], sums[i])));
                }
                Self(sums.map(|sum| {
                    let more = f64x2_mul(sum, f64x2_splat(f64::from((1 << 29) + 1)));
                    f64x2_add(more, f64x2_sub(sum, more))
                }))
            }
        }

        impl Registers<$n> {
            /// The same values in twice as many registers.
            #[inline(always)]
            fn in_doubles(self) -> [v128; 2 * $n] {
                array::from_fn(|i| if i % 2 == 0 { low(self.0[i / 2]) } else { high(self.0[i / 2]) })
            }
        }
    };
}

doubles!(2);
doubles!(4);

impl Doubt {
    #[inline(always)]
    fn meet(&mut self, factors: v128) {
        let twice = i32x4_shl(factors, 1);
        self.least = u32x4_min(self.least, i32x4_sub(twice, i32x4_splat(1)));
        self.largest = u32x4_max(self.largest, twice);
    }
}

/// The first two values in f64.
#[inline(always)]
fn low(x: v128) -> v128 {
    f64x2_promote_low_f32x4(x)
}

/// The last two values in f64.
#[inline(always)]
fn high(x: v128) -> v128 {
    f64x2_promote_low_f32x4(i32x4_shuffle::<2, 3, 2, 3>(x, x))
}

const _: () = assert!(LANES == 2 * FOUR);

/// a b + c of the first or last two lanes in f64: the products are exact, the sums are rounded.
struct Halves {
    products: [v128; 2],
    c: [v128; 2],
    sums: [v128; 2],
}

impl Halves {
    #[inline(always)]
    fn new(a: v128, b: v128, c: v128) -> Self {
        let (products, c) = ([f64x2_mul(low(a), low(b)), f64x2_mul(high(a), high(b))], [low(c), high(c)]);
        Self { products, c, sums: array::from_fn(|i| f64x2_add(products[i], c[i])) }
    }
}

/// Four f64 as f32.
#[inline(always)]
fn rounded([low, high]: [v128; 2]) -> v128 {
    // Does not use a shuffle: the compiler would round lane by lane.
    let up = u8x16(16, 16, 16, 16, 16, 16, 16, 16, 0, 1, 2, 3, 4, 5, 6, 7);
    v128_or(f32x4_demote_f64x2_zero(low), u8x16_swizzle(f32x4_demote_f64x2_zero(high), up))
}

/// c + a b, and the lanes in which it may be wrong because it is rounded twice.
///
/// A sum in f64 that is not half-way between two f32 rounds to the f32 of the exact sum, as in
/// [`super::portable::fused_each`]: half-way, the 29 bits below an f32's last are a one and zeros.
/// If the f32 is subnormal, or the smallest normal one, half-way is elsewhere. A zero is right:
/// such small sums are exact in f64.
#[inline(always)]
fn add_product(a: v128, b: v128, c: v128) -> (v128, v128) {
    let sums = Halves::new(a, b, c).sums;
    let rounded = rounded(sums);
    let below = i32x4_shl(i32x4_shuffle::<0, 2, 4, 6>(sums[0], sums[1]), 3);
    let half_way = i32x4_eq(below, i32x4_splat(i32::MIN));
    // Twice the magnitude less one, as unsigned: the largest value for a zero.
    let magnitude = i32x4_add(i32x4_shl(rounded, 1), i32x4_splat(i32::MAX));
    let small = i32x4_lt(magnitude, i32x4_splat(i32::MIN + (1 << 24)));
    (rounded, v128_or(half_way, small))
}

/// c + a b, always: the sum in f64 is rounded to odd, as in [`super::portable::fused`].
#[inline(never)]
fn exact(a: v128, b: v128, c: v128) -> v128 {
    let Halves { products, c, sums } = Halves::new(a, b, c);
    rounded(array::from_fn(|i| to_odd(products[i], c[i], sums[i])))
}

/// The f32 of an exact sum as f64, always: from the sum rounded to odd.
#[inline(never)]
fn half_way(product: v128, c: v128, sum: v128) -> v128 {
    f64x2_promote_low_f32x4(f32x4_demote_f64x2_zero(to_odd(product, c, sum)))
}

/// The sum of two f64, rounded to odd; `sum` is the sum rounded to nearest.
#[inline(always)]
fn to_odd(product: v128, c: v128, sum: v128) -> v128 {
    // The error of the sum, exactly (Knuth's two-sum).
    let of_c = f64x2_sub(sum, product);
    let lost = f64x2_add(f64x2_sub(product, f64x2_sub(sum, of_c)), f64x2_sub(c, of_c));
    // NaN satisfies neither comparison; an infinite sum stays.
    let (zero, one) = (f64x2_splat(0.0), i64x2_splat(1));
    let inexact = v128_or(f64x2_lt(lost, zero), f64x2_gt(lost, zero));
    let even = i64x2_eq(v128_and(sum, one), zero);
    // Away from zero if the error has the sum's sign.
    let step = v128_or(i64x2_shr(v128_xor(lost, sum), 63), one);
    i64x2_add(sum, v128_and(step, v128_and(inexact, even)))
}
