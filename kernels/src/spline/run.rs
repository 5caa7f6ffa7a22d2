//! The rows of a spline block: sums per slot, weights, root, bias, ELU, batch norm, skip.

use std::hint::black_box;
use std::ops::Range;

use crate::elementary::elus;
use crate::graph::GraphRow;
use crate::isa::{Exponent, Isa, Simd, Stored, Task, Vector, accumulate, accumulate_in_four, flat, flat_mut};
use crate::lanes::{LANES, Lanes, Wide};
use crate::matrix::Matrix;
use crate::packed::Packed;
use crate::spline::SplineConv;
use crate::spline::gather::{SplineScratch, TOTALS, any_slots, eight_slots, eight_slots_of_few_channels};

/// Number of registers that are finished together, interleaved.
const STEP: usize = 4;

/// Whether a vector in the form M is one register, so that eight sums leave some for weights.
#[inline(always)]
fn is_one_register<S: Simd, M: Stored>() -> bool {
    S::WIDE || M::Of::<S>::LANES == LANES
}

struct Run<'a> {
    conv: &'a SplineConv,
    features: &'a Matrix,
    rows: &'a [GraphRow<'a>],
    scratch: &'a mut SplineScratch,
    out: &'a mut [Lanes],
}

impl Task for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { conv, features, rows, scratch, out } = self;
        let lanes = conv.affine.bias.len();
        assert_eq!(features.columns(), conv.inputs, "features must have the block's input channels");
        assert_eq!(out.len(), rows.len() * lanes, "the output must have the block's output channels");
        if conv.is_flat() {
            let groups = rows.chunks(SplineConv::GROUP);
            for (rows, out) in groups.zip(out.chunks_mut(SplineConv::GROUP * lanes)) {
                conv.group(simd, features, rows, scratch, out);
            }
        } else {
            for (row, out) in rows.iter().zip(out.chunks_mut(lanes)) {
                any_slots(simd, conv.kernel, row.neighbours, features, scratch);
                conv.touched(simd, row, scratch, out);
            }
        }
    }
}

