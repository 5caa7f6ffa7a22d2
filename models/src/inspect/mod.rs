//! Reports on a description: a table for people, data for programs, pictures of the graph.
//!
//! Enters: a checked description of either kind. Leaves: text. Invariant: equal descriptions give equal bytes.

mod any;
mod dot;
mod frames;
mod summary;
mod svg;
mod table;
mod view;

pub use any::AnySummary;
pub use frames::FrameSummary;
pub use summary::{EdgeSummary, GraphSummary, LevelSummary, Summary, TensorSummary};
