//! Input of an engine: events, and the geometry of their sensor.

use std::fmt;

/// A change of brightness at one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Event {
    /// Time in microseconds. Any epoch works: only differences are used.
    pub t_us: i64,
    /// Column, counted from the left.
    pub x: u16,
    /// Row, counted from the top.
    pub y: u16,
    /// Whether the brightness rose (polarity 1 or +1) or fell (polarity 0 or -1).
    pub on: bool,
}

impl Event {
    /// An event at `t_us` microseconds, column `x`, row `y`; `on` if the brightness rose.
    pub fn new(t_us: i64, x: u16, y: u16, on: bool) -> Self {
        Self { t_us, x, y, on }
    }
}

/// The number of columns and rows of a sensor, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sensor {
    /// Columns.
    pub width: u16,
    /// Rows.
    pub height: u16,
}

impl Sensor {
    /// A sensor of `width` columns and `height` rows.
    pub fn new(width: u16, height: u16) -> Self {
        Self { width, height }
    }

    /// Whether the pixel (`x`, `y`) exists on this sensor.
    #[inline]
    pub fn contains(self, x: u16, y: u16) -> bool {
        x < self.width && y < self.height
    }
}

impl fmt::Display for Sensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}
