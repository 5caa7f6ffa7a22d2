//! Input that the simulator refuses.

use thiserror::Error;

/// The result of a simulation, or its error.
pub type Result<T, E = SimulatorError> = std::result::Result<T, E>;

/// The reason why a simulation did not start or continue. The state is the same as before the call.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum SimulatorError {
    /// A setting is outside its range.
    #[error("{name} is {found}, expected {expected}")]
    Setting { name: &'static str, expected: &'static str, found: f64 },
    /// An image has another number of pixels than the sensor.
    #[error("the image has {found} pixels, the sensor {expected}")]
    Pixels { expected: usize, found: usize },
    /// An intensity is negative or not finite.
    #[error("the intensity of pixel ({x}, {y}) is {found}, expected a finite number of at least 0")]
    Intensity { x: u16, y: u16, found: f32 },
    /// An image does not follow the one before, or lies more than 285 years after the first.
    #[error("an image at {found} us follows one at {before} us: times must ascend")]
    Time { before: i64, found: i64 },
    /// Tracks do not have as many positions as times and markers.
    #[error("tracks of {times} times and {markers} markers have {found} positions")]
    Tracks { times: usize, markers: usize, found: usize },
    /// The search for a contact did not converge, or there is no indenter to press with a force.
    #[error("no contact was found in {iterations} iterations")]
    NoContact { iterations: usize },
    /// A position of a track is not finite.
    #[error("marker {marker} at {t_us} us is not at a finite position")]
    Position { marker: usize, t_us: i64 },
}

/// Refuses the value `found` of a setting unless it `fits`.
pub(crate) fn setting(name: &'static str, expected: &'static str, found: f64, fits: bool) -> Result<()> {
    if fits { Ok(()) } else { Err(SimulatorError::Setting { name, expected, found }) }
}
