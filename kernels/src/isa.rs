//! Instruction sets: a value that exists only where the processor has it.
//!
//! A kernel is written once, as a [`Task`] whose `run` is inlined into a thin wrapper per instruction set; holding an
//! [`Isa`] is the proof that its instructions may be executed. All compute the same bits (see the crate's header), so
//! the choice is one of speed alone. On `aarch64`, NEON is in the baseline and therefore in the portable path.

/// Work that can be compiled for several instruction sets. `run` must be `#[inline(always)]`, and so must be all that
/// it calls in its inner loops, or it runs with the build's baseline instructions.
pub trait Task {
    /// What the work returns.
    type Output;
    /// Does the work.
    fn run(self) -> Self::Output;
}

/// An instruction set that this processor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Isa(Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
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
        if std::is_x86_feature_detected!("avx2") {
            all.push(Self(Kind::Avx2));
        }
        all
    }

    /// A name for reports.
    pub fn name(self) -> &'static str {
        match self.0 {
            Kind::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => "avx2",
        }
    }

    /// Runs `task` with these instructions.
    #[inline]
    pub fn run<T: Task>(self, task: T) -> T::Output {
        match self.0 {
            Kind::Portable => task.run(),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Kind::Avx2` is made in `available` alone, after the processor said that it has AVX2.
            Kind::Avx2 => unsafe { avx2(task) },
        }
    }
}

/// `task`, compiled with AVX2.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2<T: Task>(task: T) -> T::Output {
    task.run()
}
