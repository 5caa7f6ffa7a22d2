//! Handwritten digits under a moving event camera (N-MNIST, 34 x 34 pixels): 10 classes.
//!
//! - [`CLASSES`]: the digits, in the order of the networks' outputs; [`SENSOR`]: the pixels; [`check`]: whether a network
//!   belongs here,
//! - [`folds`]: which recordings a cross-validation holds out together,
//! - [`trained_as`]: whose weights a network runs with,
//! - [`settled`]: from when on an answer is right and stays right,
//! - [`DigitsError`]: networks and folds that do not belong here.

mod classes;
mod error;
mod folds;
mod settled;

pub use classes::{CLASSES, SENSOR, check, trained_as};
pub use error::DigitsError;
pub use folds::folds;
pub use settled::settled;
