//! Frames from events and from electrode readings.
//!
//! Input: events in order of time, or readings. Output: dense row-major frames, each with the
//! pixels that have events or changed, so that a network can skip the others. An event costs O(1),
//! a frame O(pixels that it touched); buffers are reused. If events leave again, sums are integers,
//! and floats are computed when read.
//!
//! An event is *late* if earlier than the newest event or the last `advance`. Late events and
//! events outside the sensor are dropped and counted, as in [`crate::Engine`]. An event on the
//! sensor but outside the [`Crop`] advances time and is not part of a frame.

mod consecutive;
mod sliding;
mod tactile;
mod time_surface;
mod voxel_grid;

use std::fmt;

use thiserror::Error;

use crate::{EngineError, Sensor};

pub use consecutive::{Consecutive, ConsecutiveFrames};
pub use sliding::SlidingSigned;
pub use tactile::{
    ELECTRODE_COLUMNS, ELECTRODE_ROWS, ELECTRODES, Sampling, Scaling, TACTILE_CELLS, TACTILE_COLUMNS,
    TACTILE_ROWS, TactileForm, TactileLayout, TactileSequence, TactileWindow,
};
pub use time_surface::{Decay, Surface, TimeSurface};
pub use voxel_grid::{VoxelCounters, VoxelFrame, VoxelGrid, VoxelTime};

/// A rectangle; pixel (x, y) of the sensor is (x - `Crop::x`, y - `Crop::y`) of the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Crop {
    /// First column.
    pub x: u16,
    /// First row.
    pub y: u16,
    /// Columns.
    pub width: u16,
    /// Rows.
    pub height: u16,
}

impl Crop {
    /// `width` columns from `x` on, `height` rows from `y` on.
    pub fn new(x: u16, y: u16, width: u16, height: u16) -> Self {
        Self { x, y, width, height }
    }

    /// All pixels of `sensor`.
    pub fn whole(sensor: Sensor) -> Self {
        Self::new(0, 0, sensor.width, sensor.height)
    }

    /// Number of pixels; saturates if `usize` has 32 bits.
    pub fn pixels(self) -> usize {
        usize::from(self.width).saturating_mul(self.height.into())
    }

    /// Index of the sensor's pixel (`x`, `y`) in the frame, row-major; `None` outside.
    #[inline]
    pub fn index(self, x: u16, y: u16) -> Option<u32> {
        let (column, row) = (x.checked_sub(self.x)?, y.checked_sub(self.y)?);
        let inside = column < self.width && row < self.height;
        inside.then(|| u32::from(row) * u32::from(self.width) + u32::from(column))
    }

    /// The indices of `pixel` in a frame of `channels` channels.
    fn indices(self, pixel: u32, channels: usize) -> impl Iterator<Item = usize> {
        (pixel as usize..).step_by(self.pixels()).take(channels)
    }

    fn shape(self, channels: usize) -> [usize; 3] {
        [channels, usize::from(self.height), usize::from(self.width)]
    }
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{} from ({}, {})", self.width, self.height, self.x, self.y)
    }
}

/// A pixel's value in a signed frame, from its events (+1 ON, -1 OFF); 0 without events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SignedRule {
    /// The sum of the polarities, an integer.
    #[default]
    Sum,
    /// The polarity of the event that arrived last.
    Latest,
}

/// A frame, and its pixels that have events or changed.
///
/// Pixels are indices into one channel, row times width plus column, in no particular order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EventFrame<'a> {
    /// Channels, rows, columns.
    pub shape: [usize; 3],
    /// Values, row-major.
    pub values: &'a [f32],
    /// Start of the frame's window, on the events' own clock, in microseconds.
    pub start_us: i64,
    /// Events inside by polarity: negative (OFF), positive (ON).
    pub events: [u64; 2],
    /// Pixels that have events. All others are 0 in every channel.
    pub touched: &'a [u32],
    /// Pixels with a value that differs from the frame before; before the first frame all values
    /// are 0.
    pub changed: &'a [u32],
}

impl EventFrame<'_> {
    /// Whether the frame contains no event.
    pub fn is_empty(&self) -> bool {
        self.events == [0, 0]
    }
}

/// Consecutive frames without any event: all their values are 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmptyRun<'a> {
    /// Start of the first of them, on the events' own clock, in microseconds.
    pub start_us: i64,
    /// Time from the start of one to the start of the next, in microseconds.
    pub period_us: i64,
    /// Number of frames, at least 1.
    pub count: u64,
    /// Pixels in which the first frame differs from the one before; the others change nothing.
    pub changed: &'a [u32],
}

/// Frames whose window has ended. A silence of any length is one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Completed<'a> {
    /// One frame, with at least one event.
    Frame(EventFrame<'a>),
    /// One or more empty frames.
    Empty(EmptyRun<'a>),
}

impl Completed<'_> {
    /// Number of frames.
    pub fn count(&self) -> u64 {
        match self {
            Self::Frame(_) => 1,
            Self::Empty(run) => run.count,
        }
    }
}

/// Maximum number of values of a frame: 256 MiB.
const LIMIT: u64 = 1 << 26;

/// A representation refuses its options or its input.
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
        /// Name of the option.
        what: &'static str,
        /// The admissible range.
        expected: &'static str,
        /// The given value.
        found: String,
    },
    /// A reading is not a finite number.
    #[error("electrode {electrode}: expected a finite reading, found {value}")]
    Reading {
        /// Index of the electrode among the 24, counted from 0.
        electrode: usize,
        /// The given value.
        value: f32,
    },
    /// A reading is so far outside the range of its scaling that the result is not finite.
    #[error("electrode {electrode}: expected a reading that {minimum}..{maximum} can scale, found {value}")]
    Scaled {
        /// Index of the electrode among the 24, counted from 0.
        electrode: usize,
        /// The given value.
        value: f32,
        /// Value that is scaled to 0.
        minimum: f32,
        /// Value that is scaled to 1.
        maximum: f32,
    },
    /// A filter before the representation refuses the sensor.
    #[error(transparent)]
    Filter(Box<EngineError>),
}

impl From<EngineError> for RepresentationError {
    fn from(error: EngineError) -> Self {
        Self::Filter(Box::new(error))
    }
}

impl RepresentationError {
    fn option(what: &'static str, expected: &'static str, found: impl ToString) -> Self {
        Self::Option { what, expected, found: found.to_string() }
    }
}

impl Crop {
    /// Whether a frame of `channels` channels can show this part of `sensor`.
    fn check(self, sensor: Sensor, channels: usize) -> Result<(), RepresentationError> {
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

#[cfg(test)]
mod tests {
    mod events;
    mod tactile;
}
