//! The largest error of each elementary function, over all inputs or a part of them.

use meissner_kernels::{Elementary, Isa};
use meissner_reference::{elementary, ulps};
use rayon::prelude::*;
use serde::Serialize;

/// Inputs that are computed together.
const CHUNK: u64 = 1 << 16;
/// One in so many bit patterns is computed. The number is prime, so that all patterns of low bits
/// occur.
const STRIDE: u64 = 4099;
/// Bit patterns to each side of a special value.
const NEAR: u32 = 512;

/// The largest error of a function.
#[derive(Clone, Debug, Serialize)]
pub struct FunctionResult {
    /// Name of the function.
    pub function: &'static str,
    /// Inputs that were computed.
    pub inputs: u64,
    /// Largest error in units in the last place.
    pub ulps: f64,
    /// The input with this error.
    pub at: f32,
    /// The bound that the function's documentation states.
    pub bound: f64,
    /// Inputs that are not NaN but whose results are NaN.
    pub not_numbers: u64,
    /// Promises that are broken.
    pub broken: Vec<String>,
}

impl FunctionResult {
    fn of_none(function: Elementary) -> Self {
        let (function, bound) = (function.name(), function.bound());
        Self { function, inputs: 0, ulps: 0.0, at: 0.0, bound, not_numbers: 0, broken: Vec::new() }
    }

    /// The larger of both errors; if they are equal, the one with the smaller bit pattern.
    fn with(self, other: Self) -> Self {
        let key = |result: &Self| (result.ulps, u32::MAX - result.at.to_bits());
        let (inputs, not_numbers) = (self.inputs + other.inputs, self.not_numbers + other.not_numbers);
        let larger = if key(&other) > key(&self) { other } else { self };
        Self { inputs, not_numbers, ..larger }
    }
}

/// The largest error of `function` over all bit patterns, or over a part of them if `quick`. `done`
/// is called after every 256th part.
pub fn sweep(function: Elementary, quick: bool, done: impl Fn() + Sync) -> FunctionResult {
    let none = || FunctionResult::of_none(function);
    let mut result = if quick {
        let strided: Vec<u32> = (0..1u64 << 32).step_by(STRIDE as usize).map(|bits| bits as u32).collect();
        let parts = strided.par_chunks(CHUNK as usize).map(|bits| over(function, bits.iter().copied()));
        parts.reduce(none, FunctionResult::with).with(over(function, near_special_values().into_iter()))
    } else {
        let chunks = (1u64 << 32) / CHUNK;
        let part = |chunk: u64| {
            if chunk.is_multiple_of(chunks / 256) {
                done();
            }
            over(function, (chunk * CHUNK..(chunk + 1) * CHUNK).map(|bits| bits as u32))
        };
        (0..chunks).into_par_iter().map(part).reduce(none, FunctionResult::with)
    };
    let FunctionResult { ulps, at, bound, not_numbers, .. } = result;
    if ulps > bound || ulps.is_nan() {
        result.broken.push(format!("{ulps:.3} ULP at {at:e}, stated are {bound}"));
    }
    if not_numbers > 0 {
        result.broken.push(format!("{not_numbers} inputs that are numbers become NaN"));
    }
    result
}

/// The largest error over some bit patterns.
fn over(function: Elementary, bits: impl Iterator<Item = u32>) -> FunctionResult {
    let inputs: Vec<f32> = bits.map(f32::from_bits).collect();
    let mut values = inputs.clone();
    function.apply(Isa::best(), &mut values);
    let mut result = FunctionResult { inputs: inputs.len() as u64, ..FunctionResult::of_none(function) };
    for (&x, &got) in inputs.iter().zip(&values) {
        if got.is_nan() && !x.is_nan() {
            result.not_numbers += 1;
        }
        let error = ulps(got, elementary(function, f64::from(x)));
        if error > result.ulps {
            (result.ulps, result.at) = (error, x);
        }
    }
    result
}

/// Bit patterns about zeros, ones, infinities, the ends of the denormal numbers, and where results
/// saturate or powers of two change.
fn near_special_values() -> Vec<u32> {
    let halves = (1..210).map(|n| (f64::from(n) * std::f64::consts::LN_2 / 2.0) as f32);
    let named =
        [0.0, f32::MIN_POSITIVE, 1.0, 9.010_913, 16.635_532, 17.328_68, 30.0, 87.336_54, 88.722_84, 89.0];
    let named = named.into_iter().chain([103.278_93, 103.972_08, 104.0, f32::MAX, f32::INFINITY, f32::NAN]);
    let magnitudes = named.chain(halves).map(f32::to_bits);
    let near = |bits: u32| bits.saturating_sub(NEAR)..=bits.saturating_add(NEAR).min(u32::MAX >> 1);
    magnitudes.flat_map(near).flat_map(|bits| [bits, bits | 1 << 31]).collect()
}
