//! Network descriptions and weights: a file with a network's layers, and its numbers.
//!
//! - [`Description`]: a TOML file, checked into an acyclic graph of layers ([`description`])
//! - [`FrameDescription`]: the same over frames ([`description::frames`]); [`AnyDescription`]:
//!   either
//! - [`Weights`]: tensors from safetensors and `PyTorch` state dicts; [`NameMap`]: other
//!   names for them; [`Card`]: their metadata; [`TensorFile`]: arrays to write
//! - [`inspect`]: a description as a table, as data, as DOT, as SVG
//! - `shipped`: the networks that come with the crate, by name
//! - [`draw()`]: weights from a seed
//! - [`systems`]: normalisation, windows, reports and overlays around a network
//!
//! ```
//! use meissner_models::{Description, Weights};
//!
//! let description = Description::shipped("tactigraph").expect("a shipped network");
//! let weights = Weights::shipped("tactigraph").expect("its weights");
//! let network = description.network(&weights)?;
//! assert_eq!(network.outputs(), 2);
//! # Ok::<(), meissner_models::ModelError>(())
//! ```
#![forbid(unsafe_code)]

pub mod description;
mod draw;
mod error;
pub mod inspect;
mod shipped;
pub mod systems;
mod weights;

pub use description::frames::{FrameDescription, FrameKind, FrameLayer, FrameSource};
pub use description::{
    Agreement, AnyDescription, ConvolutionKind, Description, DescriptionError, Layer, LayerKind, Problem,
    ProblemKind,
};
pub use draw::{Drawable, draw, drawn_file};
pub use error::{Lookalikes, ModelError, TensorProblem, TensorProblemKind, in_part};
pub use inspect::{Summary, grouped};
pub use shipped::DEFAULT_NETWORK;
pub use weights::{Card, FormatError, NameMap, Tensor, TensorFile, Weights, frames_text, windows_text};

#[cfg(test)]
mod tests;
