//! Instruction sets, as values that exist only on processors that have them.
//!
//! A kernel is written once, as a [`Task`] whose `run` is generic over [`Simd`] and inlined into a
//! thin wrapper per instruction set. Holding an [`Isa`], or a vector of one, proves that its
//! instructions may be executed. All instruction sets compute the same bits. On `aarch64`, NEON is
//! in the baseline and therefore in the portable path.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
pub(crate) mod panel;
pub(crate) mod portable;
#[cfg(target_arch = "x86_64")]
mod registers;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod simd128;
pub(crate) mod vector;

pub(crate) use panel::{Taps, accumulate, accumulate_in_four, accumulate_taps, accumulate_wide, begin, end};
pub use portable::{Portable, fused};
pub use vector::{Divisor, Exponent, Simd, Task, Vector};
pub(crate) use vector::{Stored, Sum};

use crate::lanes::{LANES, Lanes, Wide};

// The instruction set of every processor that can run the build. A module with SIMD128 needs no
// other.
#[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
use portable::Portable as Baseline;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use simd128::Simd128 as Baseline;
const BASELINE: &str =
    if cfg!(all(target_arch = "wasm32", target_feature = "simd128")) { "simd128" } else { "portable" };

/// An instruction set that this processor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Isa(Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2(avx2::Avx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(avx512::Avx512),
}

impl Isa {
    /// The instructions that the build's target guarantees.
    pub fn portable() -> Self {
        Self(Kind::Portable)
    }

    /// The fastest instruction set of this processor.
    pub fn best() -> Self {
        Self::available().pop().unwrap_or(Self::portable())
    }

    /// All instruction sets of this processor, slowest first.
    pub fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "some targets have nothing beyond their baseline")]
        let mut all = vec![Self::portable()];
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(avx2::Avx2::detect().map(|simd| Self(Kind::Avx2(simd))));
            all.extend(avx512::Avx512::detect().map(|simd| Self(Kind::Avx512(simd))));
        }
        all
    }

    /// Name for reports.
    pub fn name(self) -> &'static str {
        match self.0 {
            Kind::Portable => BASELINE,
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(_) => "avx512",
        }
    }

    /// Runs `task` with these instructions.
    #[inline]
    pub fn run<T: Task>(self, task: T) -> T::Output {
        match self.0 {
            Kind::Portable => Baseline.apart(task),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(simd) => simd.enter(task),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(simd) => simd.enter(task),
        }
    }
}

/// Asks for a cache line in each 64 bytes of `values`, which will be read soon, without waiting for
/// them. No result depends on it. Does nothing on targets without such an instruction.
#[inline(always)]
pub fn prefetch<T>(values: &[T]) {
    for line in (0..size_of_val(values)).step_by(64) {
        prefetch_at(values.as_ptr().wrapping_byte_add(line));
    }
}

/// Asks for one cache line.
#[inline(always)]
pub(crate) fn prefetch_at<T>(address: *const T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: the instruction is in the baseline, and changes nothing but caches.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

const _: () = assert!(size_of::<Lanes>() == LANES * size_of::<f32>());
const _: () =
    assert!(size_of::<Wide>() == 2 * size_of::<Lanes>() && align_of::<Wide>() >= align_of::<Lanes>());

/// The values of `lanes` as a flat slice.
#[inline(always)]
pub(crate) fn flat(lanes: &[Lanes]) -> &[f32] {
    // SAFETY: `Lanes` is `repr(C)` around [f32; LANES] and as large, so a slice of it is LANES
    // times as many f32 without a gap; alignment loosens, the lifetime is the same.
    unsafe { std::slice::from_raw_parts(lanes.as_ptr().cast(), lanes.len() * LANES) }
}

#[inline(always)]
pub(crate) fn flat_mut(lanes: &mut [Lanes]) -> &mut [f32] {
    // SAFETY: as in `flat`; any bits are a valid f32, and the borrow is unique.
    unsafe { std::slice::from_raw_parts_mut(lanes.as_mut_ptr().cast(), lanes.len() * LANES) }
}

/// The values of `wide` as a flat slice.
#[inline(always)]
pub(crate) fn flat_wide(wide: &[Wide]) -> &[f32] {
    // SAFETY: as in `flat`: `Wide` is `repr(C)` around [f32; 2 LANES] and as large as that.
    unsafe { std::slice::from_raw_parts(wide.as_ptr().cast(), wide.len() * 2 * LANES) }
}

#[inline(always)]
pub(crate) fn flat_wide_mut(wide: &mut [Wide]) -> &mut [f32] {
    // SAFETY: as in `flat_wide`; any bits are a valid f32, and the borrow is unique.
    unsafe { std::slice::from_raw_parts_mut(wide.as_mut_ptr().cast(), wide.len() * 2 * LANES) }
}

/// The values of `wide`, in lanes.
#[inline(always)]
pub(crate) fn lanes_of_wide(wide: &[Wide]) -> &[Lanes] {
    // SAFETY: a `Wide` is as large as two `Lanes`, both f32 without a gap; alignment loosens.
    unsafe { std::slice::from_raw_parts(wide.as_ptr().cast(), wide.len() * 2) }
}
