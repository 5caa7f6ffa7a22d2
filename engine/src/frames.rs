//! Frame networks: images or vectors in, predictions out, with the state of recurrent layers in between.
//!
//! [`FrameNetworkParts`] are checked and packed into a [`FrameNetwork`], which a [`FrameEngine`] runs with the methods
//! of the event engine: push, predict, reset, snapshot, restore. Values that no change reaches are not recomputed
//! (`patch.rs`); the bits are the same as if they were.

mod buffer;
mod bytes;
mod changes;
mod compile;
mod engine;
mod fingerprint;
mod layers;
mod network;
mod options;
mod patch;
mod shapes;
mod step;
mod timed;

pub use crate::counters::{FrameCounters, FrameLayerCounters};
pub use compile::FrameNetwork;
pub use engine::{FrameEngine, FramePrediction, FrameSnapshot};
pub use network::{Convolution, FrameLayer, FrameLayerKind, FrameNetworkParts, FrameShape};
pub use options::{FrameOptions, Skip};
pub use shapes::output_shape;
pub(crate) use step::Cell;
pub use timed::{CONFIRMING_FRAMES, Frame, TimedFrames};
