//! Frame networks: images or vectors in, predictions out, with recurrent states in between.
//!
//! [`FrameNetworkParts`] are checked and packed into a [`FrameNetwork`]; a [`FrameEngine`] runs it
//! with the event engine's methods. Values that no change reaches are not recomputed (`patch.rs`);
//! the bits are the same.

mod buffer;
mod bytes;
pub(crate) mod changes;
mod compile;
mod engine;
mod layers;
mod network;
mod options;
mod patch;
mod shape;
mod shapes;
mod step;
mod timed;
mod unlikeness;

pub use crate::counters::{FrameCounters, FrameLayerCounters};
pub use compile::FrameNetwork;
pub use engine::{FrameEngine, FramePrediction, FrameSnapshot};
pub use network::{Convolution, FrameLayer, FrameLayerKind, FrameNetworkParts, FrameShape};
pub use options::{FrameOptions, Skip};
pub use shapes::output_shape;
pub(crate) use step::Cell;
pub use timed::{CONFIRMING_FRAMES, Frame, TimedFrames};
pub use unlikeness::{FrameFeatures, FrameStatistics, TrainingFrames};
