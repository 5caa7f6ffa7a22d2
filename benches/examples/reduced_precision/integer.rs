//! The row in integers.
//!
//! ```text
//! x' = round(x / X)            X: largest |x| of the layer over 127 (i8) or 32767 (i16)
//! B' = round(B 2^k)            k = 7 with i8, 11 with i16
//! S' = sum of B' x'            exact in i32
//! T' = round(S' / 2^h)         what the weights see: i16, or seven bits; 2^h from the largest |S'| there is
//! a' = sum of T' W'            exact in i32; W' = round(W / w(o)), w(o): largest |W| of the output over 127 or 2047
//! y' = round(y(a') / Y)        y(a'): back to f32 with one factor an output, ELU and batch norm there
//! ```

use std::arch::x86_64::__m512i;
use std::marker::PhantomData;

use meissner_kernels::{Isa, Lanes, Matrix, Neighbour, Simd, Task, Vector, Wide};
use pulp::x86::V4;

use crate::float::{Finish, Stage, blocks, steps};
use crate::problem::{GROUP, Problem, ROWS};
use crate::vectors::{Dot, Pairs, Words, interleave, shift_right, splat};

/// Two in-edges: rows, and for each slot the weights of both.
#[derive(Clone, Copy)]
pub(crate) struct EdgePair {
    pub(crate) rows: [u32; 2],
    pub(crate) basis: [[i16; 2]; 8],
}

/// Width of the activations.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Width {
    I8,
    I16,
}

impl Width {
    pub(crate) fn largest(self) -> f32 {
        if self == Self::I8 { 127.0 } else { 32_767.0 }
    }

    /// k.
    pub(crate) fn basis_bits(self) -> u32 {
        if self == Self::I8 { 7 } else { 11 }
    }
}

/// C -> 16 B channels.
pub(crate) struct IntegerRows<const C: usize, const B: usize> {
    pub(crate) v: V4,
    /// x', padded to sixteen channels.
    pub(crate) features: Vec<i16>,
    pub(crate) pairs: Vec<EdgePair>,
    /// Pairs of a row.
    pub(crate) per_row: usize,
    /// h.
    shift: u32,
    /// (block, input) words.
    weights: Vec<Words>,
    pub(crate) finish: Finish,
    /// T' of a group.
    sums: Vec<i32>,
    /// S' of every row, sixteen channels of a slot after the other, where sums are updated.
    pub(crate) state: Vec<[i32; 16]>,
    totals: Vec<[i32; 16]>,
    out: Vec<i16>,
    /// Y.
    step: f32,
}

/// Channels of a stored row.
pub(crate) const fn padded(channels: usize) -> usize {
    if channels < 16 { 16 } else { channels }
}

/// round(value / step).
pub(crate) fn quantised(value: f32, step: f32) -> i32 {
    (value / step).round_ties_even() as i32
}

impl<const C: usize, const B: usize> IntegerRows<C, B> {
    /// Words of S' of a row, in vectors.
    pub(crate) const STATE: usize = 8 * padded(C) / 16;

