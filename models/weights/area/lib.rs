//! Weights of the networks for contact area and normal force, as safetensors.
//!
//! Each is behind the feature of its network's name; `meissner-models` reads them.
#![no_std]

/// Weights of `canf`.
#[cfg(feature = "canf")]
pub static CANF: &[u8] = include_bytes!("canf.0.safetensors");

/// Weights of `canf-live`.
#[cfg(feature = "canf-live")]
pub static CANF_LIVE: &[u8] = include_bytes!("canf-live.0.safetensors");

/// Weights of `canf-plain`.
#[cfg(feature = "canf-plain")]
pub static CANF_PLAIN: &[u8] = include_bytes!("canf-plain.0.safetensors");
