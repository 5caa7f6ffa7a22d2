//! Drives an engine over a source: recordings and live streams in, predictions out. Nothing here parses arguments or prints;
//! messages for people go to the `log` crate.
//!
//! | module | contents |
//! |---|---|
//! | [`source`] | events of a file, of standard input, of the embedded recording |
//! | [`refusals`], [`lost`], [`salvage`] | malformed lines, lost input, recordings that were cut short |
//! | [`model`] | networks and weights by name or from files |
//! | [`provenance`] | network, weights and input of a result, for reports |
//! | [`approximations`], [`filtered`] | approximations, and an engine that runs with them |
//! | [`schedule`], [`time`] | when predictions are read; lengths of time as text |
//! | [`predictor`] | incremental and batch behind the same verbs |
//! | [`frame_feed`], [`frame_predictor`] | frames made of events; a frame engine with its timings |
//! | [`latency`], [`layer_cost`] | measurements |
//! | [`interrupt`] | signals that ask the process to end |
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod approximations;
pub mod error;
pub mod filtered;
pub mod frame_feed;
pub mod frame_predictor;
pub mod interrupt;
pub mod latency;
pub mod layer_cost;
pub mod lost;
pub mod model;
pub mod predictor;
pub mod provenance;
pub mod refusals;
pub mod salvage;
pub mod schedule;
pub mod source;
pub mod text;
pub mod time;

pub use error::PipelineError;
