//! Rows in any number format: sums per slot and their contraction, or weights from a table.

use meissner_kernels::{Isa, Matrix, Simd, Task, Vector, Wide, elu};
use pulp::cast;
use pulp::x86::V4;

use crate::format::{Format, Pairs, Value, Weight, splat};
use crate::problem::{GROUP, Problem, ROWS, Rounded, magnitude};

/// Pairs of i16: i16 sums and i8 weights.
pub(crate) type I16 = Pairs<32_767, 127>;

/// Bits that activations keep.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Width {
    F32,
    I16,
    I8,
}

impl Width {
    /// Largest magnitude of an activation in steps, and steps of 1 of the basis; none in f32.
    pub(crate) fn steps(self) -> Option<[f32; 2]> {
        match self {
            Self::F32 => None,
            Self::I16 => Some([32_767.0, 2_048.0]),
            Self::I8 => Some([127.0, 128.0]),
        }
    }
}

/// The part of a row that is computed.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Stage {
    Sums,
    Contraction,
    Whole,
}

/// y = ELU(a factor + bias) scale + shift, by blocks of sixteen outputs.
#[derive(Clone)]
struct Finish(Vec<[Wide; 4]>);

impl Finish {
    /// For sums in steps of `steps`, one an output, that `over` is to be taken from, and results in steps of `step`.
    fn new(problem: &Problem, steps: &[f32], over: &[f32], step: f32) -> Self {
        let (scale, shift) = problem.parts.norm.as_ref().expect("a problem has a norm");
        let bias = problem.parts.bias.as_ref().expect("a problem has a bias");
        let factor = |o: usize| steps[o] / problem.degree as f32;
        let block = |b: usize| {
            let outputs = |of: &dyn Fn(usize) -> f32| Wide(std::array::from_fn(|o| of(16 * b + o)));
            [
                outputs(&factor),
                outputs(&|o| bias[o] - over[o] * factor(o)),
                outputs(&|o| scale[o] / step),
                outputs(&|o| shift[o] / step),
            ]
        };
        Self((0..problem.outputs / 16).map(block).collect())
    }

    /// The results of block `b`.
    #[inline(always)]
    fn apply<F: Format, S: Simd>(&self, v: V4, simd: S, b: usize, totals: [i32; 16]) -> [F::Value; 16] {
        let [factor, bias, scale, shift] = &self.0[b];
        let sums = S::V16::load_slice(simd, &F::Value::totals(v, cast(totals)));
        let y = S::V16::load(simd, bias).add_product(sums, S::V16::load(simd, factor)).map(simd, elu);
        let mut out = Wide::ZERO;
        S::V16::load(simd, shift).add_product(y, S::V16::load(simd, scale)).store(&mut out);
        F::Value::results(v, out.0)
    }
}

/// The in-edges that are added at once: rows, and the basis of all in each slot.
#[derive(Clone, Copy)]
struct Edges {
    rows: [u32; 2],
    basis: [i32; 8],
}

/// Channels of a stored row.
const fn padded(channels: usize) -> usize {
    if channels < 16 { 16 } else { channels }
}

/// Weights (block, word) of a matrix of 16 B columns, in `steps`.
fn pack<F: Format, const B: usize>(matrix: &[f32], steps: &[f32], b: usize, word: usize) -> F::Weights {
    let input = |d: usize| -> [f32; 16] {
        std::array::from_fn(|o| matrix[((word * F::DEPTH + d) * B + b) * 16 + o] / steps[16 * b + o])
    };
    F::store(&(0..F::DEPTH).map(input).collect::<Vec<_>>())
}

/// C -> 16 B channels.
pub(crate) struct Rows<F: Format, const C: usize, const B: usize> {
    v: V4,
    /// x', padded to sixteen channels.
    features: Vec<F::Value>,
    edges: Vec<Edges>,
    per_row: usize,
    /// h.
    shift: u32,
    /// (block, word).
    weights: Vec<F::Weights>,
    finish: Finish,
    /// T' of a group.
    sums: Vec<i32>,
    /// S' of every row, sixteen channels of a slot after the other, where sums are updated.
    state: Vec<[i32; 16]>,
    totals: Vec<[i32; 16]>,
    out: Vec<F::Value>,
    /// Y.
    step: f32,
}

impl<F: Format, const C: usize, const B: usize> Rows<F, C, B> {
    /// Words of S' of a row, in vectors.
    const STATE: usize = 8 * padded(C) / 16;

