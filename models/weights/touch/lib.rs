//! Weights of the networks for touch, as safetensors.
//!
//! Each is behind the feature of its network's name; `meissner-models` reads them.
#![no_std]

/// Weights of `touch-containers`.
#[cfg(feature = "touch-containers")]
pub static TOUCH_CONTAINERS: &[u8] = include_bytes!("touch-containers.0.safetensors");

/// Weights of `touch-letters`.
#[cfg(feature = "touch-letters")]
pub static TOUCH_LETTERS: &[u8] = include_bytes!("touch-letters.0.safetensors");

/// Weights of `touch-objects`.
#[cfg(feature = "touch-objects")]
pub static TOUCH_OBJECTS: &[u8] = include_bytes!("touch-objects.0.safetensors");