impl SplineConv {
    /// Computes rows, each as if alone; together they share loaded weights. Fastest in groups of
    /// [`Self::GROUP`].
    ///
    /// `features` is (rows, C); `out` holds the rows' O values in lanes, one row after the other.
    ///
    /// # Panics
    /// If a row or a slice does not have the sizes of this block.
    pub fn rows(
        &self,
        isa: Isa,
        features: &Matrix,
        rows: &[GraphRow<'_>],
        scratch: &mut SplineScratch,
        out: &mut [Lanes],
    ) {
        isa.run(Run { conv: self, features, rows, scratch, out });
    }

    /// Computes a few rows whose sums have no gap.
    #[inline(always)]
    fn group<S: Simd>(
        &self,
        simd: S,
        features: &Matrix,
        rows: &[GraphRow<'_>],
        scratch: &mut SplineScratch,
        out: &mut [Lanes],
    ) {
        let stride = self.sums() / Self::GROUP;
        let SplineScratch { basis, sums, totals: (wide, last), .. } = scratch;
        sums.resize(sums.len().max(Self::GROUP * stride), Lanes::ZERO);
        wide.resize(TOTALS, Wide::ZERO);
        last.resize(TOTALS, Lanes::ZERO);
        for (row, sums) in rows.iter().zip(sums.chunks_mut(stride)) {
            let n = row.neighbours;
            match self.inputs {
                1 => eight_slots_of_few_channels::<S, 1>(simd, n, features, sums),
                2 => eight_slots_of_few_channels::<S, 2>(simd, n, features, sums),
                3 => eight_slots_of_few_channels::<S, 3>(simd, n, features, sums),
                4 => eight_slots_of_few_channels::<S, 4>(simd, n, features, sums),
                _ => eight_slots(simd, row, features, basis, sums),
            }
        }
        let sums = Sums { values: flat(sums), stride: stride * LANES };
        let mut lane = 0;
        while S::WIDE && lane + 4 <= self.affine.bias.len() {
            let block =
                Block { conv: self, rows, sums, lane, weights: [self.wide(lane), self.wide(lane + 2)] };
            block.run(simd, wide, out);
            lane += 4;
        }
        while lane + 2 <= self.affine.bias.len() {
            let block = Block { conv: self, rows, sums, lane, weights: [self.wide(lane)] };
            block.run(simd, wide, out);
            lane += 2;
        }
        if lane < self.affine.bias.len() {
            let block = Block { conv: self, rows, sums, lane, weights: [self.last()] };
            block.run(simd, last, out);
        }
    }

    /// Computes one row with only some slots touched.
    #[inline(always)]
    fn touched<S: Simd>(&self, simd: S, row: &GraphRow<'_>, scratch: &SplineScratch, out: &mut [Lanes]) {
        let mut lane = 0;
        while lane + 2 <= self.affine.bias.len() {
            self.touched_block(simd, row, scratch, self.wide(lane), lane, out);
            lane += 2;
        }
        if lane < self.affine.bias.len() {
            self.touched_block(simd, row, scratch, self.last(), lane, out);
        }
    }

    /// The outputs from lane `lane`.
    #[inline(always)]
    fn touched_block<S: Simd, M: Stored>(
        &self,
        simd: S,
        row: &GraphRow<'_>,
        scratch: &SplineScratch,
        weights: Weights<'_, M>,
        lane: usize,
        out: &mut [Lanes],
    ) {
        let stride = Lanes::count(self.inputs) * LANES;
        let mut acc: Partial<M::Of<S>, 1> = [[M::Of::splat(simd, 0.0)]; 4];
        for &slot in &scratch.touched {
            let (first, slot) = (slot as usize * self.inputs, slot as usize);
            let values = &flat(&scratch.sums)[slot * stride..][..self.inputs];
            contract_from(simd, &mut acc, values, &weights.sums[first..], first % 4);
        }
        let mut sum = M::Of::<S>::ZEROS;
        total(&acc)[0].store(&mut sum);
        let rows = std::slice::from_ref(row);
        simd.apart(Finish { conv: self, rows, totals: &[sum], step: 1, weights, lane, out });
    }

    /// Applies the steps after the sums of the first N rows, for the outputs from lane `lane`.
    #[inline(always)]
    fn finish<S: Simd, V: Exponent<S>, const N: usize>(
        &self,
        simd: S,
        sums: [V; N],
        weights: Weights<'_, V::Memory>,
        rows: &[GraphRow<'_>],
        lane: usize,
        out: &mut [Lanes],
    ) {
        let (at, lanes) = (lane * LANES, self.affine.bias.len());
        let load = |lanes: &[Lanes]| V::load_slice(simd, &flat(lanes)[at..]);
        let mut ys = sums;
        for (y, row) in ys.iter_mut().zip(rows) {
            let degree = row.neighbours.len();
            let inverse = if degree == 0 { 0.0 } else { 1.0 / degree as f32 };
            *y = y.mul(V::splat(simd, inverse));
            if let Some(root) = weights.root {
                let mut acc: Partial<V, 1> = [[V::splat(simd, 0.0)]; 4];
                accumulate_in_four(simd, &mut acc, &flat(row.own)[..self.inputs], [root]);
                *y = y.add(total(&acc)[0]);
            }
            *y = y.add(load(&self.affine.bias));
        }
        if self.elu {
            ys = elus(simd, ys);
        }
        for ((y, row), out) in ys.into_iter().zip(rows).zip(out.chunks_mut(lanes)) {
            let mut y = load(&self.affine.shift).add_product(y, load(&self.affine.scale));
            if let Some(skip) = row.skip {
                y = y.add(load(skip));
            }
            y.store_slice(&mut flat_mut(out)[at..]);
        }
    }

    /// The weights of the sixteen outputs from lane `lane`, which is even.
    #[inline(always)]
    fn wide(&self, lane: usize) -> Weights<'_, Wide> {
        Weights { sums: self.weight.wide(lane), root: self.root.as_ref().map(|root| root.wide(lane)) }
    }

    /// The weights of a single last lane of outputs.
    #[inline(always)]
    fn last(&self) -> Weights<'_, Lanes> {
        Weights { sums: self.weight.last(), root: self.root.as_ref().map(Packed::last) }
    }
}

/// The weights of one block of outputs: on the sums, and on the row itself.
#[derive(Clone, Copy)]
struct Weights<'a, M> {
    sums: &'a [M],
    root: Option<&'a [M]>,
}

#[derive(Clone, Copy)]
struct Sums<'a> {
    values: &'a [f32],
    stride: usize,
}

struct Block<'a, M, const B: usize> {
    conv: &'a SplineConv,
    rows: &'a [GraphRow<'a>],
    sums: Sums<'a>,
    lane: usize,
    weights: [Weights<'a, M>; B],
}

