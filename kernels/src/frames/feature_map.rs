//! Maps of activations, channels last, with a margin of zeros.

use super::shape::Shape;
use super::view::{Band, View};
use crate::error::{KernelError, check_sizes};
use crate::isa::{flat_wide, flat_wide_mut};
use crate::lanes::{LANES, Wide};

/// (height, width, channels) f32, a pixel's channels contiguous. A halo of 0 or 1 pixel stays zero,
/// so that a padded convolution needs no bounds checks.
#[derive(Clone, Debug)]
pub struct FeatureMap {
    shape: Shape,
    /// Rows of pixels with their halo, and one more vector: one can be read at every value.
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
