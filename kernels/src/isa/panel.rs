//! The inner loops of all matrix products: a few rows of values times a few vectors of weights.
//!
//! Sizes are checked once, before the loop: checks inside, and their registers, would halve the
//! speed.

use super::vector::{Simd, Vector};
use crate::lanes::{LANES, Wide};

/// Number of values in a [`Wide`].
const WIDE: usize = 2 * LANES;

/// acc(r, b) += sum of values(r stride + k) weights(b, k) for k from `FIRST` in steps of `STEP`,
/// ascending, each product rounded once with the sum.
///
/// # Panics
/// If the weights differ in length, or `values` is too short.
#[inline(always)]
pub(crate) fn accumulate<
    S: Simd,
    V: Vector<S>,
    const R: usize,
    const B: usize,
    const FIRST: usize,
    const STEP: usize,
>(
    simd: S,
    acc: &mut [[V; B]; R],
    values: &[f32],
    stride: usize,
    weights: [&[V::Memory]; B],
) {
    let count = weights[0].len();
    if count == 0 {
        return;
    }
    assert!(weights.iter().all(|w| w.len() == count), "weights must have one length");
    let last = stride.checked_mul(R - 1).and_then(|first| first.checked_add(count));
    assert!(last.is_some_and(|last| last <= values.len()), "there must be a value for each weight");
    // A local variable, so that it stays in registers.
    let mut sums = *acc;
    let mut k = FIRST;
    while k < count {
        // SAFETY: k < count, the length of every slice of weights.
        let weights: [V; B] = unsafe { loaded(simd, &weights, k) };
        for (r, sums) in sums.iter_mut().enumerate() {
            // SAFETY: r <= R - 1 and k < count: below (R - 1) stride + count, within `values`.
            let value = V::splat(simd, *unsafe { values.get_unchecked(r * stride + k) });
            for (sum, &weight) in sums.iter_mut().zip(&weights) {
                *sum = sum.add_product(value, weight);
            }
        }
        k += STEP;
    }
    *acc = sums;
}

/// acc(r, b) += sum over k < the weights' number, ascending, of values(k / 16 apart + r)[k mod 16]
/// weights(b, k), each product rounded once with the sum. The rows' constant distance is part of
/// the instructions, so that addresses need no registers.
///
/// # Panics
/// If the weights differ in length, or `values` is too short.
#[inline(always)]
pub(crate) fn accumulate_wide<S: Simd, V: Vector<S>, const R: usize, const B: usize>(
    simd: S,
    acc: &mut [[V; B]; R],
    values: &[Wide],
    apart: usize,
    weights: [&[V::Memory]; B],
) {
    let total = weights[0].len();
    if total == 0 {
        return;
    }
    assert!(weights.iter().all(|w| w.len() == total), "weights must have one length");
    let last = ((total - 1) / WIDE).checked_mul(apart).and_then(|at| at.checked_add(R));
    assert!(last.is_some_and(|last| last <= values.len()), "there must be a value for each weight");
    // A local variable, so that it stays in registers.
    let mut sums = *acc;
    let (mut first, mut at) = (0, 0);
    while first < total {
        let count = (total - first).min(WIDE);
        for k in 0..count {
            // SAFETY: first + k < total, the length of every slice of weights.
            let weights: [V; B] = unsafe { loaded(simd, &weights, first + k) };
            for (r, sums) in sums.iter_mut().enumerate() {
                // SAFETY: at = first / 16 apart, first <= total - 1, r < R: at + r < last; k < 16.
                let value = V::splat(simd, *unsafe { values.get_unchecked(at + r).0.get_unchecked(k) });
                for (sum, &weight) in sums.iter_mut().zip(&weights) {
                    *sum = sum.add_product(value, weight);
                }
            }
        }
        first += count;
        at += apart;
    }
    *acc = sums;
}

/// acc(p, b) += sum of values(k) weights(b, k) over k mod 4 = p: one row in four partial sums.
///
/// # Panics
/// If weights and values differ in length.
#[inline(always)]
pub(crate) fn accumulate_in_four<S: Simd, V: Vector<S>, const B: usize>(
    simd: S,
    acc: &mut [[V; B]; 4],
    values: &[f32],
    weights: [&[V::Memory]; B],
) {
    let count = values.len();
    assert!(weights.iter().all(|w| w.len() == count), "there must be a value for each weight");
    let mut sums = *acc;
    let mut k = 0;
    while k + 4 <= count {
        for (p, sums) in sums.iter_mut().enumerate() {
            // SAFETY: k + p < k + 4 <= count, the length of `values` and of every slice of weights.
            unsafe { add_products(simd, sums, values, &weights, k + p) };
        }
        k += 4;
    }
    for (p, sums) in sums.iter_mut().enumerate().take(count - k) {
        // SAFETY: p < count - k.
        unsafe { add_products(simd, sums, values, &weights, k + p) };
    }
    *acc = sums;
}

/// weights(b, k) of every b. No `map`: in a closure that stays a call, instructions do too.
///
/// # Safety
/// k is less than the length of every slice of weights.
#[inline(always)]
unsafe fn loaded<S: Simd, V: Vector<S>, const B: usize>(
    simd: S,
    weights: &[&[V::Memory]; B],
    k: usize,
) -> [V; B] {
    let mut loaded = [V::splat(simd, 0.0); B];
    for (vector, weights) in loaded.iter_mut().zip(weights) {
        // SAFETY: the caller's promise.
        *vector = V::load(simd, unsafe { weights.get_unchecked(k) });
    }
    loaded
}

/// sums(b) += values(k) weights(b, k). Not a closure, as above.
///
/// # Safety
/// k is less than the length of `values` and of every slice of weights.
#[inline(always)]
unsafe fn add_products<S: Simd, V: Vector<S>, const B: usize>(
    simd: S,
    sums: &mut [V; B],
    values: &[f32],
    weights: &[&[V::Memory]; B],
    k: usize,
) {
    // SAFETY: the caller's promise.
    let (value, weights) = unsafe { (*values.get_unchecked(k), loaded(simd, weights, k)) };
    let value = V::splat(simd, value);
    for (sum, weight) in sums.iter_mut().zip(weights) {
        *sum = sum.add_product(value, weight);
    }
}

#[cfg(test)]
mod tests {
    use super::{accumulate, accumulate_wide};
    use crate::isa::portable::Portable;
    use crate::lanes::{LANES, Lanes, Wide};

    const WEIGHT: [Lanes; 2] = [Lanes::ZERO; 2];

    fn sums<const R: usize>() -> [[[f32; LANES]; 1]; R] {
        [[[0.0; LANES]; 1]; R]
    }

    /// Three rows, of which the last would begin at 2 * 2^63, which wraps to 0.
    #[should_panic(expected = "there must be a value for each weight")]
    #[test]
    fn a_stride_that_wraps_is_refused() {
        accumulate::<_, _, 3, 1, 0, 1>(Portable, &mut sums(), &[0.0; 4], 1 << 63, [&WEIGHT]);
    }

    #[should_panic(expected = "there must be a value for each weight")]
    #[test]
    fn a_distance_of_rows_that_wraps_is_refused() {
        let weights = [Lanes::ZERO; 4 * LANES + 1];
        accumulate_wide::<_, _, 1, 1>(Portable, &mut sums(), &[Wide::ZERO; 4], 1 << 63, [&weights]);
    }
}