impl<M: Stored, const B: usize> Block<'_, M, B> {
    /// Computes every row, in tiles as large as registers allow, possibly beyond the last row.
    #[inline(always)]
    fn run<S: Simd>(&self, simd: S, totals: &mut [M], out: &mut [Lanes]) {
        let mut row = 0;
        if is_one_register::<S, M>() && self.rows.len() > 4 {
            self.tile::<S, 8>(simd, row, totals, out);
            return;
        }
        while row + 1 < self.rows.len() {
            self.tile::<S, 4>(simd, row, totals, out);
            row += 4;
        }
        if row < self.rows.len() {
            let mut acc: Partial<M::Of<S>, B> = [[M::Of::splat(simd, 0.0); B]; 4];
            let values = &self.sums.values[row * self.sums.stride..][..self.sums.stride];
            accumulate_in_four(simd, &mut acc, values, self.weights.map(|w| w.sums));
            for (sum, total) in total(&acc).into_iter().zip(&mut *totals) {
                sum.store(total);
            }
            self.finish(simd, row..row + 1, totals, out);
        }
    }

    /// Computes the existing rows of `row..row + R`.
    #[inline(always)]
    fn tile<S: Simd, const R: usize>(&self, simd: S, row: usize, totals: &mut [M], out: &mut [Lanes]) {
        let Sums { values, stride } = self.sums;
        let weights = self.weights.map(|w| w.sums);
        simd.apart(ContractRows::<M, R, B> { values: &values[row * stride..], stride, weights, totals });
        let end = self.rows.len().min(row + R);
        self.finish(simd, row..end, totals, out);
    }

    /// Applies the steps after the sums to rows, whose B totals each are in `totals`.
    #[inline(always)]
    fn finish<S: Simd>(&self, simd: S, rows: Range<usize>, totals: &[M], out: &mut [Lanes]) {
        let out = &mut out[rows.start * self.conv.affine.bias.len()..];
        for (b, &weights) in self.weights.iter().enumerate() {
            let (rows, lane) = (&self.rows[rows.clone()], self.lane + b * M::Of::<S>::LANES / LANES);
            let totals = &totals[b..];
            simd.apart(Finish { conv: self.conv, rows, totals, step: B, weights, lane, out });
        }
    }
}

/// The steps after the sums of rows, for the outputs from lane `lane`. Total r is `r step`. Run it
/// [as a separate function](Simd::apart): it is long, and equal for all tiles.
struct Finish<'a, M> {
    conv: &'a SplineConv,
    rows: &'a [GraphRow<'a>],
    totals: &'a [M],
    step: usize,
    weights: Weights<'a, M>,
    lane: usize,
    out: &'a mut [Lanes],
}

impl<M: Stored> Task for Finish<'_, M> {
    type Output = ();

    /// Rows are interleaved: the steps after a sum are one long chain of operations.
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        let whole = if is_one_register::<S, M>() {
            self.interleaved::<S, STEP>(simd)
        } else {
            self.interleaved::<S, { STEP / 2 }>(simd)
        };
        let Self { conv, rows, totals, step, weights, lane, out } = self;
        for r in whole..rows.len() {
            let sum = M::Of::load(simd, &totals[r * step]);
            conv.finish(simd, [sum], weights, &rows[r..], lane, &mut out[r * conv.affine.bias.len()..]);
        }
    }
}

impl<M: Stored> Finish<'_, M> {
    /// Finishes N rows at a time; returns how many.
    #[inline(always)]
    fn interleaved<S: Simd, const N: usize>(&mut self, simd: S) -> usize {
        let Self { conv, rows, totals, step, weights, lane, ref mut out } = *self;
        let whole = rows.len() - rows.len() % N;
        for r in (0..whole).step_by(N) {
            let sums = std::array::from_fn::<_, N, _>(|i| M::Of::load(simd, &totals[(r + i) * step]));
            conv.finish(simd, sums, weights, &rows[r..], lane, &mut out[r * conv.affine.bias.len()..]);
        }
        whole
    }
}

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
/// which has room for twice as many. Run it [as a separate function](Simd::apart).
pub(super) struct ContractRows<'a, M, const R: usize, const B: usize> {
    pub(super) values: &'a [f32],
    pub(super) stride: usize,
    pub(super) weights: [&'a [M]; B],
    pub(super) totals: &'a mut [M],
}

impl<M: Stored, const R: usize, const B: usize> Task for ContractRows<'_, M, R, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { values, stride, weights, totals } = self;
        let (first, last) = totals[..2 * R * B].split_at_mut(R * B);
        let zero = [[M::Of::splat(simd, 0.0); B]; R];
        // Each partial sum is written before the next is computed, because both would compete for
        // registers; a value that the compiler knows would occupy a register during the loop.
        let mut acc = zero;
        accumulate::<S, M::Of<S>, R, B, 0, 4>(simd, &mut acc, values, stride, weights);
        each(&acc, first, Vector::store);
        let first = black_box(first);
        acc = zero;
        accumulate::<S, M::Of<S>, R, B, 1, 4>(simd, &mut acc, values, stride, weights);
        each(&acc, first, |sum, at| M::Of::load(simd, at).add(sum).store(at));
        acc = zero;
        accumulate::<S, M::Of<S>, R, B, 2, 4>(simd, &mut acc, values, stride, weights);
        each(&acc, last, Vector::store);
        let last = black_box(last);
        acc = zero;
        accumulate::<S, M::Of<S>, R, B, 3, 4>(simd, &mut acc, values, stride, weights);
        each(&acc, last, |sum, at| M::Of::load(simd, at).add(sum).store(at));
        for (first, last) in first.iter_mut().zip(last) {
            M::Of::load(simd, first).add(M::Of::load(simd, last)).store(first);
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