    /// Quantises `problem`, whose answer in f32 is `expected`.
    pub(crate) fn new<D: Dot>(v: V4, problem: &Problem, width: Width, expected: &Matrix) -> Self {
        let input = problem.largest_input() / width.largest();
        let mut features = vec![0; problem.features.rows() * padded(C)];
        for (row, to) in features.chunks_exact_mut(padded(C)).enumerate() {
            let values = problem.features.slice(row);
            to.iter_mut().zip(values).for_each(|(to, &x)| *to = quantised(x, input) as i16);
        }
        let unit = 2f32.powi(-(width.basis_bits() as i32));
        let edges = problem.edges.as_chunks::<2>().0.iter().zip(problem.basis.as_chunks::<2>().0);
        let pairs: Vec<EdgePair> = edges.map(|(n, b)| pair(n, b, unit)).collect();
        let per_row = problem.degree / 2;
        let largest = pairs.chunks(per_row).flat_map(|row| scalar_sums::<C>(&features, row));
        let largest = largest.map(i32::unsigned_abs).max().unwrap_or(0);
        let shift = (0..32).find(|h| largest >> h < D::LARGEST as u32).expect("a shift that fits");
        let weight_steps = steps(problem, Some(D::WEIGHT));
        let column = |o: usize| problem.parts.weight[o..].iter().step_by(problem.outputs);
        let integers = |o: usize| column(o).map(|&w| quantised(w, weight_steps[o])).collect::<Vec<i32>>();
        let columns: Vec<Vec<i32>> = (0..problem.outputs).map(integers).collect();
        let words = |(b, i): (usize, usize)| {
            Words(std::array::from_fn(|o| D::word(&columns[16 * b + o][i * D::DEPTH..][..D::DEPTH])))
        };
        let inputs = (0..B).flat_map(|b| (0..8 * C / D::DEPTH).map(move |i| (b, i)));
        let scale = input * unit * 2f32.powi(shift as i32);
        let sum_steps: Vec<f32> = weight_steps.iter().map(|w| w * scale).collect();
        let mut finish = Finish::new(problem, &sum_steps);
        // What the zero of stored sums adds to a total.
        for (o, column) in columns.iter().enumerate() {
            let over = (D::ZERO * column.iter().sum::<i32>()) as f32;
            finish.bias[o / 16].0[o % 16] -= over * finish.factor[o / 16].0[o % 16];
        }
        let step =
            expected.lanes().iter().flat_map(|l| l.0).fold(0f32, |m, y| m.max(y.abs())) / width.largest();
        for values in [&mut finish.scale, &mut finish.shift] {
            let stepped: Vec<f32> = values.iter().flat_map(|w| w.0).map(|s| s / step).collect();
            *values = blocks(&stepped);
        }
        Self {
            v,
            features,
            pairs,
            per_row,
            shift,
            weights: inputs.map(words).collect(),
            finish,
            sums: vec![0; GROUP * 8 * C / D::DEPTH],
            state: Vec::new(),
            totals: vec![[0; 16]; GROUP * B],
            out: vec![0; ROWS * 16 * B],
            step,
        }
    }

    /// Computes `stage` of every row, its sums from nothing or, where there is a state, from that.
    pub(crate) fn run<D: Dot>(&mut self, stage: Stage) {
        Isa::best().run(Run::<D, C, B> { rows: self, stage, dot: PhantomData });
    }

    /// Y y'.
    pub(crate) fn values(&self) -> Matrix {
        let values: Vec<f32> = self.out.iter().map(|&y| f32::from(y) * self.step).collect();
        Matrix::from_rows(16 * B, &values)
    }

    /// S' of every row from nothing, by plain loops.
    pub(crate) fn scalar_state(&self) -> Vec<i32> {
        self.pairs.chunks(self.per_row).flat_map(|row| scalar_sums::<C>(&self.features, row)).collect()
    }

    /// S' as [`Self::scalar_state`] has it.
    pub(crate) fn state_values(&self) -> Vec<i32> {
        let slots = self.state.as_flattened().chunks_exact(padded(C)).flat_map(|slot| &slot[..C]);
        slots.copied().collect()
    }

    /// T' of a group.
    #[inline(always)]
    fn sums<D: Dot>(&mut self, first: usize) {
        let v = self.v;
        let Self { features, pairs, per_row, shift, sums, state, .. } = self;
        let words = 8 * C / D::DEPTH;
        for (r, sums) in sums[..GROUP * words].chunks_exact_mut(words).enumerate() {
            let row = first + r;
            let pairs = &pairs[row * *per_row..][..*per_row];
            let state =
                if state.is_empty() { &mut [] } else { &mut state[row * Self::STATE..][..Self::STATE] };
            if C == 32 {
                sums_of_row::<D, 2, C>(v, features, pairs, state, *shift, sums);
            } else {
                sums_of_row::<D, 1, C>(v, features, pairs, state, *shift, sums);
            }
        }
    }
}

/// An in-edge pair's rows, and its basis in steps of `unit`.
fn pair(edges: &[Neighbour; 2], basis: &[Lanes; 2], unit: f32) -> EdgePair {
    let both = |s: usize| [basis[0].0[s], basis[1].0[s]].map(|b| quantised(b, unit) as i16);
    EdgePair { rows: edges.map(|n| n.row), basis: std::array::from_fn(both) }
}

/// S'(s, c) of a row, by plain loops.
fn scalar_sums<const C: usize>(features: &[i16], pairs: &[EdgePair]) -> Vec<i32> {
    let mut sums = vec![0; 8 * C];
    for pair in pairs {
        for (e, &row) in pair.rows.iter().enumerate() {
            let x = &features[row as usize * padded(C)..][..C];
            for (basis, sums) in pair.basis.iter().zip(sums.chunks_exact_mut(C)) {
                sums.iter_mut().zip(x).for_each(|(s, &x)| *s += i32::from(basis[e]) * i32::from(x));
            }
        }
    }
    sums
}

