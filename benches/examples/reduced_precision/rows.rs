//! Rows in any number format: sums per slot and their contraction, or weights from a table.
//!
//! Registers and memory are vectors of sixteen 32-bit words whatever they hold: a word is one f32, one i32, two i16 or four
//! bytes. The compiler does not find the integer instructions in plain loops over i16 (it multiplies in 32 bits, slower than
//! f32), so they come from the crate `pulp`, which wraps them behind a proof that the processor has them.
//!
//! ```text
//! x' = round(x / X)            X: largest |x| of the layer over 127 (i8) or 32767 (i16)
//! B' = round(B 2^k)            k = 7 with i8, 11 with i16
//! S' = sum of B' x'            exact in i32
//! T' = round(S' / 2^h)         as the weights read it: i16, or seven bits; 2^h from the largest |S'| of all rows
//! a' = sum of T' W'            exact in i32; W' = round(W / w(o)), w(o): largest |W| of the output over 127 or 2047
//! y' = round(y(a') / Y)        y(a'): back to f32 with one factor an output; ELU and batch norm in f32
//! ```

use std::arch::x86_64::__m512i;

use meissner_kernels::{Isa, Matrix, Neighbour, Simd, Task, Vector, Wide, elu};
use pulp::bytemuck::cast_slice;
use pulp::cast;
use pulp::x86::V4;

use crate::problem::{GROUP, Problem, ROWS, Ranges, Rounded, magnitude};

/// The part of a row that is computed. By table, weights are looked up by an edge's rounded attribute: n C O multiply-adds
/// a row and no basis, where sums per slot need n 8 C + 8 C O; but no two edges share a matrix.
///
/// ```text
/// from zero   a(o)  = sum over e, c of x(j(e), c) W(u(e))(c, o)
/// updated     a'   += sum over changed e of (x'new - x'old) W'(u(e))
/// ```
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Stage {
    Sums,
    Contraction,
    Whole,
    ByTable,
}

/// The in-edges that are added at once: rows, and the basis of all in each slot. By table it is one edge: its new and old
/// source, and in the first slot the place of its attribute.
#[derive(Clone, Copy)]
struct Edges {
    rows: [u32; 2],
    basis: [i32; 8],
}

/// C -> 16 B channels. Values are i16 and sums i32, or both f32; weights have `BYTES` bytes, and are widened when they are
/// read where values are f32.
pub(crate) struct Rows<const C: usize, const B: usize, const INTEGER: bool, const BYTES: usize> {
    v: V4,
    /// x', padded to sixteen channels.
    features: Vec<__m512i>,
    edges: Vec<Edges>,
    per_row: usize,
    /// h.
    shift: u32,
    /// (word, output), by table (place, word, output).
    weights: Vec<__m512i>,
    /// w(o).
    weight_steps: Vec<f32>,
    /// Factor, bias, scale and shift of each block.
    factors: Vec<[Wide; 4]>,
    /// T' of a group.
    sums: Vec<i32>,
    /// S' of every row, sixteen channels of a slot after the other, or by table a', where they are updated.
    state: Vec<__m512i>,
    totals: Vec<__m512i>,
    out: Vec<i32>,
    /// Y.
    step: f32,
}

impl<const C: usize, const B: usize, const INTEGER: bool, const BYTES: usize> Rows<C, B, INTEGER, BYTES> {
    /// In-edges whose products one instruction adds.
    const EDGES: usize = if INTEGER { 2 } else { 1 };
    /// Inputs whose products one instruction adds.
    const DEPTH: usize = if INTEGER { 4 / BYTES } else { 1 };
    /// Added to a stored sum of inputs, so that a byte is not negative.
    const ZERO: i32 = if Self::DEPTH == 4 { 64 } else { 0 };
    /// Words of sixteen stored values.
    const VALUES: usize = 16 / Self::EDGES;
    /// Words of a stored row: whole registers.
    const ROW: usize = C.div_ceil(16) * Self::VALUES;
    /// Words of T' of a row.
    const SUMS: usize = 8 * C / Self::DEPTH;
    /// Vectors of S' of a row.
    const STATE: usize = 8 * C.div_ceil(16);

