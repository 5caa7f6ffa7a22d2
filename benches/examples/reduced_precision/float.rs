//! The row in f32 again, in plain code over the kernels' vectors, with weights stored in f32, bf16 or i8 and widened
//! where they are read. With f32 weights it is the control: what this code loses against the engine's kernel.

use meissner_kernels::{Isa, LANES, Matrix, Simd, Task, Vector, Wide, elu};

use crate::problem::{GROUP, Problem, ROWS};

/// Sixteen weights in memory.
pub(crate) trait Weight: Copy {
    /// Largest stored magnitude that the weights of a channel are scaled to, or none.
    const LARGEST: Option<f32>;
    fn narrow(weights: [f32; 16]) -> Self;
    fn widen(self) -> Wide;
}

impl Weight for Wide {
    const LARGEST: Option<f32> = None;
    fn narrow(weights: [f32; 16]) -> Self {
        Self(weights)
    }
    #[inline(always)]
    fn widen(self) -> Wide {
        self
    }
}

/// The upper halves of sixteen f32.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub(crate) struct Halves([u16; 16]);

impl Weight for Halves {
    const LARGEST: Option<f32> = None;
    fn narrow(weights: [f32; 16]) -> Self {
        // To nearest, ties to even.
        Self(weights.map(|w| ((w.to_bits() + 0x7fff + (w.to_bits() >> 16 & 1)) >> 16) as u16))
    }
    #[inline(always)]
    fn widen(self) -> Wide {
        Wide(self.0.map(|w| f32::from_bits(u32::from(w) << 16)))
    }
}

/// Sixteen integers, in steps of their channel.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(crate) struct Bytes([i8; 16]);

impl Weight for Bytes {
    const LARGEST: Option<f32> = Some(127.0);
    fn narrow(weights: [f32; 16]) -> Self {
        Self(weights.map(|w| w.round_ties_even() as i8))
    }
    #[inline(always)]
    fn widen(self) -> Wide {
        Wide(self.0.map(f32::from))
    }
}

/// Which part of a row is computed.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Stage {
    Sums,
    Contraction,
    Whole,
}

/// What follows the sums, by blocks of sixteen outputs: y = ELU(a factor + bias) scale + shift.
#[derive(Clone)]
pub(crate) struct Finish {
    pub(crate) factor: Vec<Wide>,
    pub(crate) bias: Vec<Wide>,
    pub(crate) scale: Vec<Wide>,
    pub(crate) shift: Vec<Wide>,
}

/// Values by blocks of sixteen.
pub(crate) fn blocks(values: &[f32]) -> Vec<Wide> {
    values.as_chunks::<16>().0.iter().map(|&v| Wide(v)).collect()
}

impl Finish {
    /// Sums come in steps of `steps`, one an output, and are divided by the degree.
    pub(crate) fn new(problem: &Problem, steps: &[f32]) -> Self {
        let factor: Vec<f32> = steps.iter().map(|s| s / problem.degree as f32).collect();
        let (scale, shift) = problem.parts.norm.as_ref().expect("a problem has a norm");
        let bias = problem.parts.bias.as_ref().expect("a problem has a bias");
        Self { factor: blocks(&factor), bias: blocks(bias), scale: blocks(scale), shift: blocks(shift) }
    }

    /// Block `b` of a row.
    #[inline(always)]
    pub(crate) fn apply<S: Simd>(&self, simd: S, b: usize, sum: S::V16) -> S::V16 {
        let load = |blocks: &[Wide]| S::V16::load(simd, &blocks[b]);
        let y = load(&self.bias).add_product(sum, load(&self.factor)).map(simd, elu);
        load(&self.shift).add_product(y, load(&self.scale))
    }
}

/// Each output channel's step: 1, or its largest magnitude by `largest`.
pub(crate) fn steps(problem: &Problem, largest: Option<f32>) -> Vec<f32> {
    let channel = |o: usize| problem.parts.weight[o..].iter().step_by(problem.outputs);
    let step = |largest: f32, o| channel(o).fold(0f32, |m, w| m.max(w.abs())) / largest;
    (0..problem.outputs).map(|o| largest.map_or(1.0, |largest| step(largest, o))).collect()
}

/// C -> 16 B channels.
pub(crate) struct FloatRows<'a, W, const C: usize, const B: usize> {
    problem: &'a Problem,
    /// (block, slot C) vectors of sixteen outputs.
    weights: Vec<W>,
    finish: Finish,
    /// S(s, c) of a group.
    sums: Vec<f32>,
    totals: Vec<Wide>,
    pub(crate) out: Matrix,
}