/// T' of one row into `sums`; S' is added to `state` and left there, where there is one.
#[inline(always)]
fn sums_of_row<D: Dot, const N: usize, const C: usize>(
    v: V4,
    features: &[i16],
    pairs: &[EdgePair],
    state: &mut [[i32; 16]],
    shift: u32,
    sums: &mut [i32],
) {
    let mut acc = [[splat(v, 0); N]; 8];
    for (acc, &from) in acc.as_flattened_mut().iter_mut().zip(&*state) {
        *acc = pulp::cast(from);
    }
    for pair in pairs {
        let rows = pair.rows.map(|row| &features[row as usize * padded(C)..][..padded(C)]);
        let mut x = [splat(v, 0); N];
        for (i, x) in x.iter_mut().enumerate() {
            *x = interleave(v, rows, 16 * i);
        }
        for (acc, &basis) in acc.iter_mut().zip(&pair.basis) {
            let basis = splat(v, pulp::cast(basis));
            for (acc, &x) in acc.iter_mut().zip(&x) {
                *acc = Pairs::dot(v, *acc, basis, x);
            }
        }
    }
    for (&acc, to) in acc.as_flattened().iter().zip(state) {
        *to = pulp::cast(acc);
    }
    let words = C.min(16) / D::DEPTH;
    for (&acc, to) in acc.as_flattened().iter().zip(sums.chunks_exact_mut(words)) {
        to.copy_from_slice(&D::pack(v, shift_right(v, acc, shift))[..words]);
    }
}

struct Run<'a, D, const C: usize, const B: usize> {
    rows: &'a mut IntegerRows<C, B>,
    stage: Stage,
    dot: PhantomData<D>,
}

impl<D: Dot, const C: usize, const B: usize> Task for Run<'_, D, C, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { rows, stage, .. } = self;
        let v = rows.v;
        for first in (0..ROWS).step_by(GROUP) {
            if stage != Stage::Contraction {
                rows.sums::<D>(first);
            }
            if stage != Stage::Sums {
                let IntegerRows { weights, sums, totals, .. } = rows;
                simd.apart(Contract::<D, C, B> { v, weights, sums, totals, dot: PhantomData });
            }
            if stage == Stage::Whole {
                let out = &mut rows.out[first * 16 * B..][..GROUP * 16 * B];
                for (i, (&total, out)) in rows.totals.iter().zip(out.chunks_exact_mut(16)).enumerate() {
                    out.copy_from_slice(&finished(v, simd, &rows.finish, i % B, pulp::cast(total)));
                }
            }
        }
    }
}

/// y' of sixteen outputs.
#[inline(always)]
pub(crate) fn finished<S: Simd>(v: V4, simd: S, finish: &Finish, b: usize, total: __m512i) -> [i16; 16] {
    let sum: [f32; 16] = pulp::cast(v.avx512f._mm512_cvtepi32_ps(total));
    let mut y = Wide::ZERO;
    finish.apply(simd, b, S::V16::load_slice(simd, &sum)).store(&mut y);
    let rounded = v.avx512f._mm512_cvtps_epi32(pulp::cast(y.0));
    pulp::cast(v.avx512f._mm512_cvtsepi32_epi16(rounded))
}

/// Totals (row, block) of a group.
struct Contract<'a, D, const C: usize, const B: usize> {
    v: V4,
    weights: &'a [Words],
    sums: &'a [i32],
    totals: &'a mut [[i32; 16]],
    dot: PhantomData<D>,
}

impl<D: Dot, const C: usize, const B: usize> Task for Contract<'_, D, C, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let (v, n) = (self.v, 8 * C / D::DEPTH);
        let rows: [&[i32]; GROUP] = std::array::from_fn(|r| &self.sums[r * n..][..n]);
        let weights: [&[Words]; B] = std::array::from_fn(|b| &self.weights[b * n..][..n]);
        let mut acc = [[splat(v, 0); B]; GROUP];
        for i in 0..n {
            let mut w = [splat(v, 0); B];
            for (w, from) in w.iter_mut().zip(&weights) {
                *w = pulp::cast(from[i].0);
            }
            for (acc, row) in acc.iter_mut().zip(&rows) {
                let x = splat(v, row[i]);
                for (acc, &w) in acc.iter_mut().zip(&w) {
                    *acc = D::dot(v, *acc, x, w);
                }
            }
        }
        for (&acc, total) in acc.as_flattened().iter().zip(self.totals) {
            *total = pulp::cast(acc);
        }
    }
}
