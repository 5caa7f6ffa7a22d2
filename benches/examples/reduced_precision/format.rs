//! Number formats: how activations, sums and weights are stored and multiplied, sixteen at a time.
//!
//! Registers and words of memory are 32-bit words whatever they hold: one f32, one i32, two i16 or four bytes. The
//! compiler does not find the integer instructions in plain loops over i16 (it multiplies in 32 bits, slower than f32), so
//! they come from the crate `pulp`, which wraps them behind a proof that the processor has them. With
//! `RUSTFLAGS="-C target-cpu=native"` on a processor with VNNI, the compiler makes one instruction of product and sum.

use std::arch::x86_64::__m512i;
use std::marker::PhantomData;

use pulp::cast;
use pulp::x86::V4;

/// Sixteen words in memory.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Words(pub(crate) [i32; 16]);

/// Activations as they are stored, and the arithmetic of their sums.
pub(crate) trait Value: Copy + Default {
    /// In-edges whose products one instruction adds.
    const EDGES: usize;
    /// The nearest value to a number of steps.
    fn of(steps: f32) -> Self;
    fn to_f32(self) -> f32;
    /// The change from an old activation to a new one; in f32, which is not updated, the new one.
    fn change(new: Self, old: Self) -> Self;
    /// A word of activations, or of the basis of [`Self::EDGES`] edges.
    fn word(values: &[Self]) -> i32;
    /// Sixteen channels from `at` of each edge's source.
    fn sources(v: V4, rows: [&[Self]; 2], at: usize) -> __m512i;
    /// sums + words sources.
    fn add_products(v: V4, sums: __m512i, words: __m512i, sources: __m512i) -> __m512i;
    fn add(v: V4, a: __m512i, b: __m512i) -> __m512i;
    fn totals(v: V4, totals: __m512i) -> [f32; 16];
    fn results(v: V4, results: [f32; 16]) -> [Self; 16];
}

impl Value for f32 {
    const EDGES: usize = 1;

    fn of(steps: f32) -> f32 {
        steps
    }
    fn to_f32(self) -> f32 {
        self
    }
    #[inline(always)]
    fn change(new: f32, _: f32) -> f32 {
        new
    }
    #[inline(always)]
    fn word(values: &[f32]) -> i32 {
        cast(values[0])
    }
    #[inline(always)]
    fn sources(_: V4, [row, _]: [&[f32]; 2], at: usize) -> __m512i {
        let values: [f32; 16] = row[at..][..16].try_into().expect("sixteen values");
        cast(values)
    }
    #[inline(always)]
    fn add_products(v: V4, sums: __m512i, words: __m512i, sources: __m512i) -> __m512i {
        cast(v.avx512f._mm512_fmadd_ps(cast(words), cast(sources), cast(sums)))
    }
    #[inline(always)]
    fn add(v: V4, a: __m512i, b: __m512i) -> __m512i {
        cast(v.avx512f._mm512_add_ps(cast(a), cast(b)))
    }
    #[inline(always)]
    fn totals(_: V4, totals: __m512i) -> [f32; 16] {
        cast(totals)
    }
    #[inline(always)]
    fn results(_: V4, results: [f32; 16]) -> [f32; 16] {
        results
    }
}

impl Value for i16 {
    const EDGES: usize = 2;

    fn of(steps: f32) -> i16 {
        steps.round_ties_even() as i16
    }
    fn to_f32(self) -> f32 {
        self.into()
    }
    #[inline(always)]
    fn change(new: i16, old: i16) -> i16 {
        new.wrapping_sub(old)
    }
    #[inline(always)]
    fn word(values: &[i16]) -> i32 {
        cast([values[0], values[1]])
    }
    #[inline(always)]
    fn sources(v: V4, [a, b]: [&[i16]; 2], at: usize) -> __m512i {
        let widen = |row: &[i16]| {
            let values: [i16; 16] = row[at..][..16].try_into().expect("sixteen values");
            v.avx512f._mm512_cvtepu16_epi32(cast(values))
        };
        v.avx512f._mm512_or_si512(widen(a), v.avx512f._mm512_slli_epi32::<16>(widen(b)))
    }
    #[inline(always)]
    fn add_products(v: V4, sums: __m512i, words: __m512i, sources: __m512i) -> __m512i {
        v.avx512f._mm512_add_epi32(sums, v.avx512bw._mm512_madd_epi16(words, sources))
    }
    #[inline(always)]
    fn add(v: V4, a: __m512i, b: __m512i) -> __m512i {
        v.avx512f._mm512_add_epi32(a, b)
    }
    #[inline(always)]
    fn totals(v: V4, totals: __m512i) -> [f32; 16] {
        cast(v.avx512f._mm512_cvtepi32_ps(totals))
    }
    #[inline(always)]
    fn results(v: V4, results: [f32; 16]) -> [i16; 16] {
        cast(v.avx512f._mm512_cvtsepi32_epi16(v.avx512f._mm512_cvtps_epi32(cast(results))))
    }
}

/// How the sums of inputs and the weights of outputs are stored and multiplied.
pub(crate) trait Format {
    type Value: Value;
    /// The stored weights of sixteen outputs on [`Self::DEPTH`] inputs.
    type Weights: Weight;
    /// Inputs whose products one instruction adds.
    const DEPTH: usize;
    /// Largest magnitude that the weights of an output are scaled to, if any.
    const WEIGHT: Option<f32>;
    /// Largest magnitude of a stored sum of inputs, if sums are shifted.
    const SUM: Option<i32> = None;
    /// Added to a stored sum of inputs, so that it is not negative.
    const ZERO: i32 = 0;
    /// Packs the sums of sixteen inputs; the first 16 / DEPTH words count.
    fn pack(v: V4, sums: __m512i) -> [i32; 16];
    /// Stores the weights on one input after the other, in steps.
    fn store(weights: &[[f32; 16]]) -> Self::Weights;
    /// totals + inputs weights.
    #[inline(always)]
    fn add_inputs(v: V4, totals: __m512i, inputs: __m512i, weights: __m512i) -> __m512i {
        Self::Value::add_products(v, totals, inputs, weights)
    }
}