    /// Stores `problem`, whose answer in f32 is `expected`.
    pub(crate) fn new(v: V4, problem: &Problem, width: Width, expected: &Matrix) -> Self {
        let unit = |values: &Matrix| width.steps().map_or(1.0, |[largest, _]| magnitude(values) / largest);
        let (input, step) = (unit(&problem.features), unit(expected));
        let basis_steps = width.steps().map_or(1.0, |[_, basis]| basis);
        let mut features = vec![F::Value::default(); problem.features.rows() * padded(C)];
        for (row, to) in features.chunks_exact_mut(padded(C)).enumerate() {
            let values = problem.features.slice(row);
            to.iter_mut().zip(values).for_each(|(to, &x)| *to = F::Value::of(x / input));
        }
        let edges = problem.edges.chunks(F::Value::EDGES).zip(problem.basis.chunks(F::Value::EDGES)).map(
            |(n, basis)| {
                let slot =
                    |s: usize| basis.iter().map(|b| F::Value::of(b.0[s] * basis_steps)).collect::<Vec<_>>();
                Edges {
                    rows: [n[0].row, n[F::Value::EDGES - 1].row],
                    basis: std::array::from_fn(|s| F::Value::word(&slot(s))),
                }
            },
        );
        let steps = problem.weight_steps(F::WEIGHT);
        let words = 8 * C / F::DEPTH;
        let weights = (0..B).flat_map(|b| (0..words).map(move |i| (b, i)));
        let mut rows = Self {
            v,
            features,
            edges: edges.collect(),
            per_row: problem.degree / F::Value::EDGES,
            shift: 0,
            weights: weights.map(|(b, i)| pack::<F, B>(&problem.parts.weight, &steps, b, i)).collect(),
            finish: Finish(Vec::new()),
            sums: vec![0; GROUP * words],
            state: Vec::new(),
            totals: vec![[0; 16]; GROUP * B],
            out: vec![F::Value::default(); ROWS * 16 * B],
            step,
        };
        if let Some(most) = F::SUM {
            rows.keep_sums();
            let sums = rows.state.as_flattened().iter();
            let largest = sums.map(|s| s.unsigned_abs()).max().unwrap_or(0);
            rows.shift = (0..32).find(|h| largest >> h < most as u32).expect("a shift that fits");
            rows.state.clear();
        }
        let column = |o: usize| problem.parts.weight[o..].iter().step_by(16 * B).map(move |w| (w, o));
        // The sum that the zero of stored sums adds to a total.
        let over = |o: usize| column(o).map(|(w, o)| (w / steps[o]).round_ties_even()).sum::<f32>();
        let over: Vec<f32> = (0..16 * B).map(|o| F::ZERO as f32 * over(o)).collect();
        let scale = input / basis_steps * 2f32.powi(rows.shift as i32);
        let sum_steps: Vec<f32> = steps.iter().map(|w| w * scale).collect();
        rows.finish = Finish::new(problem, &sum_steps, &over, step);
        rows
    }

    /// Computes `stage` of every row, its sums from zero or, where there is a state, from that.
    pub(crate) fn run(&mut self, stage: Stage) {
        Isa::best().run(Run { rows: self, stage });
    }

    /// Y y'.
    pub(crate) fn values(&self) -> Vec<f32> {
        self.out.iter().map(|&y| y.to_f32() * self.step).collect()
    }

    /// Bytes of weights.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.weights.as_slice())
    }

    /// Computes the sums of every row, and keeps them.
    fn keep_sums(&mut self) {
        self.state = vec![[0; 16]; ROWS * Self::STATE];
        self.run(Stage::Sums);
    }

    /// T' of one row; N registers hold the channels of a slot. S' is added to the row's state and stored there, if any.
    #[inline(always)]
    fn sums<const N: usize>(&mut self, row: usize, words: usize) {
        let v = self.v;
        let mut acc = [[splat(v, 0); N]; 8];
        let kept = if self.state.is_empty() { 0 } else { Self::STATE };
        for (acc, &from) in acc.as_flattened_mut().iter_mut().zip(&self.state[row * kept..][..kept]) {
            *acc = cast(from);
        }
        for edges in &self.edges[row * self.per_row..][..self.per_row] {
            let rows = edges.rows.map(|row| &self.features[row as usize * padded(C)..][..padded(C)]);
            let mut x = [splat(v, 0); N];
            for (i, x) in x.iter_mut().enumerate() {
                *x = F::Value::sources(v, rows, 16 * i);
            }
            for (acc, &basis) in acc.iter_mut().zip(&edges.basis) {
                let basis = splat(v, basis);
                for (acc, &x) in acc.iter_mut().zip(&x) {
                    *acc = F::Value::add_products(v, *acc, basis, x);
                }
            }
        }
        for (&acc, to) in acc.as_flattened().iter().zip(&mut self.state[row * kept..][..kept]) {
            *to = cast(acc);
        }
        let each = C.min(16) / F::DEPTH;
        let sums = self.sums[row % GROUP * words..][..words].chunks_exact_mut(each);
        let (half, shift) = (splat(v, 1 << self.shift >> 1), splat(v, self.shift as i32));
        for (&acc, to) in acc.as_flattened().iter().zip(sums) {
            let mut stored = acc;
            if F::SUM.is_some() {
                stored = v.avx512f._mm512_srav_epi32(F::Value::add(v, acc, half), shift);
            }
            to.copy_from_slice(&F::pack(v, stored)[..each]);
        }
    }
}

