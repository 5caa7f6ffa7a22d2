//! Networks in f64, computed value by value, to measure rounding errors.
//!
//! Input: the parameters of a network and its stream or frames. Output: the values of every layer.
//! Kernels and engine share only parameters and exact integers with it. Every sum is a plain loop,
//! as in the equations. Elementary functions are the platform's, so that the last bits may differ
//! between machines.
//!
//! A neighbour search by a k-d tree proposes candidates to a batch. The batch is the oracle for
//! large windows.
//!
//! | type | meaning |
//! |---|---|
//! | [`EventReference`] | a network over events; every row of every level of a stream |
//! | [`FrameReference`] | a network over frames, frame by frame |
//! | [`Difference`], [`ulps`] | differences of f32 values from these |
//!
//! ```
//! use meissner_engine::frames::{
//!     Convolution, FrameEngine, FrameLayer, FrameLayerKind, FrameNetwork, FrameNetworkParts,
//! FrameShape,
//! };
//! use meissner_kernels::Activation;
//! use meissner_reference::{Difference, FrameReference};
//!
//! let (weight, activation) = (vec![0.1; 3], Activation::Tanh);
//! let kind = FrameLayerKind::Dense { outputs: 1, weight, bias: None, activation };
//! let layers = vec![FrameLayer { name: "out".to_owned(), from: 0, kind }];
//! let input = FrameShape::Vector(3);
//! let parts = FrameNetworkParts { name: "mean".to_owned(), input, layers, training: None };
//! let network = FrameNetwork::new(parts.clone(), Convolution::Direct)?;
//! let (mut engine, mut reference) = (FrameEngine::new(network)?, FrameReference::new(parts)?);
//!
//! engine.push(&[1.0, 2.0, 4.0])?;
//! let mut difference = Difference::default();
//! difference.add_all(engine.predict()?.values, reference.push(&[1.0, 2.0, 4.0]));
//! assert!(difference.relative() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod convolution;
mod difference;
mod events;
mod frames;
#[cfg(test)]
mod tests;
mod tree;

pub use convolution::BatchNorm;
pub use difference::{Difference, ulps};
pub use events::{EventReference, EventTrace, ReferenceError, ReferenceLevel, Rows};
pub use frames::{FrameReference, elementary};
pub use tree::{PROPOSE, from_tree};
