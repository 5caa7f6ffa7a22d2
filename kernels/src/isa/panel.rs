//! The inner loops of every product of matrices: a few rows of values times a few vectors of weights.
//!
//! Their sizes are checked once, before the loop: checks inside it, and the registers that they take, cost half of the
//! speed.

use super::{Simd, Vector};

/// acc(r, b) += sum over k of values(r stride + k) weights(b, k), where k goes from `FIRST` in steps of `STEP`,
/// ascending, and each product is rounded once with the sum.
///
/// # Panics
/// If the weights differ in length, or `values` ends before the last that is read.
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
    assert!((R - 1) * stride + count <= values.len(), "there must be a value for each weight");
    // Local, so that they are registers.
    let mut sums = *acc;
    let mut k = FIRST;
    while k < count {
        // SAFETY: k < count, the length of every slice of weights.
        let weights = weights.map(|w| V::load(simd, unsafe { w.get_unchecked(k) }));
        for (r, sums) in sums.iter_mut().enumerate() {
            // SAFETY: r <= R - 1 and k < count, so the index is below (R - 1) stride + count, within `values`.
            let value = V::splat(simd, *unsafe { values.get_unchecked(r * stride + k) });
            for (sum, &weight) in sums.iter_mut().zip(&weights) {
                *sum = sum.add_product(value, weight);
            }
        }
        k += STEP;
    }
    *acc = sums;
}

/// acc(p, b) += sum over k with k mod 4 = p of values(k) weights(b, k): one row in four partial sums.
///
/// # Panics
/// If the weights and the values differ in length.
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
    let step = |sums: &mut [V; B], k: usize| {
        // SAFETY: called for k < count alone, the length of `values` and of every slice of weights.
        let value = V::splat(simd, *unsafe { values.get_unchecked(k) });
        for (sum, weights) in sums.iter_mut().zip(weights) {
            // SAFETY: as above.
            *sum = sum.add_product(value, V::load(simd, unsafe { weights.get_unchecked(k) }));
        }
    };
    let mut k = 0;
    while k + 4 <= count {
        for (p, sums) in sums.iter_mut().enumerate() {
            step(sums, k + p);
        }
        k += 4;
    }
    for (p, sums) in sums.iter_mut().enumerate().take(count - k) {
        step(sums, k + p);
    }
    *acc = sums;
}
