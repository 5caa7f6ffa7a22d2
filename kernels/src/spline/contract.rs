//! a(p, o) = sum of v(i) W(i, o) over i mod 4 = p, ascending: products of rows with weights.
//!
//! For a single row, four partial sums per output keep the arithmetic units busy. Several rows
//! compute one partial sum after the other, and share each loaded weight.

use std::hint::black_box;

use crate::isa::{Simd, Task, Vector, accumulate, accumulate_in_four};
use crate::lanes::{Lanes, Wide};

/// Partial sums of B vectors of outputs.
pub(super) type Partial<V, const B: usize> = [[V; B]; 4];

/// Adds the products of `values` with a block of weights; the first `i` mod 4 is `phase`.
#[inline(always)]
pub(super) fn contract_from<S: Simd, V: Vector<S>>(
    simd: S,
    acc: &mut Partial<V, 1>,
    values: &[f32],
    weight: &[V::Memory],
    phase: usize,
) {
    acc.rotate_left(phase);
    accumulate_in_four(simd, acc, values, [&weight[..values.len()]]);
    acc.rotate_right(phase);
}

/// (a0 + a1) + (a2 + a3).
#[inline(always)]
pub(super) fn total<S: Simd, V: Vector<S>, const B: usize>(acc: &Partial<V, B>) -> [V; B] {
    let mut out = acc[0];
    for (b, out) in out.iter_mut().enumerate() {
        *out = acc[0][b].add(acc[1][b]).add(acc[2][b].add(acc[3][b]));
    }
    out
}

/// Totals of R rows, `stride` values apart, over B blocks of weights: (R, B) vectors in `totals`,
/// which has twice the room. Run it [as a separate function](Simd::apart).
pub(super) struct ContractRows<'a, M, const R: usize, const B: usize> {
    pub(super) values: &'a [f32],
    pub(super) stride: usize,
    pub(super) weights: [&'a [M]; B],
    pub(super) totals: &'a mut [M],
}

impl<const R: usize, const B: usize> Task for ContractRows<'_, Wide, R, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        self.contract::<S, S::V16>(simd);
    }
}

impl<const R: usize, const B: usize> Task for ContractRows<'_, Lanes, R, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        self.contract::<S, S::V8>(simd);
    }
}

impl<M, const R: usize, const B: usize> ContractRows<'_, M, R, B> {
    #[inline(always)]
    fn contract<S: Simd, V: Vector<S, Memory = M>>(self, simd: S) {
        let Self { values, stride, weights, totals } = self;
        let (first, last) = totals[..2 * R * B].split_at_mut(R * B);
        let zero = [[V::splat(simd, 0.0); B]; R];
        // Each partial sum is written before the next, as both would compete for registers; a value
        // that the compiler knew would stay in one during the loop.
        let mut acc = zero;
        accumulate::<S, V, R, B, 0, 4>(simd, &mut acc, values, stride, weights);
        each(&acc, first, Vector::store);
        let first = black_box(first);
        acc = zero;
        accumulate::<S, V, R, B, 1, 4>(simd, &mut acc, values, stride, weights);
        each(&acc, first, |sum, at| V::load(simd, at).add(sum).store(at));
        acc = zero;
        accumulate::<S, V, R, B, 2, 4>(simd, &mut acc, values, stride, weights);
        each(&acc, last, Vector::store);
        let last = black_box(last);
        acc = zero;
        accumulate::<S, V, R, B, 3, 4>(simd, &mut acc, values, stride, weights);
        each(&acc, last, |sum, at| V::load(simd, at).add(sum).store(at));
        for (first, last) in first.iter_mut().zip(last) {
            V::load(simd, first).add(V::load(simd, last)).store(first);
        }
    }
}

/// Calls `f` with every sum and its index.
#[inline(always)]
fn each<V: Copy, M, const R: usize, const B: usize>(
    acc: &[[V; B]; R],
    places: &mut [M],
    f: impl Fn(V, &mut M),
) {
    for (&sum, place) in acc.as_flattened().iter().zip(places) {
        f(sum, place);
    }
}
