//! Whether narrower numbers or tables beat the engine's spline rows, and at which error:
//! `RUSTFLAGS="-C target-cpu=native" cargo run --release -p meissner-benches --example reduced_precision`.
//!
//! Each variant computes the same rows as [`meissner_kernels::SplineConv::rows`], in groups of eight, on activations and
//! in-edges of a real window. Its answer is compared with the engine's before it is timed. `f32, this code` is the
//! control: the same loops in f32. Without the flag, products of integers and their sums are two instructions.
//!
//! Results on one core with AVX-512 and VNNI (figures: `results/2026-11-22-reduced-precision.md`):
//!
//! - *Integers are faster where there is VNNI.* Rows with i16 activations and 12-bit weights take 0.61 to 0.73 of the
//!   engine's time from 16 channels on (0.7 of the control's), and 0.86 at 8 -> 16. Their RMS error is 6e-5 to 5e-4. The
//!   contraction runs at 2.2 times its f32 speed; sums per slot gain little, ELU nothing. Without VNNI, rows take 0.9 to
//!   1.1 of the control. Sums of integers do not depend on their order, so such rows could stay as exact as the engine's.
//! - *i8 activations* are no faster than i16 (both are multiplied as i16), and their error is 15 to 70 times as large.
//!   Three rows in ten come out unchanged, so that a quarter fewer rows are computed. `tolerance` does the same without
//!   them.
//! - *Slower and less exact:* bf16 and i8 weights that are widened to f32 (eight rows share a weight: its bytes cost
//!   little, widening costs more), seven-bit sums, W(u) from a table (no two edges share a matrix), the basis from a table
//!   (hardly faster than computing it, slower than keeping it, which is exact).
//! - *Updates by difference are slower.* A changed edge touches all slots, so the contraction stays whole. With W(u) from
//!   a table, four to seven changed in-edges of sixteen cost as much as the row. From the second layer on, six to twelve
//!   are changed in the mean.
#![allow(
    clippy::inline_always,
    reason = "what is not inlined into an instruction set's wrapper misses its instructions"
)]

#[cfg(target_arch = "x86_64")]
mod format;
#[cfg(target_arch = "x86_64")]
mod problem;
#[cfg(target_arch = "x86_64")]
mod rows;
#[cfg(target_arch = "x86_64")]
mod study;
#[cfg(target_arch = "x86_64")]
mod wave;

fn main() {
    #[cfg(target_arch = "x86_64")]
    study::run();
    #[cfg(not(target_arch = "x86_64"))]
    println!("skipped: the integer rows need AVX-512");
}
