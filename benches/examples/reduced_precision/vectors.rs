//! Sixteen sums of integers in a register: products of two i16, or of four u8 with i8, added to each.
//!
//! The compiler does not find these instructions in plain loops over i16 (it multiplies in 32 bits, which is slower
//! than f32), so they come from the crate `pulp`, which wraps them behind a proof that the processor has them. With
//! `RUSTFLAGS="-C target-cpu=native"` on a processor with VNNI, the compiler makes one instruction of product and sum.

use std::arch::x86_64::__m512i;

use pulp::x86::V4;

/// Values that one register of weights holds, as words of 32 bits: sixteen outputs, two or four inputs each.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Words(pub(crate) [i32; 16]);

/// How sums of inputs and weights are stored, and multiplied.
pub(crate) trait Dot: Copy {
    /// Inputs in a word.
    const DEPTH: usize;
    /// Largest magnitude of a stored sum of inputs.
    const LARGEST: i32;
    /// Largest magnitude of a weight.
    const WEIGHT: f32;
    /// What is added to a stored sum of inputs, so that it is not negative.
    const ZERO: i32;
    /// Packs the sums of sixteen inputs; the words that are used come first.
    fn pack(v: V4, sums: __m512i) -> [i32; 8];
    /// Packs the weights of one output on `DEPTH` inputs.
    fn word(weights: &[i32]) -> i32;
    /// acc + inputs weights.
    fn dot(v: V4, acc: __m512i, inputs: __m512i, weights: __m512i) -> __m512i;
}

/// Pairs of i16.
#[derive(Clone, Copy)]
pub(crate) struct Pairs;

impl Dot for Pairs {
    const DEPTH: usize = 2;
    const LARGEST: i32 = 32_767;
    const WEIGHT: f32 = 127.0;
    const ZERO: i32 = 0;

    #[inline(always)]
    fn pack(v: V4, sums: __m512i) -> [i32; 8] {
        pulp::cast(v.avx512f._mm512_cvtsepi32_epi16(sums))
    }

    fn word(weights: &[i32]) -> i32 {
        pulp::cast([weights[0] as i16, weights[1] as i16])
    }

    #[inline(always)]
    fn dot(v: V4, acc: __m512i, inputs: __m512i, weights: __m512i) -> __m512i {
        v.avx512f._mm512_add_epi32(acc, v.avx512bw._mm512_madd_epi16(inputs, weights))
    }
}

/// Pairs of i16 that share the bits of a sum: 256 products of 4095 and 2047 fit an i32.
#[derive(Clone, Copy)]
pub(crate) struct Balanced;

impl Dot for Balanced {
    const DEPTH: usize = 2;
    const LARGEST: i32 = 4_095;
    const WEIGHT: f32 = 2_047.0;
    const ZERO: i32 = 0;

    #[inline(always)]
    fn pack(v: V4, sums: __m512i) -> [i32; 8] {
        Pairs::pack(v, sums)
    }

    fn word(weights: &[i32]) -> i32 {
        Pairs::word(weights)
    }

    #[inline(always)]
    fn dot(v: V4, acc: __m512i, inputs: __m512i, weights: __m512i) -> __m512i {
        Pairs::dot(v, acc, inputs, weights)
    }
}

/// Fours of u8, up to 127 so that two products fit an i16, with i8.
#[derive(Clone, Copy)]
pub(crate) struct Fours;

impl Dot for Fours {
    const DEPTH: usize = 4;
    const LARGEST: i32 = 63;
    const WEIGHT: f32 = 127.0;
    const ZERO: i32 = 64;

    #[inline(always)]
    fn pack(v: V4, sums: __m512i) -> [i32; 8] {
        let f = v.avx512f;
        let shifted = f._mm512_add_epi32(sums, f._mm512_set1_epi32(Self::ZERO));
        let clamped = f._mm512_max_epi32(shifted, f._mm512_setzero_si512());
        let clamped = f._mm512_min_epi32(clamped, f._mm512_set1_epi32(127));
        let words: [i32; 4] = pulp::cast(f._mm512_cvtepi32_epi8(clamped));
        [words[0], words[1], words[2], words[3], 0, 0, 0, 0]
    }

    fn word(weights: &[i32]) -> i32 {
        pulp::cast([weights[0] as i8, weights[1] as i8, weights[2] as i8, weights[3] as i8])
    }

    #[inline(always)]
    fn dot(v: V4, acc: __m512i, inputs: __m512i, weights: __m512i) -> __m512i {
        let pairs = v.avx512bw._mm512_maddubs_epi16(inputs, weights);
        let fours = v.avx512bw._mm512_madd_epi16(pairs, v.avx512f._mm512_set1_epi32(0x0001_0001));
        v.avx512f._mm512_add_epi32(acc, fours)
    }
}

/// Every word `word`.
#[inline(always)]
pub(crate) fn splat(v: V4, word: i32) -> __m512i {
    v.avx512f._mm512_set1_epi32(word)
}

/// Pairs of the values of two rows, sixteen channels from `at`: the first row's in the lower halves.
#[inline(always)]
pub(crate) fn interleave(v: V4, [a, b]: [&[i16]; 2], at: usize) -> __m512i {
    let widen = |row: &[i16]| {
        let values: [i16; 16] = row[at..][..16].try_into().expect("sixteen values");
        v.avx512f._mm512_cvtepu16_epi32(pulp::cast(values))
    };
    v.avx512f._mm512_or_si512(widen(a), v.avx512f._mm512_slli_epi32::<16>(widen(b)))
}

/// Sums over 2^shift, to nearest.
#[inline(always)]
pub(crate) fn shift_right(v: V4, sums: __m512i, shift: u32) -> __m512i {
    let half = splat(v, 1 << shift >> 1);
    v.avx512f._mm512_srav_epi32(v.avx512f._mm512_add_epi32(sums, half), splat(v, shift as i32))
}