    /// Stores `problem`, whose answer in f32 is `expected`.
    pub(crate) fn new(v: V4, problem: &Problem, ranges: Ranges, expected: &Matrix) -> Self {
        let [largest, basis_steps] = ranges.steps.unwrap_or([0.0, 1.0]);
        let unit = |values: &Matrix| if INTEGER { magnitude(values) / largest } else { 1.0 };
        let (input, step) = (unit(&problem.features), unit(expected));
        let padded = |row| {
            let values = problem.features.slice(row)[..C].iter().map(move |x| x / input);
            values.chain(std::iter::repeat_n(0.0, C.next_multiple_of(16) - C))
        };
        let each = problem.edges.chunks(Self::EDGES).zip(problem.basis.chunks(Self::EDGES));
        let edges = each.map(|(n, basis)| {
            let word = |s: usize| {
                let bytes: Vec<u8> = basis.iter().flat_map(|b| Self::value(b.0[s] * basis_steps)).collect();
                i32::from_le_bytes(bytes.try_into().expect("a word"))
            };
            Edges { rows: [n[0].row, n[Self::EDGES - 1].row], basis: std::array::from_fn(word) }
        });
        let largest = |o: usize| problem.weights_of(o).fold(0f32, |m, w| m.max(w.abs()));
        let weight_step = |o| ranges.weight.map_or(1.0, |weight| largest(o) / weight);
        let mut rows = Self {
            v,
            features: vectors((0..problem.features.rows()).flat_map(padded).flat_map(Self::value)),
            edges: edges.collect(),
            per_row: problem.degree / Self::EDGES,
            shift: 0,
            weights: Vec::new(),
            weight_steps: (0..16 * B).map(weight_step).collect(),
            factors: Vec::new(),
            sums: vec![0; GROUP * Self::SUMS],
            state: Vec::new(),
            totals: vec![cast([0; 16]); GROUP * B],
            out: vec![0; ROWS * B * Self::VALUES],
            step,
        };
        rows.weights = vectors(rows.pack(&problem.parts.weight));
        if INTEGER {
            rows.keep_sums();
            let sums = cast_slice::<_, i32>(&rows.state).iter();
            let largest = sums.map(|s| s.unsigned_abs()).max().unwrap_or(0);
            rows.shift = (0..32).find(|h| largest >> h < ranges.sum).expect("a shift that fits");
            rows.state.clear();
        }
        rows.factors = rows.factors(problem, input / basis_steps * 2f32.powi(rows.shift as i32));
        rows
    }

    /// The factors of each block, for sums in steps of `sum` times those of the weights.
    fn factors(&self, problem: &Problem, sum: f32) -> Vec<[Wide; 4]> {
        let (scale, shift) = problem.parts.norm.as_ref().expect("a problem has a norm");
        let bias = problem.parts.bias.as_ref().expect("a problem has a bias");
        let factor = |o: usize| self.weight_steps[o] * sum / problem.degree as f32;
        // The zero of stored sums adds this to a total.
        let rounded = |o| problem.weights_of(o).map(move |w| (w / self.weight_steps[o]).round_ties_even());
        let over = |o: usize| Self::ZERO as f32 * rounded(o).sum::<f32>();
        let block = |b: usize| {
            let outputs = |of: &dyn Fn(usize) -> f32| Wide(std::array::from_fn(|o| of(16 * b + o)));
            [
                outputs(&factor),
                outputs(&|o| bias[o] - over(o) * factor(o)),
                outputs(&|o| scale[o] / self.step),
                outputs(&|o| shift[o] / self.step),
            ]
        };
        (0..B).map(block).collect()
    }

    /// The bytes of a value in steps.
    fn value(steps: f32) -> impl Iterator<Item = u8> {
        let whole = (steps.round_ties_even() as i32).to_le_bytes();
        let bytes = if INTEGER { whole } else { steps.to_le_bytes() };
        bytes.into_iter().take(4 / Self::EDGES)
    }

