//! Weights looked up by an edge's attribute, rounded to q levels an axis.
//!
//! ```text
//! W(u)(c,o) = sum over s of B(u, s) W(s, c, o)        q^3 matrices of C x O
//! a(o)      = sum over e, c of x(j(e), c) W(u(e))(c, o)
//! ```
//!
//! n C O multiply-adds a row and no basis, where the sums per slot need n 8 C + 8 C O; but no two edges share a matrix.

use meissner_kernels::{Isa, LANES, Lanes, Matrix, Neighbour, Simd, Task, Vector, Wide, spline_basis};

use crate::float::{Finish, blocks, steps};
use crate::problem::Problem;

/// Where a grid of attributes lies.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Span {
    /// 0 to 1, all that an attribute may be.
    Whole,
    /// From the smallest to the largest that the problem has, axis by axis.
    Occurring,
}

/// Attributes on a grid of q levels an axis.
#[derive(Clone)]
pub(crate) struct Rounded {
    /// In-edges with their attributes rounded.
    pub(crate) edges: Vec<Neighbour>,
    /// Place of each edge's attribute on the grid.
    pub(crate) places: Vec<u32>,
    /// B of every place.
    pub(crate) bases: Vec<Lanes>,
}

impl Rounded {
    pub(crate) fn new(problem: &Problem, levels: usize, span: Span) -> Self {
        let ranges: [[f32; 2]; 3] = std::array::from_fn(|d| range(problem, span, d));
        let most = (levels - 1) as f32;
        let level = |d: usize, u: f32| {
            let [low, high] = ranges[d];
            ((u - low) / (high - low) * most).round_ties_even() as usize
        };
        let value = |d: usize, level: usize| {
            let [low, high] = ranges[d];
            (low + (high - low) * (level as f32 / most)).clamp(0.0, 1.0)
        };
        let place = |u: [f32; 3]| (0..3).rev().fold(0, |at, d| at * levels + level(d, u[d]));
        let edge = |n: &Neighbour| Neighbour { u: std::array::from_fn(|d| value(d, level(d, n.u[d]))), ..*n };
        let at =
            |i: usize| [value(0, i % levels), value(1, i / levels % levels), value(2, i / (levels * levels))];
        Self {
            edges: problem.edges.iter().map(edge).collect(),
            places: problem.edges.iter().map(|n| place(n.u) as u32).collect(),
            bases: (0..levels.pow(3)).map(|i| spline_basis(at(i))).collect(),
        }
    }

    /// The basis of every edge, copied from the table.
    pub(crate) fn look_up(&self, basis: &mut Vec<Lanes>) {
        basis.clear();
        basis.extend(self.places.iter().map(|&place| self.bases[place as usize]));
    }

    /// W(u) at a place, (C, O).
    pub(crate) fn weights(&self, problem: &Problem, place: usize) -> Vec<f32> {
        let slots = problem.parts.weight.chunks_exact(problem.inputs * problem.outputs);
        let mut out = vec![0.0; problem.inputs * problem.outputs];
        for (&basis, slot) in self.bases[place].0.iter().zip(slots) {
            out.iter_mut().zip(slot).for_each(|(to, w)| *to += basis * w);
        }
        out
    }
}

/// Smallest and largest attribute along an axis.
fn range(problem: &Problem, span: Span, axis: usize) -> [f32; 2] {
    match span {
        Span::Whole => [0.0, 1.0],
        Span::Occurring => {
            let widen = |[low, high]: [f32; 2], u: f32| [low.min(u), high.max(u)];
            problem.edges.iter().map(|n| n.u[axis]).fold([1.0, 0.0], widen)
        }
    }
}

/// Rows from tabulated weights, C -> 16 B channels, in f32.
pub(crate) struct TableRows<'a, const C: usize, const B: usize> {
    problem: &'a Problem,
    rounded: Rounded,
    /// (place, c, block) vectors of sixteen outputs.
    table: Vec<Wide>,
    finish: Finish,
    pub(crate) out: Matrix,
}

impl<'a, const C: usize, const B: usize> TableRows<'a, C, B> {
    pub(crate) fn new(problem: &'a Problem, rounded: Rounded) -> Self {
        let places = 0..rounded.bases.len();
        let weights: Vec<f32> = places.flat_map(|place| rounded.weights(problem, place)).collect();
        let table = blocks(&weights);
        let finish = Finish::new(problem, &steps(problem, None));
        Self { problem, rounded, table, finish, out: problem.out() }
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.table.as_slice())
    }

    /// Computes every row.
    pub(crate) fn run(&mut self) {
        Isa::best().run(Run { rows: self });
    }
}

struct Run<'a, 'p, const C: usize, const B: usize> {
    rows: &'a mut TableRows<'p, C, B>,
}

impl<const C: usize, const B: usize> Task for Run<'_, '_, C, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let TableRows { problem, rounded, table, finish, out } = self.rows;
        let degree = problem.degree;
        let edges = problem.edges.chunks_exact(degree).zip(rounded.places.chunks_exact(degree));
        for ((edges, places), out) in edges.zip(out.lanes_mut().chunks_exact_mut(2 * B)) {
            let mut acc = [[S::V16::splat(simd, 0.0); B]; 4];
            for (n, &place) in edges.iter().zip(places) {
                let x = problem.features.slice(n.row as usize);
                let weights = &table[place as usize * C * B..][..C * B];
                for (x, weights) in x.as_chunks::<4>().0.iter().zip(weights.chunks_exact(4 * B)) {
                    for ((acc, &x), weights) in acc.iter_mut().zip(x).zip(weights.chunks_exact(B)) {
                        let x = S::V16::splat(simd, x);
                        for (acc, w) in acc.iter_mut().zip(weights) {
                            *acc = acc.add_product(x, S::V16::load(simd, w));
                        }
                    }
                }
            }
            for b in 0..B {
                let sum = acc[0][b].add(acc[1][b]).add(acc[2][b].add(acc[3][b]));
                let mut y = Wide::ZERO;
                finish.apply(simd, b, sum).store(&mut y);
                out[2 * b].0.copy_from_slice(&y.0[..LANES]);
                out[2 * b + 1].0.copy_from_slice(&y.0[LANES..]);
            }
        }
    }
}
