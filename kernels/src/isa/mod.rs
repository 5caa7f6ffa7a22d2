//! Instruction sets: values that exist only where the processor has them.
//!
//! A kernel is written once, as a [`Task`] whose `run` is generic over [`Simd`] and inlined into a thin wrapper per
//! instruction set; holding an [`Isa`], or a vector of one, is the proof that its instructions may be executed. All
//! compute the same bits (see the crate's header), so the choice is one of speed alone. On `aarch64`, NEON is in the
//! baseline and therefore in the portable path.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod exponent;
mod memory;
mod panel;
mod planar;
mod portable;
#[cfg(target_arch = "x86_64")]
mod registers;
mod vector;

pub use exponent::Exponent;
pub(crate) use memory::{flat, flat_mut, flat_wide, flat_wide_mut, lanes_of_wide};
pub(crate) use panel::{Runs, accumulate, accumulate_in_four, accumulate_runs, accumulate_wide};
pub(crate) use planar::{Taps, accumulate_taps};
pub use portable::{Portable, fused};
pub use vector::{Simd, Vector};

/// Work that can be compiled for several instruction sets. `run` must be `#[inline(always)]`, and so must be all that
/// it calls in its inner loops, or it runs with the build's baseline instructions.
pub trait Task {
    /// What the work returns.
    type Output;
    /// Does the work with `simd`'s vectors.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

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
    /// What the build's target guarantees.
    pub fn portable() -> Self {
        Self(Kind::Portable)
    }

    /// The fastest that this processor has.
    pub fn best() -> Self {
        Self::available().pop().unwrap_or(Self::portable())
    }

    /// All that this processor has, slowest first.
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

    /// A name for reports.
    pub fn name(self) -> &'static str {
        match self.0 {
            Kind::Portable => "portable",
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
            Kind::Portable => task.run(Portable),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(simd) => simd.enter(task),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(simd) => simd.enter(task),
        }
    }
}
