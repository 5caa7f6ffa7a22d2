//! Weights of reduced precision, as the f32 that they stand for: the numerical error of a narrower format, without its
//! speed.
//!
//! ```text
//! bf16   w' = the nearest f32 whose low 16 bits are zero, ties to the even one       |w' - w| <= 2^-8 |w|, w normal
//! int8   w' = s round(w / s), s = max |w| / 127 over an output channel, ties to even |w' - w| <= s / 2
//! ```
//!
//! s, the quotient and the product are formed in f64, and w' is rounded to f32 once. Symmetric steps for each output
//! channel are those of Krishnamoorthi (2018). Biases and batch norm stay in f32: whatever runs such
//! weights adds them to wider sums.

use crate::error::{KernelError, check};

/// A number format narrower than f32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 8 bits of exponent, 7 of fraction: the upper half of an f32.
    Bf16,
    /// Integers from -127 to 127, times a step for each output channel.
    Int8,
}

impl Precision {
    /// A short name, as in the program's options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bf16 => "bf16",
            Self::Int8 => "int8",
        }
    }

    /// Rounds the finite weights of one output channel to what this format holds. Zeros stay.
    ///
    /// # Errors
    /// [`KernelError::NotFinite`] where a weight is beyond the largest bf16, 3.39e38.
    pub fn round(self, weights: &mut [f32]) -> Result<(), KernelError> {
        match self {
            Self::Bf16 => weights.iter_mut().for_each(|w| *w = bf16(*w)),
            Self::Int8 => {
                let largest = weights.iter().fold(0.0f32, |largest, w| largest.max(w.abs()));
                let step = f64::from(largest) / 127.0;
                // A channel of zeros has no step.
                if step > 0.0 {
                    let round = |w: f32| ((f64::from(w) / step).round_ties_even() * step) as f32;
                    weights.iter_mut().for_each(|w| *w = round(*w));
                }
            }
        }
        check("rounded weight", weights, weights.len())
    }
}

/// The nearest bf16 to a finite `value`, ties to even; infinite beyond the largest.
fn bf16(value: f32) -> f32 {
    let bits = value.to_bits();
    f32::from_bits((bits + 0x7fff + (bits >> 16 & 1)) & 0xffff_0000)
}
