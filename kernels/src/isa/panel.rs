//! The inner loops of all matrix products: a few rows of values times a few vectors of weights.
//!
//! Sizes are checked once, before the loop: checks inside, and their registers, would halve the
//! speed.

use crate::isa::vector::{Simd, Vector};
use crate::lanes::{LANES, Wide};

const WIDE: usize = 2 * LANES;

/// acc(r, b) += sum of values(r stride + k) weights(b, k) for k from `FIRST` in steps of `STEP`,
/// ascending, each product rounded once with the sum. Panics if the weights differ in length, or
/// `values` is too short.
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
/// the instructions, so that addresses need no registers. Panics if the weights differ in length,
/// or `values` is too short.
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
/// Panics if weights and values differ in length.
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

/// Taps of a 3 x 3 window: row dy, column dx, channel c is at `c plane + dy stride + dx`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Taps<'a> {
    /// Values, from the first tap of the first position on.
    pub(crate) values: &'a [f32],
    /// Distance between rows in values.
    pub(crate) stride: usize,
    /// Distance between channels in values.
    pub(crate) plane: usize,
}

/// acc(o, b) += sum over channels, rows and columns of the window, ascending, of weights(tap, o)
/// values(tap + b), each product rounded once with the sum. `weights`: (channels x 9, O). Panics if
/// `weights` are not whole windows, or there are too few values.
#[inline(always)]
pub(crate) fn accumulate_taps<S: Simd, V: Vector<S>, const O: usize, const B: usize>(
    simd: S,
    acc: &mut [[V; B]; O],
    taps: Taps<'_>,
    weights: &[[f32; O]],
) {
    let Taps { values, stride, plane } = taps;
    if weights.is_empty() {
        return;
    }
    assert!(weights.len().is_multiple_of(9), "there must be a weight for each tap");
    let last = plane.checked_mul(weights.len() / 9 - 1).zip(stride.checked_mul(2));
    let end = last.and_then(|(plane, rows)| plane.checked_add(rows)?.checked_add(2 + B * V::LANES));
    assert!(end.is_some_and(|end| end <= values.len()), "there must be a value for each tap");
    // A local variable, so that it stays in registers.
    let mut sums = *acc;
    let (mut channel, mut k) = (0, 0);
    while k < weights.len() {
        let mut row = channel;
        for _ in 0..3 {
            for dx in 0..3 {
                // Not by `from_fn`: where a closure stays a call, so do the instructions in it.
                let mut x = [V::splat(simd, 0.0); B];
                for (b, x) in x.iter_mut().enumerate() {
                    let at = row + dx + b * V::LANES;
                    // SAFETY: `row` <= (channels - 1) plane + 2 stride and dx <= 2: at + LANES <=
                    // `end`, within `values`.
                    *x = V::load_slice(simd, unsafe { values.get_unchecked(at..at + V::LANES) });
                }
                // SAFETY: k counts nine weights a turn of the outer loop, and their number is a
                // multiple of nine.
                let weights = unsafe { weights.get_unchecked(k) };
                for (sums, &weight) in sums.iter_mut().zip(weights) {
                    let weight = V::splat(simd, weight);
                    for (sum, &x) in sums.iter_mut().zip(&x) {
                        *sum = sum.add_product(weight, x);
                    }
                }
                k += 1;
            }
            row += stride;
        }
        channel += plane;
    }
    *acc = sums;
}
