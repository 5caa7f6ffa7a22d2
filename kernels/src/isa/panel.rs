//! The inner loops of all matrix products: a few rows of values times a few vectors of weights.
//!
//! Sizes are checked once, before the loop: checks inside the loop, and their registers, would
//! halve the speed.

use crate::isa::vector::{Simd, Sum, Vector};
use crate::lanes::{LANES, Wide};

const WIDE: usize = 2 * LANES;

/// acc(r, b) += sum of values(r stride + k) weights(b, k) for k from `FIRST` in steps of `STEP`,
/// ascending, each product rounded once with the sum.
///
/// # Panics
/// If the weights differ in length, or `values` is too short.
#[inline(always)]
pub fn accumulate<
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
    // SAFETY: every slice of weights has `count` elements; (R - 1) stride + count is at most the
    // length of `values`.
    unsafe {
        if !add_steps::<S, V::Sum, R, B, FIRST, STEP>(simd, acc, values, stride, weights) {
            add_steps::<S, V, R, B, FIRST, STEP>(simd, acc, values, stride, weights);
        }
    }
}

/// [`accumulate`] in the form A. Returns whether `acc` is right; if not, it is as before.
///
/// # Safety
/// Every slice of weights has the length of the first, and `values` has (R - 1) `stride` elements
/// plus that length.
#[inline(always)]
unsafe fn add_steps<
    S: Simd,
    A: Sum<S>,
    const R: usize,
    const B: usize,
    const FIRST: usize,
    const STEP: usize,
>(
    simd: S,
    acc: &mut [[A::Vector; B]; R],
    values: &[f32],
    stride: usize,
    weights: [&[Memory<S, A>]; B],
) -> bool {
    let (mut sums, mut doubt) = begin::<S, A, R, B>(simd, acc);
    let mut k = FIRST;
    while k < weights[0].len() {
        // SAFETY: k is less than the length of every slice of weights.
        let weights: [A::Factor; B] = unsafe { factors::<S, A, B>(simd, &weights, k, &mut doubt) };
        for (r, sums) in sums.iter_mut().enumerate() {
            // SAFETY: r <= R - 1 and k is less than the number of weights: within `values`.
            let value = *unsafe { values.get_unchecked(r * stride + k) };
            add_products(simd, sums, value, &weights, &mut doubt);
        }
        k += STEP;
    }
    end(&sums, doubt, acc)
}

/// acc(r, b) += sum over k < the weights' number, ascending, of values(k / 16 apart + r)[k mod 16]
/// weights(b, k), each product rounded once with the sum. The rows' constant distance is part of
/// the instructions, so that addresses need no registers.
///
/// # Panics
/// If the weights differ in length, or `values` is too short.
#[inline(always)]
pub fn accumulate_wide<S: Simd, V: Vector<S>, const R: usize, const B: usize>(
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
    // SAFETY: every slice of weights has `total` elements; there are R `values` for the last.
    unsafe {
        if !add_wide::<S, V::Sum, R, B>(simd, acc, values, apart, weights) {
            add_wide::<S, V, R, B>(simd, acc, values, apart, weights);
        }
    }
}

/// [`accumulate_wide`] in the form A, as [`add_steps`].
///
/// # Safety
/// Every slice of weights has the length of the first, n > 0, and `values` have
/// (n - 1) / 16 `apart` and R more.
#[inline(always)]
unsafe fn add_wide<S: Simd, A: Sum<S>, const R: usize, const B: usize>(
    simd: S,
    acc: &mut [[A::Vector; B]; R],
    values: &[Wide],
    apart: usize,
    weights: [&[Memory<S, A>]; B],
) -> bool {
    let total = weights[0].len();
    let (mut sums, mut doubt) = begin::<S, A, R, B>(simd, acc);
    let (mut first, mut at) = (0, 0);
    while first < total {
        let count = (total - first).min(WIDE);
        for k in 0..count {
            // SAFETY: first + k < total, the length of every slice of weights.
            let weights = unsafe { factors::<S, A, B>(simd, &weights, first + k, &mut doubt) };
            for (r, sums) in sums.iter_mut().enumerate() {
                // SAFETY: at = first / 16 apart, first <= total - 1, r < R: at + r < last; k < 16.
                let value = *unsafe { values.get_unchecked(at + r).0.get_unchecked(k) };
                add_products(simd, sums, value, &weights, &mut doubt);
            }
        }
        first += count;
        at += apart;
    }
    end(&sums, doubt, acc)
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
    // SAFETY: there is a value for each weight.
    unsafe {
        if !add_in_four::<S, V::Sum, B>(simd, acc, values, weights) {
            add_in_four::<S, V, B>(simd, acc, values, weights);
        }
    }
}