    /// The bytes of a weight in steps.
    fn weight(steps: f32) -> impl Iterator<Item = u8> {
        let bytes = match (INTEGER, BYTES) {
            (false, 4) => steps.to_le_bytes(),
            // bf16: the upper half, to nearest, ties to even.
            (false, 2) => ((steps.to_bits() + 0x7fff + (steps.to_bits() >> 16 & 1)) >> 16).to_le_bytes(),
            _ => (steps.round_ties_even() as i32).to_le_bytes(),
        };
        bytes.into_iter().take(BYTES)
    }

    /// The bytes of a matrix of weights: each word's inputs, output by output.
    fn pack(&self, matrix: &[f32]) -> impl Iterator<Item = u8> {
        let words = matrix.chunks(16 * B * Self::DEPTH);
        let outputs = words.flat_map(|inputs| self.weight_steps.iter().enumerate().map(move |o| (inputs, o)));
        outputs.flat_map(|(inputs, (o, step))| {
            inputs[o..].iter().step_by(16 * B).flat_map(move |w| Self::weight(w / step))
        })
    }

    /// Vector `n` of stored weights.
    #[inline(always)]
    fn load(words: &[i32], n: usize) -> __m512i {
        let wide = |half| f32::from_bits(u32::from(half) << 16);
        match (INTEGER, BYTES) {
            (false, 2) => cast(cast::<_, [u16; 16]>(vector::<8>(words, n)).map(wide)),
            (false, 1) => cast(cast::<_, [i8; 16]>(vector::<4>(words, n)).map(f32::from)),
            _ => cast(vector::<16>(words, n)),
        }
    }

    /// sums + words values.
    #[inline(always)]
    fn add_products(v: V4, sums: __m512i, words: __m512i, values: __m512i) -> __m512i {
        if INTEGER {
            v.avx512f._mm512_add_epi32(sums, v.avx512bw._mm512_madd_epi16(words, values))
        } else {
            cast(v.avx512f._mm512_fmadd_ps(cast(words), cast(values), cast(sums)))
        }
    }

    /// totals + inputs weights. Inputs of a byte are at most 127, so that two products fit an i16.
    #[inline(always)]
    fn add_inputs(v: V4, totals: __m512i, inputs: __m512i, weights: __m512i) -> __m512i {
        if Self::DEPTH == 4 {
            let pairs = v.avx512bw._mm512_maddubs_epi16(inputs, weights);
            return Self::add_products(v, totals, splat(v, 0x0001_0001), pairs);
        }
        Self::add_products(v, totals, inputs, weights)
    }

    /// The part of T' that `sums` are, as the weights read it.
    #[inline(always)]
    fn store_sums(v: V4, sums: __m512i, shift: u32, to: &mut [i32]) {
        let (f, count) = (v.avx512f, to.len());
        if !INTEGER {
            return to.copy_from_slice(&cast::<_, [i32; 16]>(sums)[..count]);
        }
        let half = splat(v, 1 << shift >> 1);
        let stored = f._mm512_srav_epi32(f._mm512_add_epi32(sums, half), splat(v, shift as i32));
        if Self::DEPTH == 2 {
            return to.copy_from_slice(&cast::<_, [i32; 8]>(f._mm512_cvtsepi32_epi16(stored))[..count]);
        }
        let stored = f._mm512_add_epi32(stored, splat(v, Self::ZERO));
        let clamped = f._mm512_min_epi32(f._mm512_max_epi32(stored, splat(v, 0)), splat(v, 127));
        to.copy_from_slice(&cast::<_, [i32; 4]>(f._mm512_cvtepi32_epi8(clamped))[..count]);
    }

    /// Computes `stage` of every row, its sums from zero or, where there is a state, from that.
    pub(crate) fn run(&mut self, stage: Stage) {
        Isa::best().run(Run { rows: self, stage });
    }

