//! Weights of the networks for the direction of slip, as safetensors.
//!
//! Each is behind the feature of its network's name; `meissner-models` reads them.
#![no_std]

/// Weights of `slip-best`.
#[cfg(feature = "slip-best")]
pub static SLIP_BEST: &[u8] = include_bytes!("slip-best.0.safetensors");

/// Weights of `slip-lstm`.
#[cfg(feature = "slip-lstm")]
pub static SLIP_LSTM: &[u8] = include_bytes!("slip-lstm.0.safetensors");

/// Weights of `slip-regularised`.
#[cfg(feature = "slip-regularised")]
pub static SLIP_REGULARISED: &[u8] = include_bytes!("slip-regularised.0.safetensors");

/// Weights of `slip-tuned`.
#[cfg(feature = "slip-tuned")]
pub static SLIP_TUNED: &[u8] = include_bytes!("slip-tuned.0.safetensors");
