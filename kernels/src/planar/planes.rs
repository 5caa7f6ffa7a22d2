//! An image stored plane after plane, with a border of zeros.
//!
//! A row is padded to whole [`Wide`] with at least one zero, the border on its right and on the
//! next row's left. A row of zeros lies above and below each plane, and a `Wide` of zeros around
//! all: a vector at any position or neighbour can be loaded. Values outside the pixels are always
//! zero.

use std::ops::Range;

use crate::isa::{flat_wide, flat_wide_mut, lanes_of_wide};
use crate::lanes::{LANES, Lanes, Wide};

pub(crate) const TILE: usize = 2 * LANES;

/// (channels, height, width) values.
#[derive(Clone, Debug, PartialEq)]
pub struct Planes {
    channels: usize,
    height: usize,
    width: usize,
    data: Vec<Wide>,
}

/// Rows, and tiles of sixteen columns: tile t has columns 16 t..16 t + 16.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileRegion {
    /// Rows.
    pub rows: Range<usize>,
    /// Tiles of sixteen columns; the last may extend beyond the width.
    pub tiles: Range<usize>,
}

impl Planes {
    /// Bytes of an image.
    pub fn bytes_of(channels: usize, height: usize, width: usize) -> u128 {
        let tiles = width as u128 / TILE as u128 + 1;
        (channels as u128 * (height as u128 + 2) * tiles + 2) * size_of::<Wide>() as u128
    }

    /// An image of zeros.
    ///
    /// # Panics
    /// If the memory cannot be allocated.
    pub fn zeros(channels: usize, height: usize, width: usize) -> Self {
        let wides = channels * (height + 2) * stride(width) / TILE + 2;
        Self { channels, height, width, data: vec![Wide::ZERO; wides] }
    }

    /// An image of `values`, (channels, height, width).
    ///
    /// # Panics
    /// If `values` does not have this size.
    pub fn from_values(channels: usize, height: usize, width: usize, values: &[f32]) -> Self {
        let mut out = Self::zeros(channels, height, width);
        out.set(values);
        out
    }

    /// Replaces every value; `values` are (channels, height, width).
    ///
    /// # Panics
    /// If `values` does not have this size.
    pub fn set(&mut self, values: &[f32]) {
        let Self { channels, height, width, .. } = *self;
        assert_eq!(values.len(), channels * height * width, "there must be a value for each pixel");
        if width > 0 {
            for (i, row) in values.chunks_exact(width).enumerate() {
                self.row_mut(i / height, i % height).copy_from_slice(row);
            }
        }
    }

    /// Sets every value to zero.
    pub fn clear(&mut self) {
        self.data.fill(Wide::ZERO);
    }

    /// Number of channels.
    #[inline]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Number of rows.
    #[inline]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Number of columns.
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Every row and every tile.
    pub fn region(&self) -> TileRegion {
        TileRegion { rows: 0..self.height, tiles: 0..self.tiles() }
    }

    /// Number of tiles of sixteen columns; the last may be partly filled.
    #[inline]
    pub fn tiles(&self) -> usize {
        self.width.div_ceil(TILE)
    }

    /// Row `y` of `channel`.
    ///
    /// # Panics
    /// If there is no such row.
    #[inline]
    pub fn row(&self, channel: usize, y: usize) -> &[f32] {
        self.check(channel, y);
        &flat_wide(&self.data)[self.start(channel, y)..][..self.width]
    }

    /// Row `y` of `channel`, to write.
    ///
    /// # Panics
    /// If there is no such row.
    #[inline]
    pub fn row_mut(&mut self, channel: usize, y: usize) -> &mut [f32] {
        let width = self.width;
        &mut self.padded_mut(channel, y)[..width]
    }

