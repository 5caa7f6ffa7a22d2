//! Reports on a description: a table for people, data for programs, pictures of the graph.
//!
//! Enters: a checked description. Leaves: text. Invariant: equal descriptions give equal bytes.

pub(crate) mod picture;
mod summary;
mod table;
pub(crate) mod view;

pub use summary::{
    AnySummary, EdgeSummary, FrameSummary, GraphSummary, LevelSummary, Summary, TensorSummary,
};
pub use view::grouped;