impl<'a, W: Weight, const C: usize, const B: usize> FloatRows<'a, W, C, B> {
    pub(crate) fn new(problem: &'a Problem) -> Self {
        let steps = steps(problem, W::LARGEST);
        let mut weights = Vec::new();
        for b in 0..B {
            for row in problem.parts.weight.chunks(16 * B) {
                weights.push(W::narrow(std::array::from_fn(|o| row[16 * b + o] / steps[16 * b + o])));
            }
        }
        Self {
            problem,
            weights,
            finish: Finish::new(problem, &steps),
            sums: vec![0.0; GROUP * 8 * C],
            totals: vec![Wide::ZERO; GROUP * B],
            out: problem.out(),
        }
    }

    /// Computes `stage` of every row.
    pub(crate) fn run(&mut self, stage: Stage) {
        Isa::best().run(Run { rows: self, stage });
    }

    #[inline(always)]
    fn sums<S: Simd>(&mut self, simd: S, first: usize) {
        for (r, sums) in self.sums.as_chunks_mut::<8>().0.chunks_mut(C).enumerate() {
            let sums = sums.as_flattened_mut();
            match C {
                8 => sums_of_row::<S, S::V8, 1, C>(simd, self.problem, first + r, sums),
                16 => sums_of_row::<S, S::V16, 1, C>(simd, self.problem, first + r, sums),
                _ => sums_of_row::<S, S::V16, 2, C>(simd, self.problem, first + r, sums),
            }
        }
    }
}

/// S(s, c) of one row.
#[inline(always)]
fn sums_of_row<S: Simd, V: Vector<S>, const N: usize, const C: usize>(
    simd: S,
    problem: &Problem,
    row: usize,
    sums: &mut [f32],
) {
    let at = row * problem.degree;
    let edges = problem.edges[at..][..problem.degree].iter().zip(&problem.basis[at..][..problem.degree]);
    let mut acc = [[V::splat(simd, 0.0); N]; 8];
    for (n, basis) in edges {
        let row = problem.features.slice(n.row as usize);
        let mut x = [V::splat(simd, 0.0); N];
        for (i, x) in x.iter_mut().enumerate() {
            *x = V::load_slice(simd, &row[i * V::LANES..]);
        }
        for (acc, &weight) in acc.iter_mut().zip(&basis.0) {
            let weight = V::splat(simd, weight);
            for (acc, &x) in acc.iter_mut().zip(&x) {
                *acc = acc.add_product(weight, x);
            }
        }
    }
    for (acc, sums) in acc.iter().zip(sums.chunks_exact_mut(C)) {
        for (i, acc) in acc.iter().enumerate() {
            acc.store_slice(&mut sums[i * V::LANES..]);
        }
    }
}

struct Run<'a, 'p, W, const C: usize, const B: usize> {
    rows: &'a mut FloatRows<'p, W, C, B>,
    stage: Stage,
}

impl<W: Weight, const C: usize, const B: usize> Task for Run<'_, '_, W, C, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { rows, stage } = self;
        for first in (0..ROWS).step_by(GROUP) {
            if stage != Stage::Contraction {
                rows.sums(simd, first);
            }
            if stage != Stage::Sums {
                let FloatRows { weights, sums, totals, .. } = rows;
                simd.apart(Contract::<W, C, B> { weights, sums, totals });
            }
            if stage == Stage::Whole {
                let out = &mut rows.out.lanes_mut()[first * 2 * B..][..GROUP * 2 * B];
                for (i, (total, out)) in rows.totals.iter().zip(out.chunks_exact_mut(2)).enumerate() {
                    let y = rows.finish.apply(simd, i % B, S::V16::load(simd, total));
                    let mut wide = Wide::ZERO;
                    y.store(&mut wide);
                    out[0].0.copy_from_slice(&wide.0[..LANES]);
                    out[1].0.copy_from_slice(&wide.0[LANES..]);
                }
            }
        }
    }
}

/// Totals (row, block) of a group; a sum of its own for each, which are enough chains.
struct Contract<'a, W, const C: usize, const B: usize> {
    weights: &'a [W],
    sums: &'a [f32],
    totals: &'a mut [Wide],
}

impl<W: Weight, const C: usize, const B: usize> Task for Contract<'_, W, C, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let n = 8 * C;
        let rows: [&[f32]; GROUP] = std::array::from_fn(|r| &self.sums[r * n..][..n]);
        let weights: [&[W]; B] = std::array::from_fn(|b| &self.weights[b * n..][..n]);
        let mut acc = [[S::V16::splat(simd, 0.0); B]; GROUP];
        for i in 0..n {
            let mut w = [S::V16::splat(simd, 0.0); B];
            for (w, from) in w.iter_mut().zip(&weights) {
                *w = S::V16::load(simd, &from[i].widen());
            }
            for (acc, row) in acc.iter_mut().zip(&rows) {
                let x = S::V16::splat(simd, row[i]);
                for (acc, &w) in acc.iter_mut().zip(&w) {
                    *acc = acc.add_product(x, w);
                }
            }
        }
        for (acc, total) in acc.as_flattened().iter().zip(self.totals) {
            acc.store(total);
        }
    }
}