    /// Y y'.
    pub(crate) fn values(&self) -> Vec<f32> {
        if INTEGER {
            cast_slice::<_, i16>(&self.out).iter().map(|&y| f32::from(y) * self.step).collect()
        } else {
            cast_slice(&self.out).to_vec()
        }
    }

    /// Bytes of weights.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.weights.as_slice())
    }

    /// Computes the sums of every row, and keeps them.
    fn keep_sums(&mut self) {
        self.state = vec![cast([0; 16]); ROWS * Self::STATE];
        self.run(Stage::Sums);
    }

    /// T' of one row; N registers hold the channels of a slot. S' is added to the row's state and stored there, if any.
    #[inline(always)]
    fn row_sums<const N: usize>(&mut self, row: usize) {
        let v = self.v;
        let mut acc = [[splat(v, 0); N]; 8];
        let kept = if self.state.is_empty() { 0 } else { Self::STATE };
        let state = &mut self.state[row * kept..][..kept];
        acc.as_flattened_mut()[..kept].copy_from_slice(state);
        let features = cast_slice::<_, i32>(&self.features);
        for edges in &self.edges[row * self.per_row..][..self.per_row] {
            let [a, b] = edges.rows.map(|row| &features[row as usize * Self::ROW..][..Self::ROW]);
            let widen = |row, n| v.avx512f._mm512_cvtepu16_epi32(cast(vector::<8>(row, n)));
            let mut x = [splat(v, 0); N];
            for (n, x) in x.iter_mut().enumerate() {
                *x = if INTEGER {
                    v.avx512f._mm512_or_si512(widen(a, n), v.avx512f._mm512_slli_epi32::<16>(widen(b, n)))
                } else {
                    cast(vector::<16>(a, n))
                };
            }
            for (acc, &basis) in acc.iter_mut().zip(&edges.basis) {
                let basis = splat(v, basis);
                for (acc, &x) in acc.iter_mut().zip(&x) {
                    *acc = Self::add_products(v, *acc, basis, x);
                }
            }
        }
        state.copy_from_slice(&acc.as_flattened()[..kept]);
        let sums = &mut self.sums[row % GROUP * Self::SUMS..][..Self::SUMS];
        for (&acc, to) in acc.as_flattened().iter().zip(sums.chunks_exact_mut(C.min(16) / Self::DEPTH)) {
            Self::store_sums(v, acc, self.shift, to);
        }
    }

    /// The totals of one row by table.
    #[inline(always)]
    fn row_by_table(&mut self, row: usize) -> [__m512i; B] {
        let (v, words) = (self.v, C / Self::DEPTH);
        let (features, weights) = (cast_slice::<_, i32>(&self.features), cast_slice::<_, i32>(&self.weights));
        // Four chains, which are enough to hide an instruction's latency.
        let mut acc = [[splat(v, 0); B]; 4];
        let kept = if self.state.is_empty() { 0 } else { B };
        let state = &mut self.state[row * kept..][..kept];
        acc[0][..kept].copy_from_slice(state);
        for edge in &self.edges[row * self.per_row..][..self.per_row] {
            let [new, old] = edge.rows.map(|row| &features[row as usize * Self::ROW..][..words]);
            let mut x = [0; 32];
            for (x, (&new, &old)) in x.iter_mut().zip(new.iter().zip(old)) {
                *x = if INTEGER {
                    let [new, old]: [[i16; 2]; 2] = cast([new, old]);
                    cast([new[0].wrapping_sub(old[0]), new[1].wrapping_sub(old[1])])
                } else {
                    new
                };
            }
            let weights = weights[edge.basis[0] as usize * words * B * 16..].chunks_exact(16 * B);
            for (i, (&x, weights)) in x[..words].iter().zip(weights).enumerate() {
                let x = splat(v, x);
                for (b, acc) in acc[i % 4].iter_mut().enumerate() {
                    *acc = Self::add_inputs(v, *acc, x, Self::load(weights, b));
                }
            }
        }
        let f = v.avx512f;
        let add = |a, b| {
            if INTEGER { f._mm512_add_epi32(a, b) } else { cast(f._mm512_add_ps(cast(a), cast(b))) }
        };
        let totals = std::array::from_fn(|b| add(add(acc[0][b], acc[1][b]), add(acc[2][b], acc[3][b])));
        state.copy_from_slice(&totals[..kept]);
        totals
    }

    /// y' of a block: y = ELU(a factor + bias) scale + shift.
    #[inline(always)]
    fn finish<S: Simd>(&mut self, simd: S, row: usize, b: usize, totals: __m512i) {
        let (f, [factor, bias, scale, shift]) = (self.v.avx512f, &self.factors[b]);
        let totals: [f32; 16] = if INTEGER { cast(f._mm512_cvtepi32_ps(totals)) } else { cast(totals) };
        let sums = S::V16::load_slice(simd, &totals);
        let y = S::V16::load(simd, bias).add_product(sums, S::V16::load(simd, factor)).map(simd, elu);
        let mut out = Wide::ZERO;
        S::V16::load(simd, shift).add_product(y, S::V16::load(simd, scale)).store(&mut out);
        let to = &mut self.out[(row * B + b) * Self::VALUES..][..Self::VALUES];
        if INTEGER {
            let rounded = f._mm512_cvtsepi32_epi16(f._mm512_cvtps_epi32(cast(out.0)));
            to.copy_from_slice(&cast::<_, [i32; 8]>(rounded));
        } else {
            to.copy_from_slice(&cast::<_, [i32; 16]>(out.0));
        }
    }

    /// Looks up weights by the attributes of the first `per_row` in-edges. Where `updated`, totals are kept, and each of
    /// these edges changes its source; else they are computed from zero.
    pub(crate) fn look_up(&mut self, problem: &Problem, rounded: &Rounded, per_row: usize, updated: bool) {
        let at = |place| self.pack(&rounded.weights(problem, place)).collect::<Vec<_>>();
        self.weights = vectors((0..rounded.bases.len()).flat_map(at));
        let edge = |(n, &place): (&Neighbour, &u32)| {
            let new = if updated { problem.instead(n.row) } else { n.row };
            Edges { rows: [new, n.row], basis: [place as i32; 8] }
        };
        let edges: Vec<Edges> = problem.edges.iter().zip(&rounded.places).map(edge).collect();
        self.edges = edges.chunks(problem.degree).flat_map(|row| &row[..per_row]).copied().collect();
        self.per_row = per_row;
        self.state = if updated { vec![cast([0; 16]); ROWS * B] } else { Vec::new() };
    }
}

