//! Rectangles of outputs.

use crate::error::KernelError;

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
    /// All of a map of `height` x `width`.
    pub fn all(height: usize, width: usize) -> Self {
        Self { y: 0, x: 0, height, width }
    }

    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.height == 0 || self.width == 0
    }

    /// Refuses a region that reaches beyond `height` x `width`.
    pub(super) fn check_within(&self, height: usize, width: usize) -> Result<(), KernelError> {
        let fits = |first: usize, count: usize, size: usize| first <= size && count <= size - first;
        if fits(self.y, self.height, height) && fits(self.x, self.width, width) {
            return Ok(());
        }
        Err(KernelError::Region { expected: "a rectangle", height, width, found: *self })
    }

    /// Refuses a region that cuts through a tile of `size` x `size`; tiles start at the map's first row and column, and
    /// the last ones end with the map.
    pub(super) fn check_tiles(&self, size: usize, height: usize, width: usize) -> Result<(), KernelError> {
        self.check_within(height, width)?;
        let whole = |first: usize, count: usize, end: usize| {
            first.is_multiple_of(size) && (count.is_multiple_of(size) || first + count == end)
        };
        if whole(self.y, self.height, height) && whole(self.x, self.width, width) {
            return Ok(());
        }
        Err(KernelError::Region { expected: "whole tiles", height, width, found: *self })
    }
}
