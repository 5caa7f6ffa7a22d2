//! Evaluates networks on labelled data sets. Nothing here parses arguments or prints; warnings go
//! to the `log` crate.
//!
//! | module | contents |
//! |---|---|
//! | [`metrics`] | confusion matrices, scores and their uncertainty, distances between series |
//! | [`trainings`] | networks by name with their trainings, and the folds of a cross-validation |
//! | [`judge`] | figures of one training and of several |
//! | [`events`] | labelled recordings of events (N-MNIST, `NeuTouch`): accuracy over time |
//! | [`regression`] | quantities such as the angles of a contact: errors over the time of a press |
//! | [`force`] | contact force over time: errors by phase and by size |
//! | [`area`] | contact area and normal force from pictures of a gel |
//! | [`closed_loop`] | control by touch: the effects of a network's error and run time |
//! | [`slip`] | direction of slip: data set, windows, accuracy on seen and unseen objects |
//! | [`streams`] | streams of events with labels along time, such as presses |
//! | [`filters`] | how much of a simulated signal and its noise filters of events keep |
//! | [`presses`] | recordings with labels as people keep them: joined, with a list of oddities |
//! | [`fit`] | the head of a network, fitted to presses of another sensor |
//! | [`prepare`] | inputs of networks with labels, for training |
//! | [`pareto`] | run time against error, with each approximation |
//!
//! The threads of the caller's [`Workers`] share the recordings; their number changes no bit. A
//! [`ProgressHandle`] shows their progress, and stops them.
//!
//! ```
//! use meissner_evaluate::metrics::{Confusion, Scores, wilson_95};
//! use meissner_evaluate::pareto::pareto_front;
//!
//! let mut confusion = Confusion::new(2);
//! for (truth, predicted) in [(0, 0), (0, 0), (0, 1), (1, 1)] {
//!     confusion.add(truth, predicted);
//! }
//! let scores = Scores::of(&confusion).expect("there are predictions");
//! assert_eq!(scores.accuracy, 0.75);
//! let (low, high) = wilson_95(confusion.hits(), confusion.total()).expect("predictions");
//! assert!(low < 0.75 && 0.75 < high);
//!
//! // Time and error of three settings: the second one is slower than the first and not better.
//! assert_eq!(pareto_front(&[(10.0, 0.1), (12.0, 0.1), (20.0, 0.05)]), [0, 2]);
//! ```
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod area;
pub mod closed_loop;
pub mod doubts;
pub mod error;
pub mod events;
pub mod filters;
pub mod fit;
pub mod force;
pub mod judge;
pub mod metrics;
pub mod pareto;
pub mod prepare;
pub mod presses;
pub mod regression;
pub mod slip;
pub mod streams;
mod thinned;
pub mod trainings;
mod trials;
mod units;
mod workers;

pub use error::{EvaluateError, RequestPart, Result, StreamsError, TrainingError};
pub use judge::NetworkReport;
pub use trainings::TaskName;
pub use workers::{ProgressHandle, Workers};

#[cfg(test)]
mod tests;
