//! Verifies that incremental results equal full recomputation, bit for bit.
//!
//! [`verify`] runs a network over random streams and compares each row of each layer, each
//! neighbourhood and the prediction with the batch. A stream on which they differ is shrunk to a
//! minimal one, which [`Stream::to_text`] writes and [`Stream::parse`] reads. In your own test
//! suite:
//!
//! ```
//! use meissner_models::{Description, Weights};
//! use meissner_verify::{VerifyError, verify};
//!
//! // The body of a test:
//! let description = Description::shipped("tactigraph-past").expect("a shipped network");
//! let weights = Weights::shipped("tactigraph-past").expect("its weights");
//! let network = description.network(&weights).expect("the weights fit");
//! let summary = verify(network, None, 3, 1)?; // 3 streams of seed 1, on sensors of several sizes
//! assert_eq!(summary.cases, 3);
//! # Ok::<(), VerifyError>(())
//! ```
//!
//! | module | contents |
//! |---|---|
//! | [`verify`], [`verify_stream`], [`verify_frames`] | return a [`Summary`] or a [`Mismatch`] |
//! | [`random_streams`], [`random_frames`] | streams with every difficulty |
//! | [`Incremental`], [`IncrementalEvents`] | an engine under test: implement them for your own
//! engine |
//! | [`conformance`] | claims that hold for every engine, behind any interface |
//! | [`CheckedEngine`] | compares an engine with its full recomputation, for your own streams |
//! | [`Stream`], [`Step`], [`Script`] | streams as data, from recordings and as text |
//! | [`networks`], [`frame_networks`] | random networks |
//! | `strategies` | proptest strategies for streams and networks (feature `proptest`) |
//! | [`stress`] | inputs and weights that strain the arithmetic, with errors against f64 |
//! | [`soak`] | one engine over recordings in an endless loop, disturbed at random |
//!
//! Everything except timings and memory is determined by seeds and inputs.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod checked;
pub mod conformance;
mod error;
pub mod frame_networks;
mod incremental;
pub mod networks;
mod random_stream;
mod run;
mod shrink;
pub mod soak;
#[cfg(feature = "proptest")]
pub mod strategies;
mod stream;
mod stream_text;
pub mod stress;
#[cfg(test)]
mod tests;

pub use checked::{CheckedEngine, poisoned};
pub use error::{Difference, Mismatch, Summary, VerifyError, bits};
pub use incremental::{Incremental, IncrementalEvents};
pub use meissner_kernels::random::Random;
pub use random_stream::{random_frames, random_streams};
pub use run::{verify, verify_frames, verify_stream};
pub use stream::{Script, Step, Stream};
