//! Direction of slip from 24 electrodes (`BioTac SP`): 7 classes, 11 objects, windows of readings.
//!
//! - [`CLASSES`]: the directions, in the order of outputs; [`WORDS`]: the same for people,
//! - [`SlipWindows`]: cuts readings into the windows that a network is trained and evaluated on,
//! - [`DecisionFilter`]: from classes of windows to a decision that stands until others agree,
//! - [`Object`] and [`ObjectSet`]: the objects that slip, and sets seen or not seen in training,
//! - [`REFERENCES`]: accuracies that others report or reach without a network,
//! - [`SlipError`]: networks and recordings that do not belong here.

mod decision;
mod objects;
mod windows;

use meissner_engine::representations::RepresentationError;
use thiserror::Error;

use super::OutputsError;

pub use decision::{Decision, DecisionError, DecisionFilter};
pub use objects::{Object, ObjectSet, REFERENCES, Reference};
pub use windows::SlipWindows;

/// Classes by index: rotation anticlockwise and clockwise, east, north, south, no slip (touch),
/// west.
pub const CLASSES: [&str; 7] = ["aw", "cw", "e", "n", "s", "t", "w"];

/// The classes in words for people, in the same order.
pub const WORDS: [&str; CLASSES.len()] =
    ["anticlockwise", "clockwise", "east", "north", "south", "touch", "west"];

/// The word for people of `class`, if `classes` are those of slip; `class` itself otherwise.
pub fn word<'a>(class: &'a str, classes: &[String]) -> &'a str {
    let index = CLASSES.iter().position(|&name| name == class).filter(|_| classes == CLASSES);
    index.map_or(class, |index| WORDS[index])
}

/// A network or a recording does not belong to direction of slip.
#[derive(Clone, Debug, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages explain the fields")]
#[non_exhaustive]
pub enum SlipError {
    /// The network does not read electrodes.
    #[error(
        "network {network}: expected a network over readings of electrodes (frames = \"tactile-image\" or \
         \"electrodes\"), found frames = {found:?}"
    )]
    NotReadings { network: String, found: &'static str },
    /// The network predicts other classes or values.
    #[error(transparent)]
    Outputs(#[from] OutputsError),
    /// No set has the object of a recording.
    #[error("recording {recording}: expected an object of {expected}, found {found:?}")]
    Object { recording: String, expected: String, found: String },
    /// A window cannot take a reading.
    #[error(transparent)]
    Reading(#[from] RepresentationError),
}