    /// Every value, (channels, height, width).
    pub fn values(&self) -> impl Iterator<Item = f32> + '_ {
        (0..self.channels * self.height)
            .flat_map(|row| self.row(row / self.height, row % self.height).iter().copied())
    }

    /// All values with border and padding, for a [`crate::Dense`] with weights of [`Self::spread`].
    #[inline]
    pub fn lanes(&self) -> &[Lanes] {
        lanes_of_wide(&self.data)
    }

    /// Converts weights on an image's values, (n, channels x height x width), to weights on
    /// [`Self::lanes`], which are zero outside the pixels.
    ///
    /// # Panics
    /// If the length of `weight` is not a multiple of the image's.
    pub fn spread(&self, weight: &[f32]) -> Vec<f32> {
        let count = self.channels * self.height * self.width;
        assert_eq!(weight.len() % count.max(1), 0, "weights must fill whole images");
        let mut image = Self::zeros(self.channels, self.height, self.width);
        let mut out = Vec::new();
        for weight in weight.chunks_exact(count.max(1)) {
            image.set(weight);
            out.extend_from_slice(flat_wide(&image.data));
        }
        out
    }

    /// Whether every value of `region`, and of the pixels around it, is zero (of either sign).
    ///
    /// # Panics
    /// If the region's tiles begin beyond the image.
    pub fn is_zero_around(&self, region: &TileRegion) -> bool {
        let rows = region.rows.start.saturating_sub(1)..region.rows.end.saturating_add(1).min(self.height);
        let from = region.tiles.start.saturating_mul(TILE).saturating_sub(1);
        let to = region.tiles.end.saturating_mul(TILE).saturating_add(1).min(self.width);
        (0..self.channels)
            .all(|channel| rows.clone().all(|y| self.row(channel, y)[from..to].iter().all(|&v| v == 0.0)))
    }

    /// Bytes of storage.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.data)
    }

    /// Row `y` of `channel` with its padding, to write; the padding must be zero again afterwards.
    #[inline]
    pub(crate) fn padded_mut(&mut self, channel: usize, y: usize) -> &mut [f32] {
        self.check(channel, y);
        let start = self.start(channel, y);
        &mut flat_wide_mut(&mut self.data)[start..][..stride(self.width)]
    }

    /// Values from (0, y, 0) on, to write; values outside the pixels must be zero again afterwards.
    #[inline]
    pub(crate) fn onward_mut(&mut self, y: usize) -> &mut [f32] {
        let start = self.start(0, y);
        &mut flat_wide_mut(&mut self.data)[start..]
    }

    /// All values, starting with the one above and to the left of (0, y, x).
    #[inline]
    pub(crate) fn above(&self, y: usize, x: usize) -> &[f32] {
        &flat_wide(&self.data)[self.start(0, y) - stride(self.width) + x - 1..]
    }

    /// Distance between rows in values.
    #[inline]
    pub(crate) fn stride(&self) -> usize {
        stride(self.width)
    }

    /// Distance between channels in values.
    #[inline]
    pub(crate) fn plane(&self) -> usize {
        (self.height + 2) * stride(self.width)
    }

    #[inline]
    fn start(&self, channel: usize, y: usize) -> usize {
        TILE + channel * self.plane() + (y + 1) * self.stride()
    }

    #[inline]
    fn check(&self, channel: usize, y: usize) {
        assert!(channel < self.channels && y < self.height, "there must be such a row");
    }
}

/// Length of a row's values with at least one zero, padded.
#[inline]
fn stride(width: usize) -> usize {
    (width + 1).next_multiple_of(TILE)
}

/// One flag per row and tile of sixteen columns of an image, all channels together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Occupancy {
    tiles: usize,
    /// (height + 2, tiles + 2), with a border of empty tiles.
    flags: Vec<bool>,
}

impl Occupancy {
    /// Flags for an image of `height` rows of `width` zeros.
    ///
    /// # Panics
    /// If the memory cannot be allocated.
    pub fn empty(height: usize, width: usize) -> Self {
        let tiles = width.div_ceil(TILE);
        Self { tiles, flags: vec![false; (height + 2) * (tiles + 2)] }
    }

    /// Recomputes the flags from `planes`. O(values). Allocates nothing.
    ///
    /// # Panics
    /// If `planes` has other rows or tiles.
    pub fn update(&mut self, planes: &Planes) {
        let columns = self.tiles + 2;
        assert!(
            self.fits(planes.height(), planes.width()),
            "the image must have the rows and tiles that were announced"
        );
        for y in 0..planes.height() {
            let flags = &mut self.flags[(y + 1) * columns + 1..][..planes.tiles()];
            flags.fill(false);
            for channel in 0..planes.channels() {
                for (flag, values) in flags.iter_mut().zip(planes.row(channel, y).chunks(TILE)) {
                    // All bits except the sign.
                    *flag |= values.iter().fold(0, |bits, v| bits | v.to_bits() << 1) != 0;
                }
            }
        }
    }

    /// Whether no flag is set in row `y` of tiles `first..first + count`, nor around them.
    ///
    /// # Panics
    /// If there is no such row or tile.
    #[inline]
    pub fn is_empty_around(&self, y: usize, first: usize, count: usize) -> bool {
        let columns = self.tiles + 2;
        (y..y + 3).all(|row| !self.flags[row * columns + first..][..count + 2].contains(&true))
    }

    /// Whether the flags are for an image of this size.
    pub(crate) fn fits(&self, height: usize, width: usize) -> bool {
        self.tiles == width.div_ceil(TILE) && self.flags.len() == (height + 2) * (self.tiles + 2)
    }

    /// Number of tiles with a value that is not zero.
    pub fn occupied(&self) -> usize {
        self.flags.iter().filter(|&&flag| flag).count()
    }
}