/// f32 throughout, with weights that are stored as `W` and widened when they are read.
pub(crate) struct Float<W>(PhantomData<W>);

/// Sixteen stored words of weights.
pub(crate) trait Weight: Copy {
    const LARGEST: Option<f32> = None;
    /// Stores sixteen weights in f32.
    fn store(weights: [f32; 16]) -> Self;
    fn load(self) -> __m512i;
}

impl Weight for Words {
    fn store(weights: [f32; 16]) -> Self {
        Self(cast(weights))
    }
    #[inline(always)]
    fn load(self) -> __m512i {
        cast(self.0)
    }
}

/// The upper halves of sixteen f32.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub(crate) struct Halves([u16; 16]);

impl Weight for Halves {
    fn store(weights: [f32; 16]) -> Self {
        // To nearest, ties to even.
        Self(weights.map(|w| ((w.to_bits() + 0x7fff + (w.to_bits() >> 16 & 1)) >> 16) as u16))
    }
    #[inline(always)]
    fn load(self) -> __m512i {
        cast(self.0.map(|w| f32::from_bits(u32::from(w) << 16)))
    }
}

/// Sixteen integers, in steps of their output.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(crate) struct Bytes([i8; 16]);

impl Weight for Bytes {
    const LARGEST: Option<f32> = Some(127.0);
    fn store(weights: [f32; 16]) -> Self {
        Self(weights.map(|w| w.round_ties_even() as i8))
    }
    #[inline(always)]
    fn load(self) -> __m512i {
        cast(self.0.map(f32::from))
    }
}

impl<W: Weight> Format for Float<W> {
    type Value = f32;
    type Weights = W;
    const DEPTH: usize = 1;
    const WEIGHT: Option<f32> = W::LARGEST;

    #[inline(always)]
    fn pack(_: V4, sums: __m512i) -> [i32; 16] {
        cast(sums)
    }
    fn store(weights: &[[f32; 16]]) -> W {
        W::store(weights[0])
    }
}

/// Pairs of i16, with the largest magnitudes of a stored sum and of a weight.
///
/// ```text
/// x' = round(x / X)            X: largest |x| of the layer over 127 (i8) or 32767 (i16)
/// B' = round(B 2^k)            k = 7 with i8, 11 with i16
/// S' = sum of B' x'            exact in i32
/// T' = round(S' / 2^h)         as the weights read it: i16, or seven bits; 2^h from the largest |S'| of all rows
/// a' = sum of T' W'            exact in i32; W' = round(W / w(o)), w(o): largest |W| of the output over 127 or 2047
/// y' = round(y(a') / Y)        y(a'): back to f32 with one factor an output; ELU and batch norm in f32
/// ```
pub(crate) struct Pairs<const SUM: i32, const WEIGHT: u16>;

impl<const SUM: i32, const WEIGHT: u16> Format for Pairs<SUM, WEIGHT> {
    type Value = i16;
    type Weights = Words;
    const DEPTH: usize = 2;
    const WEIGHT: Option<f32> = Some(WEIGHT as f32);
    const SUM: Option<i32> = Some(SUM);

    #[inline(always)]
    fn pack(v: V4, sums: __m512i) -> [i32; 16] {
        let words: [i32; 8] = cast(v.avx512f._mm512_cvtsepi32_epi16(sums));
        cast([words, [0; 8]])
    }
    fn store(weights: &[[f32; 16]]) -> Words {
        Words(std::array::from_fn(|o| cast([i16::of(weights[0][o]), i16::of(weights[1][o])])))
    }
}

/// Fours of u8, up to 127 so that two products fit an i16, with i8.
pub(crate) struct Fours;

impl Format for Fours {
    type Value = i16;
    type Weights = Words;
    const DEPTH: usize = 4;
    const WEIGHT: Option<f32> = Some(127.0);
    const SUM: Option<i32> = Some(63);
    const ZERO: i32 = 64;

    #[inline(always)]
    fn pack(v: V4, sums: __m512i) -> [i32; 16] {
        let f = v.avx512f;
        let shifted = f._mm512_add_epi32(sums, splat(v, Self::ZERO));
        let clamped = f._mm512_min_epi32(f._mm512_max_epi32(shifted, splat(v, 0)), splat(v, 127));
        let words: [i32; 4] = cast(f._mm512_cvtepi32_epi8(clamped));
        cast([words, [0; 4], [0; 4], [0; 4]])
    }
    fn store(weights: &[[f32; 16]]) -> Words {
        let byte = |d: usize, o: usize| i16::of(weights[d][o]) as i8;
        Words(std::array::from_fn(|o| cast([byte(0, o), byte(1, o), byte(2, o), byte(3, o)])))
    }
    #[inline(always)]
    fn add_inputs(v: V4, totals: __m512i, inputs: __m512i, weights: __m512i) -> __m512i {
        let pairs = v.avx512bw._mm512_maddubs_epi16(inputs, weights);
        i16::add_products(v, totals, splat(v, 0x0001_0001), pairs)
    }
}

/// Every word `word`.
#[inline(always)]
pub(crate) fn splat(v: V4, word: i32) -> __m512i {
    v.avx512f._mm512_set1_epi32(word)
}