/// [`accumulate_in_four`] in the form A, as [`add_steps`].
///
/// # Safety
/// Every slice of weights has the length of `values`.
#[inline(always)]
unsafe fn add_in_four<S: Simd, A: Sum<S>, const B: usize>(
    simd: S,
    acc: &mut [[A::Vector; B]; 4],
    values: &[f32],
    weights: [&[Memory<S, A>]; B],
) -> bool {
    let count = values.len();
    let (mut sums, mut doubt) = begin::<S, A, 4, B>(simd, acc);
    let mut k = 0;
    while k + 4 <= count {
        for (p, sums) in sums.iter_mut().enumerate() {
            // SAFETY: k + p < k + 4 <= count, the length of `values` and of every slice of weights.
            let (value, weights) = unsafe {
                (*values.get_unchecked(k + p), factors::<S, A, B>(simd, &weights, k + p, &mut doubt))
            };
            add_products(simd, sums, value, &weights, &mut doubt);
        }
        k += 4;
    }
    for (p, sums) in sums.iter_mut().enumerate().take(count - k) {
        // SAFETY: p < count - k.
        let (value, weights) =
            unsafe { (*values.get_unchecked(k + p), factors::<S, A, B>(simd, &weights, k + p, &mut doubt)) };
        add_products(simd, sums, value, &weights, &mut doubt);
    }
    end(&sums, doubt, acc)
}

/// Representation of vectors of A in memory.
type Memory<S, A> = <<A as Sum<S>>::Vector as Vector<S>>::Memory;

/// Sums in the form A that begin at `acc`: a local variable of the caller, so that they stay in
/// registers.
#[inline(always)]
pub(crate) fn begin<S: Simd, A: Sum<S>, const R: usize, const B: usize>(
    simd: S,
    acc: &[[A::Vector; B]; R],
) -> ([[A; B]; R], A::Doubt) {
    let mut doubt = A::no_doubt(simd);
    let mut sums = [[A::from_vector(simd, A::Vector::splat(simd, 0.0), &mut doubt); B]; R];
    for (sum, &acc) in sums.as_flattened_mut().iter_mut().zip(acc.as_flattened()) {
        *sum = A::from_vector(simd, acc, &mut doubt);
    }
    (sums, doubt)
}

/// Writes the sums to `acc` if they are right, and returns whether they are.
#[inline(always)]
pub(crate) fn end<S: Simd, A: Sum<S>, const R: usize, const B: usize>(
    sums: &[[A; B]; R],
    doubt: A::Doubt,
    acc: &mut [[A::Vector; B]; R],
) -> bool {
    if !A::is_right(doubt) {
        return false;
    }
    for (acc, sum) in acc.as_flattened_mut().iter_mut().zip(sums.as_flattened()) {
        *acc = sum.to_vector();
    }
    true
}

