//! Maps of activations, channels last, with a margin of zeros.

use super::shape::{Region, Shape};
use crate::error::{KernelError, check_sizes};
use crate::isa::{flat_wide, flat_wide_mut};
use crate::lanes::{LANES, Wide};

/// (height, width, channels) f32, a pixel's channels contiguous. A halo of 0 or 1 pixel stays zero,
/// so that a padded convolution needs no bounds checks.
#[derive(Clone, Debug)]
pub struct FeatureMap {
    shape: Shape,
    /// Rows of pixels with their halo, and one more vector, so that a vector can be read at every
    /// value.
    data: Vec<Wide>,
}

impl FeatureMap {
    /// Bytes of a map.
    pub fn bytes_of(height: usize, width: usize, channels: usize, halo: usize) -> u128 {
        let [height, width] = [height, width].map(|side| side as u128 + 2 * halo as u128);
        ((height * width * channels as u128).div_ceil(2 * LANES as u128) + 1) * size_of::<Wide>() as u128
    }

    /// A map of zeros with a halo of `halo` pixels.
    ///
    /// # Errors
    /// [`KernelError::Size`]: a size of zero, a halo of more than 1, or more than 2^32 values.
    pub fn zeros(height: usize, width: usize, channels: usize, halo: usize) -> Result<Self, KernelError> {
        check_sizes([("height", height), ("width", width), ("channels", channels)])?;
        if halo > 1 {
            return Err(KernelError::Size { what: "halo", expected: "0 or 1", found: halo });
        }
        let shape = Shape { height, width, channels, halo };
        let values = shape.values().filter(|&n| n as u64 <= 1 << 32).ok_or(KernelError::Size {
            what: "values of a map",
            expected: "at most 2^32",
            found: height.saturating_mul(width).saturating_mul(channels),
        })?;
        Ok(Self { shape, data: vec![Wide::ZERO; values.div_ceil(2 * LANES) + 1] })
    }

    /// A map of `values` (height, width, channels).
    ///
    /// # Errors
    /// As [`zeros`](Self::zeros), and [`KernelError::Length`].
    pub fn from_pixels(
        [height, width, channels]: [usize; 3],
        halo: usize,
        values: &[f32],
    ) -> Result<Self, KernelError> {
        let mut out = Self::zeros(height, width, channels, halo)?;
        let expected = height * width * channels;
        if values.len() != expected {
            return Err(KernelError::Length { tensor: "values of a map", expected, found: values.len() });
        }
        for (y, row) in values.chunks_exact(width * channels).enumerate() {
            let start = out.shape.pixel(y, 0);
            flat_wide_mut(&mut out.data)[start..][..row.len()].copy_from_slice(row);
        }
        Ok(out)
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.shape.height
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.shape.width
    }

    /// Channels of a pixel.
    pub fn channels(&self) -> usize {
        self.shape.channels
    }

    /// Bytes of storage.
    pub fn bytes(&self) -> usize {
        self.data.len() * size_of::<Wide>()
    }

    /// The channels of pixel (y, x).
    ///
    /// # Panics
    /// If the map has no such pixel.
    #[inline]
    pub fn pixel(&self, y: usize, x: usize) -> &[f32] {
        assert!(y < self.shape.height && x < self.shape.width, "the pixel must be on the map");
        &flat_wide(&self.data)[self.shape.pixel(y, x)..][..self.shape.channels]
    }

    /// The channels of pixel (y, x), to write.
    ///
    /// # Panics
    /// If the map has no such pixel.
    #[inline]
    pub fn pixel_mut(&mut self, y: usize, x: usize) -> &mut [f32] {
        assert!(y < self.shape.height && x < self.shape.width, "the pixel must be on the map");
        let at = self.shape.pixel(y, x);
        &mut flat_wide_mut(&mut self.data)[at..][..self.shape.channels]
    }

    /// Row `y`, pixel after pixel, to write.
    ///
    /// # Panics
    /// If the map has no such row.
    pub fn row_mut(&mut self, y: usize) -> &mut [f32] {
        assert!(y < self.shape.height, "the row must be on the map");
        let (at, count) = (self.shape.pixel(y, 0), self.shape.width * self.shape.channels);
        &mut flat_wide_mut(&mut self.data)[at..][..count]
    }

    /// Sets every value to zero.
    pub fn clear(&mut self) {
        self.data.fill(Wide::ZERO);
    }

    /// The whole map, to read.
    #[inline]
    pub fn view(&self) -> View<'_> {
        View::new(self.shape, flat_wide(&self.data))
    }

    /// The whole map, to write.
    #[inline]
    pub fn band(&mut self) -> Band<'_> {
        Band::new(self.shape, flat_wide_mut(&mut self.data))
    }
}

impl<'a> From<&'a FeatureMap> for View<'a> {
    fn from(map: &'a FeatureMap) -> Self {
        map.view()
    }
}

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

pub(super) struct Target<'a> {
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
