//! The directions of slip.

use super::SlipError;
use crate::FrameDescription;

/// Names of the classes, in the order of their indices: rotation anticlockwise and clockwise, east, north, south, no
/// slip (touch), west.
pub const CLASSES: [&str; 7] = ["aw", "cw", "e", "n", "s", "t", "w"];

/// `Ok` where `description` predicts [`CLASSES`].
pub(super) fn check(description: &FrameDescription) -> Result<(), SlipError> {
    let (names, _) = description.outputs();
    if names.iter().map(String::as_str).eq(CLASSES) {
        return Ok(());
    }
    Err(SlipError::Outputs {
        network: description.name().to_owned(),
        expected: CLASSES.join(", "),
        found: names.join(", "),
    })
}
