//! What the machine can do, measured: f32 products and sums out of registers, and bytes read from each cache.
//!
//! Both loops run through the kernels' own [`Task`] mechanism, on one thread, with separate products and sums, because
//! that is what a kernel under this project's contract may use: a peak of fused multiply-adds would be another
//! machine's.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined into an instruction set's wrapper misses its instructions"
)]

use std::hint::black_box;
use std::time::Duration;

use meissner_kernels::{Isa, Lanes, Task};

use crate::timing::least_ns;

const SAMPLES: usize = 15;
const SHORTEST: Duration = Duration::from_micros(500);

/// Limits of one instruction set.
#[derive(Clone, Copy, Debug)]
pub struct Peak {
    /// Instruction set.
    pub isa: Isa,
    /// f32 operations a nanosecond, products and sums.
    pub gflops: f64,
}

impl Peak {
    /// Measures; about a tenth of a second.
    pub fn measure(isa: Isa) -> Self {
        // The best number of accumulators depends on how many registers there are and how wide they are.
        let counts = [
            chain::<4>(isa),
            chain::<6>(isa),
            chain::<8>(isa),
            chain::<10>(isa),
            chain::<12>(isa),
            chain::<14>(isa),
        ];
        Self { isa, gflops: counts.into_iter().fold(0.0, f64::max) }
    }

    /// Share of the peak that `gflops` is, in percent.
    pub fn percent(&self, gflops: f64) -> f64 {
        100.0 * gflops / self.gflops
    }
}

/// GFLOP/s with `N` accumulators.
fn chain<const N: usize>(isa: Isa) -> f64 {
    const ROUNDS: usize = 4_096;
    let ns = least_ns(SAMPLES, SHORTEST, || {
        black_box(isa.run(Chain::<N> {
            rounds: black_box(ROUNDS),
            factor: black_box(0.5),
            term: black_box(1.0),
        }));
    });
    (2 * 8 * N * ROUNDS) as f64 / ns
}

/// a = a factor + term over `N` independent a: a product and a sum an element, nothing from memory. With a factor of
/// 0.5 and a term of 1 values stay near 2, far from denormals.
struct Chain<const N: usize> {
    rounds: usize,
    factor: f32,
    term: f32,
}

impl<const N: usize> Task for Chain<N> {
    type Output = Lanes;

    #[inline(always)]
    fn run(self) -> Lanes {
        let (factor, term) = (Lanes::splat(self.factor), Lanes::splat(self.term));
        let mut sums = [Lanes::splat(1.5); N];
        for _ in 0..self.rounds {
            for sum in &mut sums {
                *sum = *sum * factor + term;
            }
        }
        sums.into_iter().fold(Lanes::ZERO, |a, b| a + b)
    }
}

/// Bytes a nanosecond (GB/s) that one thread reads from a buffer, by the buffer's size.
#[derive(Clone, Copy, Debug)]
pub struct Bandwidth {
    /// Size in bytes.
    pub buffer: usize,
    /// GB/s.
    pub gb_s: f64,
}

/// Buffer sizes: one for a first-level cache, one for a second-level cache, one for memory.
pub const BUFFERS: [usize; 3] = [16 << 10, 256 << 10, 256 << 20];

impl Bandwidth {
    /// Measures with a buffer of `buffer` bytes.
    pub fn measure(isa: Isa, buffer: usize) -> Self {
        let values = vec![Lanes::splat(1.0); buffer / size_of::<Lanes>()];
        let samples = if buffer > 1 << 24 { 3 } else { SAMPLES };
        let ns = least_ns(samples, SHORTEST, || {
            black_box(isa.run(Read { values: black_box(&values) }));
        });
        Self { buffer, gb_s: buffer as f64 / ns }
    }
}

/// The sum of a buffer, in eight partial sums so that loads wait for nothing.
struct Read<'a> {
    values: &'a [Lanes],
}

impl Task for Read<'_> {
    type Output = Lanes;

    #[inline(always)]
    fn run(self) -> Lanes {
        let mut sums = [Lanes::ZERO; 8];
        for eight in self.values.chunks_exact(8) {
            for i in 0..8 {
                sums[i] = sums[i] + eight[i];
            }
        }
        sums.into_iter().fold(Lanes::ZERO, |a, b| a + b)
    }
}