struct Run<'a, F: Format, const C: usize, const B: usize> {
    rows: &'a mut Rows<F, C, B>,
    stage: Stage,
}

impl<F: Format, const C: usize, const B: usize> Task for Run<'_, F, C, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        // `V4` is the proof of AVX-512: no other instruction set gets here, or needs compiling.
        if !S::WIDE {
            return;
        }
        let Self { rows, stage } = self;
        let (v, words) = (rows.v, 8 * C / F::DEPTH);
        for first in (0..ROWS).step_by(GROUP) {
            if stage != Stage::Contraction {
                for row in first..first + GROUP {
                    if C == 32 { rows.sums::<2>(row, words) } else { rows.sums::<1>(row, words) }
                }
            }
            if stage != Stage::Sums {
                simd.apart(&mut *rows);
            }
            if stage == Stage::Whole {
                let out = rows.out[first * 16 * B..][..GROUP * 16 * B].as_chunks_mut().0;
                for (i, (&totals, out)) in rows.totals.iter().zip(out).enumerate() {
                    *out = rows.finish.apply::<F, S>(v, simd, i % B, totals);
                }
            }
        }
    }
}

/// Computes the totals (row, block) of a group from its sums.
impl<F: Format, const C: usize, const B: usize> Task for &mut Rows<F, C, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        if !S::WIDE {
            return;
        }
        let Rows { v, weights, sums, totals, .. } = self;
        let (v, n) = (*v, 8 * C / F::DEPTH);
        let rows: [&[i32]; GROUP] = std::array::from_fn(|r| &sums[r * n..][..n]);
        let weights: [&[F::Weights]; B] = std::array::from_fn(|b| &weights[b * n..][..n]);
        let mut acc = [[splat(v, 0); B]; GROUP];
        for i in 0..n {
            let mut w = [splat(v, 0); B];
            for (w, from) in w.iter_mut().zip(&weights) {
                *w = from[i].load();
            }
            for (acc, row) in acc.iter_mut().zip(&rows) {
                let x = splat(v, row[i]);
                for (acc, &w) in acc.iter_mut().zip(&w) {
                    *acc = F::add_inputs(v, *acc, x, w);
                }
            }
        }
        for (&acc, total) in acc.as_flattened().iter().zip(totals) {
            *total = cast(acc);
        }
    }
}

/// The row that is read instead of `row` after a change.
fn instead(row: u32, rows: usize) -> u32 {
    (row + 1) % rows as u32
}

impl<const C: usize, const B: usize> Rows<I16, C, B> {
    /// Makes the rows start from the sums that they have, and replace the sources of the first `changed` in-edges of each:
    /// S' += sum over changed e of B'(e) (x'new - x'old), then T' and all of a' again. A changed edge touches all eight
    /// slots of a 2 x 2 x 2 kernel, so that nothing of the contraction is saved.
    ///
    /// # Panics
    /// If the updated sums are not those that are computed from zero.
    pub(crate) fn update_by_slots(&mut self, problem: &Problem, changed: usize) {
        self.keep_sums();
        let mut changes = Vec::new();
        for row in self.edges.chunks_mut(self.per_row) {
            for e in 0..changed {
                let edges = &mut row[e / 2];
                let old = edges.rows[e % 2];
                edges.rows[e % 2] = instead(old, problem.features.rows());
                let basis = edges.basis.map(|both| {
                    let basis = cast::<i32, [i16; 2]>(both)[e % 2];
                    cast([basis, -basis])
                });
                changes.push(Edges { rows: [edges.rows[e % 2], old], basis });
            }
        }
        let before = self.state.clone();
        self.keep_sums();
        let expected = std::mem::replace(&mut self.state, before);
        (self.edges, self.per_row) = (changes, changed);
        self.run(Stage::Sums);
        assert!(self.state == expected, "updated sums");
    }
}

