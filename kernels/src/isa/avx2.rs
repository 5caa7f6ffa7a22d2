//! AVX2 with fused multiply-add: 16 registers of eight f32.

use std::arch::x86_64::{
    __m256, _CMP_LE_OQ, _mm256_add_epi32, _mm256_add_ps, _mm256_and_ps, _mm256_andnot_ps, _mm256_blendv_ps,
    _mm256_castps_si256, _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_cmpeq_epi32, _mm256_div_ps,
    _mm256_fmadd_ps, _mm256_loadu_ps, _mm256_max_ps, _mm256_movemask_ps, _mm256_mul_ps, _mm256_or_ps,
    _mm256_set1_epi32, _mm256_set1_ps, _mm256_slli_epi32, _mm256_storeu_ps, _mm256_sub_ps,
};

use super::registers::{exponent, register};
use super::vector::{Simd, Task, Vector};
use crate::lanes::{LANES, Lanes, Wide};

/// Proof that the processor has AVX2 and FMA.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Avx2(());

impl Avx2 {
    pub(super) fn detect() -> Option<Self> {
        (std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma")).then_some(Self(()))
    }

    #[inline]
    pub(super) fn enter<T: Task>(self, task: T) -> T::Output {
        // SAFETY: only `detect` creates `self`, after the processor reported that it has both.
        unsafe { run(self, task) }
    }
}

#[inline(never)]
#[target_feature(enable = "avx2,fma")]
fn run<T: Task>(simd: Avx2, task: T) -> T::Output {
    task.run(simd)
}

/// Eight f32 in a register. Made only from an [`Avx2`] or another `F32x8`, so it is also a proof.
#[derive(Clone, Copy, Debug)]
pub(super) struct F32x8(__m256);

impl Simd for Avx2 {
    type V8 = F32x8;
    type V16 = [F32x8; 2];
    const WIDE: bool = false;
    const FUSED: bool = true;

    #[inline(always)]
    fn apart<T: Task>(self, task: T) -> T::Output {
        self.enter(task)
    }
}

register!(
    Avx2,
    F32x8,
    LANES,
    Lanes,
    [_mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps],
    [_mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps, _mm256_fmadd_ps, _mm256_max_ps],
    [
        |a, b| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32,
        |a, b| {
            let same = _mm256_cmpeq_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b));
            0xFF ^ _mm256_movemask_ps(_mm256_castsi256_ps(same)) as u32
        }
    ]
);

exponent!(
    Avx2,
    F32x8,
    [_mm256_set1_ps, _mm256_div_ps, _mm256_and_ps, _mm256_andnot_ps, _mm256_or_ps],
    [_mm256_set1_epi32, _mm256_slli_epi32, _mm256_add_epi32, _mm256_castps_si256, _mm256_castsi256_ps],
    |a, of, other| _mm256_blendv_ps(other, a, of)
);

impl Vector<Avx2> for [F32x8; 2] {
    type Memory = Wide;
    type Sum = Self;
    const LANES: usize = 2 * LANES;
    const ZEROS: Wide = Wide::ZERO;

    #[inline(always)]
    fn splat(simd: Avx2, value: f32) -> Self {
        [F32x8::splat(simd, value); 2]
    }
    #[inline(always)]
    fn load(simd: Avx2, from: &Wide) -> Self {
        Self::load_slice(simd, &from.0)
    }
    #[inline(always)]
    fn load_slice(simd: Avx2, from: &[f32]) -> Self {
        let (low, high) = from[..2 * LANES].split_at(LANES);
        [F32x8::load_slice(simd, low), F32x8::load_slice(simd, high)]
    }
    #[inline(always)]
    fn store(self, to: &mut Wide) {
        self.store_slice(&mut to.0);
    }
    #[inline(always)]
    fn store_slice(self, to: &mut [f32]) {
        let (low, high) = to[..2 * LANES].split_at_mut(LANES);
        self[0].store_slice(low);
        self[1].store_slice(high);
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        [self[0].add(other[0]), self[1].add(other[1])]
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        [self[0].sub(other[0]), self[1].sub(other[1])]
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        [self[0].mul(other[0]), self[1].mul(other[1])]
    }
    #[inline(always)]
    fn add_product(self, a: Self, b: Self) -> Self {
        [self[0].add_product(a[0], b[0]), self[1].add_product(a[1], b[1])]
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        [self[0].max(other[0]), self[1].max(other[1])]
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> u32 {
        self[0].at_most(other[0]) | self[1].at_most(other[1]) << LANES
    }
    #[inline(always)]
    fn differs(self, other: Self) -> u32 {
        self[0].differs(other[0]) | self[1].differs(other[1]) << LANES
    }
}