struct Run<'a, const C: usize, const B: usize, const INTEGER: bool, const BYTES: usize> {
    rows: &'a mut Rows<C, B, INTEGER, BYTES>,
    stage: Stage,
}

impl<const C: usize, const B: usize, const INTEGER: bool, const BYTES: usize> Task
    for Run<'_, C, B, INTEGER, BYTES>
{
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        // `V4` is the proof of AVX-512: no other instruction set gets here, or needs compiling.
        if !S::WIDE {
            return;
        }
        let Self { rows, stage } = self;
        for first in (0..ROWS).step_by(GROUP) {
            for row in first..first + GROUP {
                match stage {
                    Stage::ByTable => {
                        let totals = rows.row_by_table(row);
                        totals
                            .into_iter()
                            .enumerate()
                            .for_each(|(b, total)| rows.finish(simd, row, b, total));
                    }
                    Stage::Contraction => {}
                    _ if C == 32 => rows.row_sums::<2>(row),
                    _ => rows.row_sums::<1>(row),
                }
            }
            if matches!(stage, Stage::Contraction | Stage::Whole) {
                simd.apart(&mut *rows);
            }
            if stage == Stage::Whole {
                for i in 0..GROUP * B {
                    rows.finish(simd, first + i / B, i % B, rows.totals[i]);
                }
            }
        }
    }
}

