//! Incremental inference for event cameras and event-based touch: re-exports the engine at its root
//! and the other libraries as modules.
//!
//! | you want | look at |
//! |---|---|
//! | predictions from events, one by one | [`Engine`] |
//! | the same from scratch, as an oracle | [`Batch`] |
//! | predictions from frames, frames from events | [`frames::FrameEngine`], [`representations`] |
//! | a network from a file | [`Description`], [`FrameDescription`], [`Weights`] |
//! | the format of a network's file | [`models::description`] |
//! | recordings | [`io`] (feature `io`) |
//! | a controller with a deadline | [`live`] (feature `live`) |
//! | filters in front of an engine | [`filters`] |
//! | the arithmetic | [`kernels`] |
//!
//! Examples to copy, each run with `cargo run --release -p meissner --example NAME`:
//! `stream_a_recording`, `frame_network`, `own_description`, `weights_from_pytorch`. A controller
//! at 1 kHz is in `examples/controller`.
//!
//! An unoptimised build computes the same bits 8 to 10 times slower: measure with `--release`.
#![forbid(unsafe_code)]

#[doc(inline)]
pub use meissner_engine::*;
#[doc(inline)]
pub use meissner_kernels::{
    Activation, Dense, Isa, KernelError, Matrix, Neighbour, SplineConv, SplineParts, softmax,
};
#[doc(inline)]
pub use meissner_models::{
    AnyDescription, Card, Description, DescriptionError, FrameDescription, ModelError, NameMap, Weights, draw,
};

#[cfg(feature = "io")]
#[doc(inline)]
pub use meissner_io as io;
#[doc(inline)]
pub use meissner_kernels as kernels;
#[cfg(feature = "live")]
#[doc(inline)]
pub use meissner_live as live;
#[doc(inline)]
pub use meissner_models as models;

/// The programs of the README compile and run.
#[cfg(all(doctest, feature = "io", feature = "live"))]
#[doc = include_str!("../../README.md")]
struct Readme;
