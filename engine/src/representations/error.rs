//! What can go wrong in a representation, and the check of a crop.

use thiserror::Error;

use crate::Sensor;
use crate::representations::Crop;

/// Values of the largest frame: 256 MiB of them.
const LIMIT: u64 = 1 << 26;

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

impl Crop {
    /// Whether a frame of `channels` channels can show this part of `sensor`.
    pub(super) fn check(self, sensor: Sensor, channels: usize) -> Result<(), RepresentationError> {
        let inside = |from: u16, count: u16, extent: u16| {
            count > 0 && u32::from(from) + u32::from(count) <= u32::from(extent)
        };
        if !inside(self.x, self.width, sensor.width) || !inside(self.y, self.height, sensor.height) {
            return Err(RepresentationError::Crop { crop: self, sensor });
        }
        let pixels = u64::from(self.width) * u64::from(self.height);
        let values = pixels.saturating_mul(channels as u64);
        if values > LIMIT {
            return Err(RepresentationError::Size { channels, crop: self, values, limit: LIMIT });
        }
        Ok(())
    }
}
