//! Frame networks: images or vectors in, predictions out, with the state of recurrent layers between.
//!
//! A network is made of [`FrameNetworkParts`], checked and packed into a [`FrameNetwork`], and run by a [`FrameEngine`] with
//! the verbs of the event engine: push, predict, reset, snapshot, restore. What no change reaches is not computed again
//! (`patch.rs`), with the same bits as if it had been.

mod buffer;
mod bytes;
mod changes;
mod compile;
mod counters;
mod engine;
mod fingerprint;
mod layers;
mod network;
mod options;
mod patch;
mod shapes;
mod step;
mod timed;

pub use compile::FrameNetwork;
pub use counters::{FrameCounters, FrameLayerCounters};
pub use engine::{FrameEngine, FramePrediction, FrameSnapshot};
pub use network::{Convolution, FrameLayer, FrameLayerKind, FrameNetworkParts, FrameShape};
pub use options::{FrameOptions, Skip};
pub use timed::{Frame, TimedFrames};