/// weights(b, k) of every b. Does not use `map`: if its closure is not inlined, the instructions in
/// it are not either.
///
/// # Safety
/// k is less than the length of every slice of weights.
#[inline(always)]
unsafe fn factors<S: Simd, A: Sum<S>, const B: usize>(
    simd: S,
    weights: &[&[Memory<S, A>]; B],
    k: usize,
    doubt: &mut A::Doubt,
) -> [A::Factor; B] {
    let mut factors = [A::factor(simd, A::Vector::splat(simd, 0.0), doubt); B];
    for (factor, weights) in factors.iter_mut().zip(weights) {
        // SAFETY: the caller's promise.
        let weights = A::Vector::load(simd, unsafe { weights.get_unchecked(k) });
        *factor = A::factor(simd, weights, doubt);
    }
    factors
}

/// sums(b) += value weights(b). Not a closure, as above.
#[inline(always)]
fn add_products<S: Simd, A: Sum<S>, const B: usize>(
    simd: S,
    sums: &mut [A; B],
    value: f32,
    weights: &[A::Factor; B],
    doubt: &mut A::Doubt,
) {
    let value = A::factor_of_all(simd, value, doubt);
    for (sum, &weight) in sums.iter_mut().zip(weights) {
        *sum = sum.plus_product(value, weight, doubt);
    }
}

/// Taps of a 3 x 3 window: row dy, column dx, channel c is at `c plane + dy stride + dx`.
#[derive(Clone, Copy, Debug)]
pub struct Taps<'a> {
    /// Values, from the first tap of the first position on.
    pub values: &'a [f32],
    /// Distance between rows in values.
    pub stride: usize,
    /// Distance between channels in values.
    pub plane: usize,
}

/// acc(o, b) += sum over channels, rows and columns of the window, ascending, of weights(tap, o)
/// values(tap + b), each product rounded once with the sum. `weights`: (channels x 9, O).
///
/// # Panics
/// If `weights` are not whole windows, or there are too few values.
#[inline(always)]
pub fn accumulate_taps<S: Simd, V: Vector<S>, const O: usize, const B: usize>(
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
    // SAFETY: the number of weights is a multiple of nine, and there are values for the last.
    unsafe {
        if !add_taps::<S, V::Sum, O, B>(simd, acc, taps, weights) {
            add_taps::<S, V, O, B>(simd, acc, taps, weights);
        }
    }
}

/// [`accumulate_taps`] in the form A, as [`add_steps`].
///
/// # Safety
/// There are nine `weights` for each of some channels, and for the last channel B vectors of values
/// from the window's last place on.
#[inline(always)]
unsafe fn add_taps<S: Simd, A: Sum<S>, const O: usize, const B: usize>(
    simd: S,
    acc: &mut [[A::Vector; B]; O],
    Taps { values, stride, plane }: Taps<'_>,
    weights: &[[f32; O]],
) -> bool {
    let lanes = A::Vector::LANES;
    let (mut sums, mut doubt) = begin::<S, A, O, B>(simd, acc);
    let (mut channel, mut k) = (0, 0);
    while k < weights.len() {
        let mut row = channel;
        for _ in 0..3 {
            for dx in 0..3 {
                // Does not use `from_fn`: if its closure is not inlined, the instructions in it are
                // not either.
                let mut x = [A::factor(simd, A::Vector::splat(simd, 0.0), &mut doubt); B];
                for (b, x) in x.iter_mut().enumerate() {
                    let at = row + dx + b * lanes;
                    // SAFETY: `row` <= (channels - 1) plane + 2 stride, dx <= 2: within `values`.
                    let values = unsafe { values.get_unchecked(at..at + lanes) };
                    *x = A::factor(simd, A::Vector::load_slice(simd, values), &mut doubt);
                }
                // SAFETY: k counts nine weights per iteration of the outer loop, and their number
                // is a multiple of nine.
                let weights = unsafe { weights.get_unchecked(k) };
                for (sums, &weight) in sums.iter_mut().zip(weights) {
                    let weight = A::factor_of_all(simd, weight, &mut doubt);
                    for (sum, &x) in sums.iter_mut().zip(&x) {
                        *sum = sum.plus_product(weight, x, &mut doubt);
                    }
                }
                k += 1;
            }
            row += stride;
        }
        channel += plane;
    }
    end(&sums, doubt, acc)
}
