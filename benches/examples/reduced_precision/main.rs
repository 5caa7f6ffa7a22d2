//! Whether narrower numbers or tables beat the engine's spline rows, and at which error:
//! `RUSTFLAGS="-C target-cpu=native" cargo run --release -p meissner-benches --example reduced_precision`.
//!
//! Each variant computes the same rows as [`meissner_kernels::SplineConv::rows`], in groups of eight, on activations and
//! in-edges of a real window; its answer is compared with the engine's before it is timed. `f32, this code` is the
//! control: the same loops in f32. Without that flag, products of integers and their sums are two instructions.
//!
//! What came of it (one core with AVX-512 and VNNI; `results/2026-11-22-reduced-precision.md` has the figures):
//!
//! - *Integers pay where there is VNNI.* i16 activations with 12-bit weights take 0.61 to 0.73 of the engine's time from
//!   16 channels on (0.7 of the control's), 0.86 at 8 -> 16, with an RMS error of 6e-5 to 5e-4. The contraction runs at
//!   2.2 times its f32 speed; sums per slot gain little, ELU nothing. Without VNNI 0.9 to 1.1 of the control is left.
//!   Sums of integers know no order, so that such rows could stay as exact as the engine's.
//! - *i8 activations* are no faster than i16 (both are multiplied as i16) and err 15 to 70 times as much. What they
//!   bring is that three rows in ten come out unchanged: a quarter fewer rows. `tolerance` stops the wave without them.
//! - *Lose on both axes, and stay lines of a table:* bf16 and i8 weights that are widened to f32 (eight rows share a
//!   weight: its bytes cost little, widening it costs more), seven-bit sums, W(u) from a table (no two edges share a
//!   matrix), the basis from a table (hardly faster than computing it, slower than keeping it, which is exact).
//! - *Updates by difference lose.* A changed edge touches all slots, so the contraction stays whole; with W(u) from a
//!   table, four to seven changed in-edges of sixteen cost as much as the row. From the second layer on, six to
//!   twelve are changed in the mean.
#![allow(
    clippy::inline_always,
    reason = "what is not inlined into an instruction set's wrapper misses its instructions"
)]

#[cfg(target_arch = "x86_64")]
mod clock;
#[cfg(target_arch = "x86_64")]
mod difference;
#[cfg(target_arch = "x86_64")]
mod float;
#[cfg(target_arch = "x86_64")]
mod integer;
#[cfg(target_arch = "x86_64")]
mod problem;
#[cfg(target_arch = "x86_64")]
mod report;
#[cfg(target_arch = "x86_64")]
mod run;
#[cfg(target_arch = "x86_64")]
mod table;
#[cfg(target_arch = "x86_64")]
mod vectors;
#[cfg(target_arch = "x86_64")]
mod wave;

fn main() {
    #[cfg(target_arch = "x86_64")]
    run::run();
    #[cfg(not(target_arch = "x86_64"))]
    println!("skipped: the integer rows need AVX-512");
}
