//! What can go wrong in a representation.

use thiserror::Error;

use crate::Sensor;
use crate::representations::Crop;

/// A representation refuses what it was given.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum RepresentationError {
    /// The crop has no pixels, or reaches beyond the sensor.
    #[error("crop: expected a rectangle with pixels inside the sensor of {sensor}, found {crop}")]
    Crop {
        /// The crop.
        crop: Crop,
        /// The sensor.
        sensor: Sensor,
    },
    /// A frame would hold more values than it may.
    #[error("frame of {channels} channels over {crop}: expected at most {limit} values, found {values}")]
    Size {
        /// Channels of the frame.
        channels: usize,
        /// Pixels of each channel.
        crop: Crop,
        /// Values that the frame would hold.
        values: u64,
        /// Values that it may hold.
        limit: u64,
    },
    /// An option is out of range.
    #[error("{what}: expected {expected}, found {found}")]
    Option {
        /// Which option.
        what: &'static str,
        /// The admissible range.
        expected: &'static str,
        /// What came.
        found: String,
    },
    /// A reading is not a finite number.
    #[error("electrode {electrode}: expected a finite reading, found {value}")]
    Reading {
        /// Which of the 24, counted from 0.
        electrode: usize,
        /// What came.
        value: f32,
    },
    /// A reading is so far outside the range that it is scaled by that the result is not finite.
    #[error("electrode {electrode}: expected a reading that {minimum}..{maximum} can scale, found {value}")]
    Scaled {
        /// Which of the 24, counted from 0.
        electrode: usize,
        /// What came.
        value: f32,
        /// What becomes 0.
        minimum: f32,
        /// What becomes 1.
        maximum: f32,
    },
}

impl RepresentationError {
    pub(super) fn option(what: &'static str, expected: &'static str, found: impl ToString) -> Self {
        Self::Option { what, expected, found: found.to_string() }
    }
}
