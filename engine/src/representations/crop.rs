//! The part of a sensor that a frame shows.

use std::fmt;

use crate::Sensor;

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

    /// Number of pixels; saturates where `usize` has 32 bits.
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
    pub(super) fn indices(self, pixel: u32, channels: usize) -> impl Iterator<Item = usize> {
        (pixel as usize..).step_by(self.pixels()).take(channels)
    }

    /// The shape (`channels`, height, width).
    pub(super) fn shape(self, channels: usize) -> [usize; 3] {
        [channels, usize::from(self.height), usize::from(self.width)]
    }
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{} from ({}, {})", self.width, self.height, self.x, self.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::representations::RepresentationError;

    #[test]
    fn pixels_count_from_the_crops_corner_row_by_row() {
        let crop = Crop::new(10, 20, 3, 2);
        assert_eq!(crop.index(10, 20), Some(0));
        assert_eq!(crop.index(12, 21), Some(5));
        assert_eq!(
            [crop.index(9, 20), crop.index(13, 20), crop.index(10, 22), crop.index(10, 19)],
            [None; 4]
        );
    }

    #[test]
    fn a_crop_without_pixels_or_beyond_the_sensor_is_refused() {
        let sensor = Sensor::new(8, 6);
        assert_eq!(Crop::whole(sensor).check(sensor, 2), Ok(()));
        for crop in
            [Crop::new(0, 0, 0, 6), Crop::new(0, 0, 8, 0), Crop::new(1, 0, 8, 6), Crop::new(0, 5, 1, 2)]
        {
            assert_eq!(crop.check(sensor, 2), Err(RepresentationError::Crop { crop, sensor }));
        }
    }

    #[test]
    fn a_frame_of_more_values_than_memory_is_for_is_refused() {
        let sensor = Sensor::new(u16::MAX, u16::MAX);
        let error = Crop::whole(sensor).check(sensor, 2).expect_err("8 GiB of counts");
        assert!(matches!(error, RepresentationError::Size { values: 8_589_672_450, .. }), "{error}");
    }
}
