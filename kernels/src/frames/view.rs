//! The inputs and outputs of a layer: some channels of a map and, for outputs, some of its rows.
//!
//! A concatenation along channels is one map; two layers write to different channels of it.

use super::shape::{Region, Shape};
use crate::error::{KernelError, check_sizes};

/// A contiguous range of a map's channels, to read.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    pub(super) shape: Shape,
    pub(super) values: &'a [f32],
    pub(super) first: usize,
    pub(super) channels: usize,
}

impl<'a> View<'a> {
    pub(super) fn new(shape: Shape, values: &'a [f32]) -> Self {
        Self { shape, values, first: 0, channels: shape.channels }
    }

    /// Channels `first..first + count` of this view.
    ///
    /// # Errors
    /// [`KernelError::Size`] if there are fewer channels.
    pub fn channels(self, first: usize, count: usize) -> Result<Self, KernelError> {
        check_channels(self.channels, first, count)?;
        Ok(Self { first: self.first + first, channels: count, ..self })
    }

    /// (height, width, channels).
    pub fn size(&self) -> [usize; 3] {
        [self.shape.height, self.shape.width, self.channels]
    }

    /// The channels of pixel (y, x).
    ///
    /// # Panics
    /// If the map has no such pixel.
    pub fn pixel(&self, y: usize, x: usize) -> &'a [f32] {
        assert!(y < self.shape.height && x < self.shape.width, "the pixel must be on the map");
        &self.values[self.shape.pixel(y, x) + self.first..][..self.channels]
    }

    /// Refuses a view of another size, or with less halo.
    pub(super) fn check(&self, size: [usize; 3], halo: usize) -> Result<(), KernelError> {
        if self.size() != size {
            return Err(KernelError::Shape { what: "input map", expected: size, found: self.size() });
        }
        if self.shape.halo < halo {
            let (expected, found) = ("at least the kernel's padding", self.shape.halo);
            return Err(KernelError::Size { what: "halo of an input map", expected, found });
        }
        Ok(())
    }
}

/// A range of channels in some rows of a map, to write. Bands of different rows are disjoint.
#[derive(Debug)]
pub struct Band<'a> {
    shape: Shape,
    /// From the first pixel of the first row to the next band.
    values: &'a mut [f32],
    first_row: usize,
    rows: usize,
    first: usize,
    channels: usize,
}

impl<'a> Band<'a> {
    pub(super) fn new(shape: Shape, values: &'a mut [f32]) -> Self {
        let values = &mut values[shape.pixel(0, 0)..];
        Self { shape, values, first_row: 0, rows: shape.height, first: 0, channels: shape.channels }
    }

    /// Channels `first..first + count` of this band.
    ///
    /// # Errors
    /// [`KernelError::Size`] if there are fewer channels.
    pub fn channels(self, first: usize, count: usize) -> Result<Self, KernelError> {
        check_channels(self.channels, first, count)?;
        Ok(Self { first: self.first + first, channels: count, ..self })
    }

    /// Splits the band into the rows above `y`, a row of the map, and the rest.
    ///
    /// # Errors
    /// [`KernelError::Size`] if `y` is neither among the band's rows nor just below them.
    pub fn split_at_row(self, y: usize) -> Result<(Self, Self), KernelError> {
        let Self { shape, values, first_row, rows, first, channels } = self;
        let above = y.checked_sub(first_row).filter(|&above| above <= rows).ok_or(KernelError::Size {
            what: "row to split at",
            expected: "a row of the band",
            found: y,
        })?;
        let middle = (above * shape.row()).min(values.len());
        let (upper, lower) = values.split_at_mut(middle);
        let band = |values, first_row, rows| Self { shape, values, first_row, rows, first, channels };
        Ok((band(upper, first_row, above), band(lower, y, rows - above)))
    }

    /// (height, width, channels): height and width of the map, channels of the band.
    pub fn size(&self) -> [usize; 3] {
        [self.shape.height, self.shape.width, self.channels]
    }

    /// Rows of the map in the band.
    pub fn rows(&self) -> std::ops::Range<usize> {
        self.first_row..self.first_row + self.rows
    }

    /// Refuses a band of a map of another size, or one without all rows of `region`.
    pub(super) fn check(&self, size: [usize; 3], region: Region) -> Result<(), KernelError> {
        if self.size() != size {
            return Err(KernelError::Shape { what: "output map", expected: size, found: self.size() });
        }
        let [height, width, _] = size;
        region.check_within(height, width)?;
        let rows = self.rows();
        if !region.is_empty() && (region.y < rows.start || region.y + region.height > rows.end) {
            return Err(KernelError::Region { expected: "rows of the band", height, width, found: region });
        }
        Ok(())
    }

    /// Outputs from pixel (y, x)'s first channel on; the distances between rows and pixels.
    #[inline]
    pub(super) fn target(&mut self, y: usize, x: usize) -> Target<'_> {
        let (row, pixel) = (self.shape.row(), self.shape.channels);
        let at = (y - self.first_row) * row + x * pixel + self.first;
        Target { values: &mut self.values[at..], row, pixel }
    }
}

/// Destination of outputs.
pub(super) struct Target<'a> {
    /// Values from the first output on.
    pub(super) values: &'a mut [f32],
    /// Distance between rows in values.
    pub(super) row: usize,
    /// Distance between outputs of a row in values.
    pub(super) pixel: usize,
}

fn check_channels(all: usize, first: usize, count: usize) -> Result<(), KernelError> {
    check_sizes([("channels", count)])?;
    if first > all || count > all - first {
        let found = first.saturating_add(count);
        return Err(KernelError::Size { what: "last channel", expected: "a channel of the map", found });
    }
    Ok(())
}

impl Region {
    /// Refuses a region that reaches beyond `height` x `width`.
    pub(super) fn check_within(&self, height: usize, width: usize) -> Result<(), KernelError> {
        let fits = |first: usize, count: usize, size: usize| first <= size && count <= size - first;
        if fits(self.y, self.height, height) && fits(self.x, self.width, width) {
            return Ok(());
        }
        Err(KernelError::Region { expected: "a rectangle", height, width, found: *self })
    }

    /// Refuses a region that cuts through a tile of `size` x `size`; tiles start at the map's first
    /// pixel, and the last end with the map.
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
