//! Input that the simulator refuses.

use thiserror::Error;

/// Why a simulation did not start, or did not go on. The state is as it was before the call.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SimulatorError {
    /// A setting is outside its range.
    #[error("{name} is {found}, expected {expected}")]
    Setting {
        /// The field of the settings.
        name: &'static str,
        /// Its range.
        expected: &'static str,
        /// Its value.
        found: f64,
    },
    /// An image has another number of pixels than the sensor.
    #[error("the image has {found} pixels, the sensor {expected}")]
    Pixels {
        /// Pixels of the sensor.
        expected: usize,
        /// Pixels of the image.
        found: usize,
    },
    /// An intensity is negative or not finite.
    #[error("the intensity of pixel ({x}, {y}) is {found}, expected a finite number of at least 0")]
    Intensity {
        /// Column.
        x: u16,
        /// Row.
        y: u16,
        /// The value.
        found: f32,
    },
    /// An image does not follow the one before, or lies more than 285 years after the first.
    #[error("an image at {found} us follows one at {before} us: times must ascend")]
    Time {
        /// Time of the image before, in microseconds.
        before: i64,
        /// Time of the refused image.
        found: i64,
    },
    /// Tracks do not have as many positions as times and markers.
    #[error("tracks of {times} times and {markers} markers have {found} positions")]
    Tracks {
        /// Number of times.
        times: usize,
        /// Markers at each time.
        markers: usize,
        /// Number of positions.
        found: usize,
    },
    /// The search for a contact did not end, or a force had nothing to press with.
    #[error("no contact was found in {iterations} iterations")]
    NoContact {
        /// Iterations.
        iterations: usize,
    },
    /// A position of a track is not finite.
    #[error("marker {marker} at {t_us} us is not at a finite position")]
    Position {
        /// Number of the marker.
        marker: usize,
        /// Time in microseconds.
        t_us: i64,
    },
}
