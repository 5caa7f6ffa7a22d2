//! Reports on a description: a table for people, data for programs, pictures of the graph.
//!
//! Enters: a checked description of either kind. Leaves: text. Invariant: equal descriptions give equal bytes.

mod picture;
mod summary;
mod table;
mod view;

use std::fmt;

use crate::description::frames::FrameDescription;
use crate::description::{AnyDescription, Description};

pub use summary::{
    AnySummary, EdgeSummary, FrameSummary, GraphSummary, LevelSummary, Summary, TensorSummary,
};

macro_rules! reports {
    ($($description:ty),*) => {$(
        impl fmt::Display for $description {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.view().fmt(f)
            }
        }

        impl $description {
            /// The table that `meissner inspect` prints: the input, a line for each layer, and the totals.
            pub fn to_table(&self) -> String {
                self.to_string()
            }

            /// The network in the DOT language of Graphviz.
            pub fn to_dot(&self) -> String {
                picture::dot(&self.view())
            }

            /// The network as a standalone SVG picture.
            pub fn to_svg(&self) -> String {
                picture::svg(&self.view())
            }
        }
    )*};
}
reports!(Description, FrameDescription, AnyDescription);