/// Rows of C -> 16 B channels with weights looked up by an edge's rounded attribute: n C O multiply-adds a row and no basis,
/// where sums per slot need n 8 C + 8 C O; but no two edges share a matrix.
///
/// ```text
/// from zero   a(o)  = sum over e, c of x(j(e), c) W(u(e))(c, o)
/// updated     a'   += sum over changed e of (x'new - x'old) W'(u(e))
/// ```
pub(crate) struct ByTable<F: Format, const C: usize, const B: usize> {
    v: V4,
    features: Vec<F::Value>,
    /// Of each row's edges, one row's after the other: new and old source, and the attribute's place.
    edges: Vec<([u32; 2], u32)>,
    per_row: usize,
    /// (place, word, block).
    table: Vec<F::Weights>,
    finish: Finish,
    /// a' of every row, where it is updated.
    totals: Vec<[i32; 16]>,
    pub(crate) out: Vec<F::Value>,
}

impl<F: Format, const C: usize, const B: usize> ByTable<F, C, B> {
    /// The first `per_row` in-edges of each row, with the activations and the scale of `rows`. Totals are kept and updated
    /// where each edge changes its source, else computed from zero.
    pub(crate) fn new(
        rows: &Rows<F, C, B>,
        problem: &Problem,
        rounded: &Rounded,
        per_row: usize,
        updated: bool,
    ) -> Self {
        let steps = problem.weight_steps(F::WEIGHT);
        let mut table = Vec::new();
        for place in 0..rounded.bases.len() {
            let weights = rounded.weights(problem, place);
            let words = (0..C / F::DEPTH).flat_map(|word| (0..B).map(move |b| (b, word)));
            table.extend(words.map(|(b, word)| pack::<F, B>(&weights, &steps, b, word)));
        }
        let count = problem.features.rows();
        let source = |row: u32| if updated { [instead(row, count), row] } else { [row; 2] };
        let edges = problem.edges.iter().zip(&rounded.places).map(|(n, &place)| (source(n.row), place));
        let edges: Vec<_> = edges.collect();
        Self {
            v: rows.v,
            features: rows.features.clone(),
            edges: edges.chunks(problem.degree).flat_map(|row| &row[..per_row]).copied().collect(),
            per_row,
            table,
            finish: rows.finish.clone(),
            totals: if updated { vec![[0; 16]; ROWS * B] } else { Vec::new() },
            out: rows.out.clone(),
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.table.as_slice())
    }

    /// Computes or updates every row.
    pub(crate) fn run(&mut self) {
        Isa::best().run(self);
    }
}

impl<const C: usize, const B: usize> ByTable<I16, C, B> {
    /// Updates every row, and back.
    ///
    /// # Panics
    /// If the totals are not those from before.
    pub(crate) fn check_update(&mut self) {
        for _ in 0..2 {
            self.run();
            self.edges.iter_mut().for_each(|(sources, _)| sources.reverse());
        }
        assert!(self.totals.as_flattened().iter().all(|&total| total == 0), "totals updated by table");
    }
}

/// Computes or updates every row.
impl<F: Format, const C: usize, const B: usize> Task for &mut ByTable<F, C, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        // `V4` is the proof of AVX-512: no other instruction set gets here, or needs compiling.
        if !S::WIDE {
            return;
        }
        let ByTable { v, features, edges, per_row, table, finish, totals, out } = self;
        let (v, words) = (*v, C / F::DEPTH);
        for (row, edges) in edges.chunks_exact(*per_row).enumerate() {
            // Four chains, which are enough to hide an instruction's latency.
            let mut acc = [[splat(v, 0); B]; 4];
            for (acc, &kept) in acc[0].iter_mut().zip(totals.iter().skip(row * B)) {
                *acc = cast(kept);
            }
            for &(sources, place) in edges {
                let [new, old] = sources.map(|row| &features[row as usize * padded(C)..][..C]);
                let mut x = [F::Value::default(); C];
                for (x, (&new, &old)) in x.iter_mut().zip(new.iter().zip(old)) {
                    *x = F::Value::change(new, old);
                }
                let weights = table[place as usize * words * B..][..words * B].chunks_exact(4 * B);
                for (x, weights) in x.chunks_exact(4 * F::DEPTH).zip(weights) {
                    let each = x.chunks_exact(F::DEPTH).zip(weights.chunks_exact(B));
                    for (acc, (x, weights)) in acc.iter_mut().zip(each) {
                        let x = splat(v, F::Value::word(x));
                        for (acc, w) in acc.iter_mut().zip(weights) {
                            *acc = F::add_inputs(v, *acc, x, w.load());
                        }
                    }
                }
            }
            for b in 0..B {
                let sum = F::Value::add(
                    v,
                    F::Value::add(v, acc[0][b], acc[1][b]),
                    F::Value::add(v, acc[2][b], acc[3][b]),
                );
                if let Some(kept) = totals.get_mut(row * B + b) {
                    *kept = cast(sum);
                }
                let to = &mut out[(row * B + b) * 16..][..16];
                to.copy_from_slice(&finish.apply::<F, S>(v, simd, b, cast(sum)));
            }
        }
    }
}
