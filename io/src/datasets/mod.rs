//! Labelled sets of recordings: a folder in, recordings with their labels out, in an order that is the same everywhere.

mod error;
mod folder;
mod nmnist;
mod slip;

pub use error::DatasetError;
pub use nmnist::{NmnistDataset, NmnistRecording, Split};
pub use slip::{BadRows, RefusedRow, SlipDataset, SlipRecording};
