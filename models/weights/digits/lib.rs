//! Weights of the networks for digits, as safetensors.
//!
//! Each is behind the feature of its network's name; `meissner-models` reads them.
#![no_std]

/// Weights of `digits-all`.
#[cfg(feature = "digits-all")]
pub static DIGITS_ALL: &[u8] = include_bytes!("digits-all.0.safetensors");

/// Weights of `digits-past`.
#[cfg(feature = "digits-past")]
pub static DIGITS_PAST: &[u8] = include_bytes!("digits-past.0.safetensors");
