//! Reports on a description: a table for people, data for programs, pictures of the graph.
//!
//! Enters: a checked [`Description`](crate::Description). Leaves: text. Invariant: equal descriptions give equal bytes.

mod dot;
mod summary;
mod svg;
mod table;

pub use summary::{GraphSummary, Summary, TensorSummary};
