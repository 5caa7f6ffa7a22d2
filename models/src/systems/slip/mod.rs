//! Direction of slip from 24 electrodes (`BioTac SP`): 7 classes, 11 objects, windows of readings.
//!
//! - [`CLASSES`]: the directions, in the order of the networks' outputs,
//! - [`DecisionFilter`]: the classes of one window after the other into a decision that stands until others agree,
//! - [`Object`] and [`ObjectSet`]: what slipped, and which sets a network has seen,
//! - [`SlipWindows`]: readings into the windows that a network is trained and judged on,
//! - [`REFERENCES`]: accuracies that others report or reach without a network,
//! - [`SlipError`]: networks and recordings that do not belong here.

mod classes;
mod decision;
mod error;
mod objects;
mod references;
mod windows;

pub use classes::CLASSES;
pub use decision::{Decision, DecisionError, DecisionFilter};
pub use error::SlipError;
pub use objects::{Object, ObjectSet};
pub use references::{REFERENCES, Reference};
pub use windows::SlipWindows;
