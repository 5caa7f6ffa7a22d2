//! AVX-512 (F, VL, DQ, BW) with AVX2 and FMA: 32 registers of sixteen f32.

use std::arch::x86_64::{
    __m256, __m512, _CMP_LE_OQ, _mm256_add_epi32, _mm256_add_ps, _mm256_and_ps, _mm256_andnot_ps,
    _mm256_blendv_ps, _mm256_castps_si256, _mm256_castsi256_ps, _mm256_cmp_ps_mask, _mm256_cmpneq_epi32_mask,
    _mm256_div_ps, _mm256_fmadd_ps, _mm256_loadu_ps, _mm256_max_ps, _mm256_mul_ps, _mm256_or_ps,
    _mm256_set1_epi32, _mm256_set1_ps, _mm256_slli_epi32, _mm256_storeu_ps, _mm256_sub_ps, _mm512_add_epi32,
    _mm512_add_ps, _mm512_and_ps, _mm512_andnot_ps, _mm512_castps_si512, _mm512_castsi512_ps,
    _mm512_cmp_ps_mask, _mm512_cmpneq_epi32_mask, _mm512_div_ps, _mm512_fmadd_ps, _mm512_loadu_ps,
    _mm512_mask_blend_ps, _mm512_max_ps, _mm512_movepi32_mask, _mm512_mul_ps, _mm512_or_ps,
    _mm512_set1_epi32, _mm512_set1_ps, _mm512_slli_epi32, _mm512_storeu_ps, _mm512_sub_ps,
};

use super::registers::{exponent, register};
use super::vector::{Simd, Task, Vector};
use crate::lanes::{LANES, Lanes, Wide};

/// Proof that the processor has these instructions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Avx512(());

impl Avx512 {
    pub(super) fn detect() -> Option<Self> {
        let all = std::is_x86_feature_detected!("avx512f")
            && std::is_x86_feature_detected!("avx512vl")
            && std::is_x86_feature_detected!("avx512dq")
            && std::is_x86_feature_detected!("avx512bw")
            && std::is_x86_feature_detected!("avx2")
            && std::is_x86_feature_detected!("fma");
        all.then_some(Self(()))
    }

    #[inline]
    pub(super) fn enter<T: Task>(self, task: T) -> T::Output {
        // SAFETY: only `detect` creates `self`, after the processor reported that it has them.
        unsafe { run(self, task) }
    }
}

#[inline(never)]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma")]
fn run<T: Task>(simd: Avx512, task: T) -> T::Output {
    task.run(simd)
}

impl Simd for Avx512 {
    type V8 = F32x8;
    type V16 = F32x16;
    const WIDE: bool = true;
    const FUSED: bool = true;

    #[inline(always)]
    fn apart<T: Task>(self, task: T) -> T::Output {
        self.enter(task)
    }
}

/// Eight f32 in a register. Made only from an [`Avx512`] or another `F32x8`, so it is also a proof.
#[derive(Clone, Copy, Debug)]
pub(super) struct F32x8(__m256);

/// Sixteen f32 in a register. Made only from an [`Avx512`] or another `F32x16`, so it is also a
/// proof.
#[derive(Clone, Copy, Debug)]
pub(super) struct F32x16(__m512);

register!(
    Avx512,
    F32x8,
    LANES,
    Lanes,
    [_mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps],
    [_mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps, _mm256_fmadd_ps, _mm256_max_ps],
    [
        |a, b| u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b)),
        |a, b| { u32::from(_mm256_cmpneq_epi32_mask(_mm256_castps_si256(a), _mm256_castps_si256(b))) }
    ]
);
register!(
    Avx512,
    F32x16,
    2 * LANES,
    Wide,
    [_mm512_set1_ps, _mm512_loadu_ps, _mm512_storeu_ps],
    [_mm512_add_ps, _mm512_sub_ps, _mm512_mul_ps, _mm512_fmadd_ps, _mm512_max_ps],
    [
        |a, b| u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b)),
        |a, b| { u32::from(_mm512_cmpneq_epi32_mask(_mm512_castps_si512(a), _mm512_castps_si512(b))) }
    ]
);
exponent!(
    Avx512,
    F32x8,
    [_mm256_set1_ps, _mm256_div_ps, _mm256_and_ps, _mm256_andnot_ps, _mm256_or_ps],
    [_mm256_set1_epi32, _mm256_slli_epi32, _mm256_add_epi32, _mm256_castps_si256, _mm256_castsi256_ps],
    |a, of, other| _mm256_blendv_ps(other, a, of)
);
exponent!(
    Avx512,
    F32x16,
    [_mm512_set1_ps, _mm512_div_ps, _mm512_and_ps, _mm512_andnot_ps, _mm512_or_ps],
    [_mm512_set1_epi32, _mm512_slli_epi32, _mm512_add_epi32, _mm512_castps_si512, _mm512_castsi512_ps],
    |a, of, other| _mm512_mask_blend_ps(_mm512_movepi32_mask(_mm512_castps_si512(of)), other, a)
);
