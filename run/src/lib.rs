//! Drives an engine over a source: recordings and live streams in, predictions out. This crate does
//! not parse arguments and does not print. Messages go to the `tracing` crate.
//!
//! This example prints a line of JSON for each prediction over the embedded recording:
//!
//! ```
//! use meissner_run::model::Model;
//! use meissner_run::run::{EventRun, Observer, Prediction, RunOptions};
//! use meissner_run::source::Source;
//!
//! struct Print;
//!
//! impl Observer for Print {
//!     fn prediction(&mut self, prediction: &Prediction<'_>) -> std::io::Result<()> {
//!         println!("{}", serde_json::to_string(prediction)?);
//!         Ok(())
//!     }
//! }
//!
//! let model = Model::named("tactigraph-past", None, false)?;
//! let source = Source::open(None, &Default::default(), false, false)?;
//! let sensor = source.sensor(None)?;
//! let options = RunOptions { limit: Some(500), ..RunOptions::default() };
//! EventRun::new(&model, source, sensor, options)?.run(&mut Print).result?;
//! # Ok::<(), meissner_run::RunError>(())
//! ```
//!
//! | module | contents |
//! |---|---|
//! | [`source`], [`streams`] | events of a file, the embedded recording, standard input, a socket |
//! | [`press`] | a simulated press with its truth |
//! | [`losses`] | lost input, and truncated recordings |
//! | [`model`] | networks and weights by name or from files |
//! | [`provenance`] | network, weights and input of a result, for reports |
//! | [`answer`] | classes and probabilities of predictions |
//! | [`training`] | outputs, and the ranges that they had in the training |
//! | [`approximations`] | approximations, and the report of their effects |
//! | [`schedule`], [`text`] | when predictions are read; numbers and times as text |
//! | [`predictor`] | incremental inference and inference from scratch, with the same methods |
//! | [`frame_feed`] | the frames that a network reads from events |
//! | [`live_frames`] | a frame network that takes events and predicts at any time |
//! | [`run`] | a network over a whole input: predictions, summary, states |
//! | [`play`] | recordings at real speed, each through a bounded queue |
//! | [`record`](mod@record) | a live source into files, one for each press |
//! | [`mcap`] | a log of events and predictions for viewers |
//! | [`send`](mod@send) | a recording at real speed to another program |
//! | [`bench`](mod@bench) | latencies, work, deadlines and comparisons |
//! | [`latency`], [`memory`], [`work_counts`] | measurements |
//! | [`clock`] | stream time on the wall clock |
//! | [`journal`], [`fingerprint`] | finished measurements in a file; what they were made of |
//! | [`interrupt`] | signals that ask the process to end |
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod answer;
pub mod approximations;
mod arriving;
pub mod bench;
pub mod clock;
pub mod error;
pub mod fingerprint;
pub mod frame_feed;
pub mod interrupt;
pub mod journal;
pub mod latency;
pub mod left_out;
pub mod live_frames;
pub mod losses;
mod machine;
pub mod mcap;
pub mod memory;
pub mod model;
pub mod play;
pub mod predictor;
pub mod press;
pub mod provenance;
pub mod record;
pub mod run;
pub mod schedule;
pub mod send;
pub mod source;
pub mod streams;
pub mod text;
pub mod training;
pub mod work_counts;

pub use error::{Result, RunError};

#[cfg(test)]
mod tests;
