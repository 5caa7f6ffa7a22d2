//! Weights of the networks for contact force, as safetensors.
//!
//! Each is behind the feature of its network's name; `meissner-models` reads them.
#![no_std]

/// Weights of `force-cnnlstm`.
#[cfg(feature = "force-cnnlstm")]
pub static FORCE_CNNLSTM: &[u8] = include_bytes!("force-cnnlstm.0.safetensors");

/// Weights of `force-convlstm`.
#[cfg(feature = "force-convlstm")]
pub static FORCE_CONVLSTM: &[u8] = include_bytes!("force-convlstm.0.safetensors");

/// Weights of `force-graph`.
#[cfg(feature = "force-graph")]
pub static FORCE_GRAPH: &[u8] = include_bytes!("force-graph.0.safetensors");

/// Weights of `force-lstm`.
#[cfg(feature = "force-lstm")]
pub static FORCE_LSTM: &[u8] = include_bytes!("force-lstm.0.safetensors");

/// Weights of `force-tdnn`.
#[cfg(feature = "force-tdnn")]
pub static FORCE_TDNN: &[u8] = include_bytes!("force-tdnn.0.safetensors");
