//! Labelled sets of recordings: a folder in, recordings with their labels out, in an order that is the same everywhere.

mod error;
mod slip;

pub use error::DatasetError;
pub use slip::{BadRows, RefusedRow, SlipDataset, SlipRecording};
