//! The machine's limits, measured: f32 products and sums, and bytes read from each cache.
//!
//! Both loops run through the kernels' own [`Task`] dispatch, on one thread.

#![allow(
    clippy::inline_always,
    reason = "what is not inlined into an instruction set's wrapper misses its instructions"
)]

use std::hint::black_box;
use std::time::Duration;

use meissner_kernels::{Isa, LANES, Simd, Task, Vector, Wide};

use crate::timing::least_ns;

const SAMPLES: usize = 15;
const MIN: Duration = Duration::from_micros(500);

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
        // The best number of accumulators depends on the number of registers and on their width.
        let chains = [chain::<4>, chain::<5>, chain::<6>, chain::<7>, chain::<8>, chain::<12>];
        Self { isa, gflops: chains.into_iter().map(|chain| chain(isa)).fold(0.0, f64::max) }
    }

    /// `gflops` as a share of the peak, in percent.
    pub fn percent(&self, gflops: f64) -> f64 {
        100.0 * gflops / self.gflops
    }
}

/// GFLOP/s with `N` accumulators.
fn chain<const N: usize>(isa: Isa) -> f64 {
    const ROUNDS: usize = 4_096;
    let ns = least_ns(SAMPLES, MIN, || {
        black_box(isa.run(Chain::<N> {
            rounds: black_box(ROUNDS),
            factor: black_box(0.5),
            term: black_box(1.0),
        }));
    });
    (2 * 2 * LANES * N * ROUNDS) as f64 / ns
}

/// a = a + factor term over `N` independent a: a product and a sum an element, nothing from memory.
struct Chain<const N: usize> {
    rounds: usize,
    factor: f32,
    term: f32,
}

impl<const N: usize> Task for Chain<N> {
    type Output = [f32; 2 * LANES];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let (factor, term) = (S::V16::splat(simd, self.factor), S::V16::splat(simd, self.term));
        let mut sums = [S::V16::splat(simd, 1.5); N];
        for _ in 0..self.rounds {
            for sum in &mut sums {
                *sum = sum.add_product(factor, term);
            }
        }
        let mut out = [0.0; 2 * LANES];
        sums.into_iter().fold(S::V16::splat(simd, 0.0), Vector::add).store_slice(&mut out);
        out
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
        let values = vec![Wide([1.0; 2 * LANES]); buffer / size_of::<Wide>()];
        let samples = if buffer > 1 << 24 { 3 } else { SAMPLES };
        let ns = least_ns(samples, MIN, || {
            black_box(isa.run(Read { values: black_box(&values) }));
        });
        Self { buffer, gb_s: buffer as f64 / ns }
    }
}

/// The sum of a buffer, in partial sums so that no load waits for a sum.
struct Read<'a> {
    values: &'a [Wide],
}

impl Task for Read<'_> {
    type Output = [f32; 2 * LANES];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let mut sums = [S::V16::splat(simd, 0.0); 4];
        for four in self.values.chunks_exact(4) {
            for (sum, value) in sums.iter_mut().zip(four) {
                *sum = sum.add(S::V16::load(simd, value));
            }
        }
        let mut out = [0.0; 2 * LANES];
        sums.into_iter().fold(S::V16::splat(simd, 0.0), Vector::add).store_slice(&mut out);
        out
    }
}
