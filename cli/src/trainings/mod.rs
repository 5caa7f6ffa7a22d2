//! What files of trainings say about themselves, whatever the system, and what can be wrong with it.

mod error;
mod remarks;

pub(crate) use error::TrainingError;
pub(crate) use remarks::{Remarks, files};
