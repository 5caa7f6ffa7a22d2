//! Layout of a map in memory, and rectangles of its pixels.

/// Rows `y..y + height` and columns `x..x + width` of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// First row.
    pub y: usize,
    /// First column.
    pub x: usize,
    /// Number of rows.
    pub height: usize,
    /// Number of columns.
    pub width: usize,
}

impl Region {
    /// The whole of a map of `height` x `width`.
    pub fn all(height: usize, width: usize) -> Self {
        Self { y: 0, x: 0, height, width }
    }

    /// Whether it contains no pixels.
    pub fn is_empty(&self) -> bool {
        self.height == 0 || self.width == 0
    }
}

/// Layout of the values of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) height: usize,
    pub(super) width: usize,
    /// Channels per pixel, which is also the distance between pixels in values.
    pub(super) channels: usize,
    pub(super) halo: usize,
}

impl Shape {
    /// Distance between rows in values.
    #[inline]
    pub(super) fn row(&self) -> usize {
        (self.width + 2 * self.halo) * self.channels
    }

    /// Start of pixel (y, x), counted from the halo's first pixel.
    #[inline]
    pub(super) fn stored(&self, y: usize, x: usize) -> usize {
        y * self.row() + x * self.channels
    }

    /// Start of pixel (y, x).
    #[inline]
    pub(super) fn pixel(&self, y: usize, x: usize) -> usize {
        self.stored(y + self.halo, x + self.halo)
    }

    /// Number of values, including the halo.
    pub(super) fn values(&self) -> Option<usize> {
        let height = self.height.checked_add(2 * self.halo)?;
        let width = self.width.checked_add(2 * self.halo)?;
        height.checked_mul(width)?.checked_mul(self.channels)
    }
}
