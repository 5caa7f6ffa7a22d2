//! Weights of the networks for the contact angle, as safetensors.
//!
//! Each is behind the feature of its network's name; `meissner-models` reads them.
#![no_std]

/// Weights of `event-frame-cnn`.
#[cfg(feature = "event-frame-cnn")]
pub static EVENT_FRAME_CNN: &[u8] = include_bytes!("event-frame-cnn.0.safetensors");

/// Weights of `graphres`.
#[cfg(feature = "graphres")]
pub static GRAPHRES: &[u8] = include_bytes!("graphres.0.safetensors");

/// Weights of `graphres-published`.
#[cfg(feature = "graphres-published")]
pub static GRAPHRES_PUBLISHED: &[u8] = include_bytes!("graphres-published.0.safetensors");

/// Weights of `tactigraph`.
#[cfg(feature = "tactigraph")]
pub static TACTIGRAPH: &[u8] = include_bytes!("tactigraph.0.safetensors");

/// Weights of `tactigraph-frozen`.
#[cfg(feature = "tactigraph-frozen")]
pub static TACTIGRAPH_FROZEN: &[u8] = include_bytes!("tactigraph-frozen.0.safetensors");

/// Weights of `tactigraph-past`.
#[cfg(feature = "tactigraph-past")]
pub static TACTIGRAPH_PAST: &[u8] = include_bytes!("tactigraph-past.0.safetensors");

/// Weights of `tactip`.
#[cfg(feature = "tactip")]
pub static TACTIP: &[u8] = include_bytes!("tactip.0.safetensors");

/// Weights of `tactip-frames`.
#[cfg(feature = "tactip-frames")]
pub static TACTIP_FRAMES: &[u8] = include_bytes!("tactip-frames.0.safetensors");

/// Weights of `tactip-past`.
#[cfg(feature = "tactip-past")]
pub static TACTIP_PAST: &[u8] = include_bytes!("tactip-past.0.safetensors");

/// Weights of `tactip-shear`.
#[cfg(feature = "tactip-shear")]
pub static TACTIP_SHEAR: &[u8] = include_bytes!("tactip-shear.0.safetensors");