/// Computes the totals (row, block) of a group from its sums.
impl<const C: usize, const B: usize, const INTEGER: bool, const BYTES: usize> Task
    for &mut Rows<C, B, INTEGER, BYTES>
{
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        if !S::WIDE {
            return;
        }
        let (v, n) = (self.v, Rows::<C, B, INTEGER, BYTES>::SUMS);
        let rows: [&[i32]; GROUP] = std::array::from_fn(|r| &self.sums[r * n..][..n]);
        let weights = cast_slice(&self.weights);
        let mut acc = [[splat(v, 0); B]; GROUP];
        for i in 0..n {
            let mut w = [splat(v, 0); B];
            for (b, w) in w.iter_mut().enumerate() {
                *w = Rows::<C, B, INTEGER, BYTES>::load(weights, i * B + b);
            }
            for (acc, row) in acc.iter_mut().zip(&rows) {
                let x = splat(v, row[i]);
                for (acc, &w) in acc.iter_mut().zip(&w) {
                    *acc = Rows::<C, B, INTEGER, BYTES>::add_inputs(v, *acc, x, w);
                }
            }
        }
        self.totals.copy_from_slice(acc.as_flattened());
    }
}

impl<const C: usize, const B: usize> Rows<C, B, true, 2> {
    /// Makes the rows start from the sums that they have, and replace the sources of the first `changed` in-edges of each:
    /// S' += sum over changed e of B'(e) (x'new - x'old), then T' and all of a' again. A changed edge touches all eight
    /// slots of a 2 x 2 x 2 kernel, so that nothing of the contraction is saved.
    ///
    /// # Panics
    /// If the updated sums are not those that are computed from zero.
    pub(crate) fn update_by_slots(&mut self, problem: &Problem, changed: usize) {
        self.keep_sums();
        let before = self.state.clone();
        let mut changes = Vec::new();
        for row in self.edges.chunks_mut(self.per_row) {
            for e in 0..changed {
                let old = row[e / 2].rows[e % 2];
                let rows = [problem.instead(old), old];
                row[e / 2].rows[e % 2] = rows[0];
                let basis = row[e / 2].basis.map(|both| {
                    let basis = cast::<i32, [i16; 2]>(both)[e % 2];
                    cast([basis, -basis])
                });
                changes.push(Edges { rows, basis });
            }
        }
        self.keep_sums();
        let expected = std::mem::replace(&mut self.state, before);
        (self.edges, self.per_row) = (changes, changed);
        self.run(Stage::Sums);
        assert!(cast_slice::<_, i32>(&self.state) == cast_slice::<_, i32>(&expected), "updated sums");
    }

    /// Looks up weights, and updates every row and back.
    ///
    /// # Panics
    /// If the totals are not those from before.
    pub(crate) fn update_by_table(&mut self, problem: &Problem, rounded: &Rounded, changed: usize) {
        self.look_up(problem, rounded, changed, true);
        for _ in 0..2 {
            self.run(Stage::ByTable);
            self.edges.iter_mut().for_each(|edge| edge.rows.reverse());
        }
        assert!(cast_slice::<_, i32>(&self.state).iter().all(|&total| total == 0), "totals updated by table");
    }
}

/// Vector `n` of `N` words.
#[inline(always)]
fn vector<const N: usize>(words: &[i32], n: usize) -> [i32; N] {
    words[n * N..][..N].try_into().expect("N words")
}

/// Every word `word`.
#[inline(always)]
fn splat(v: V4, word: i32) -> __m512i {
    v.avx512f._mm512_set1_epi32(word)
}

/// Bytes as aligned vectors, the last one padded with zeros.
fn vectors(bytes: impl Iterator<Item = u8>) -> Vec<__m512i> {
    let padded =
        |bytes: &[u8]| cast(std::array::from_fn::<u8, 64, _>(|i| bytes.get(i).copied().unwrap_or(0)));
    bytes.collect::<Vec<_>>().chunks(64).map(padded).collect()
}
