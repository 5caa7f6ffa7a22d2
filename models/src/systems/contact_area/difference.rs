//! Contact without a network: the pixels at which the image differs from an image without contact.
//!
//! d(p) = mean over a box around p (cut at the border) and channels of |image - reference|, in
//! levels of 0 to 255; contact where d > threshold. Integer sums of four rectangles from the top
//! left (Crow 1984, "Summed-area tables for texture mapping"); d is rounded once.

use std::ops::Range;

use serde::Serialize;

use super::{Centroid, ContactError, ImageSize, PixelSize, same_length, setting};

/// Settings of the comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferenceSettings {
    /// Size of the images.
    pub size: ImageSize,
    /// Size of a pixel on the surface of the sensor.
    pub pixel: PixelSize,
    /// A pixel is in contact if its difference is greater than this, in levels; 0 to 255.
    pub threshold: f32,
    /// Number of pixels that the box reaches to each side; 0: no blur.
    pub blur_radius: usize,
}

/// The contact in one image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DifferenceReport {
    /// Pixels in contact; not serialised.
    #[serde(skip)]
    pub pixels: usize,
    /// Area of these pixels in mm^2.
    pub area_mm2: f64,
    /// Mean of their coordinates; `None` without a contact.
    pub centroid: Option<Centroid>,
}

/// Compares images with a reference.
#[derive(Clone, Debug, PartialEq)]
pub struct DifferenceBaseline {
    settings: DifferenceSettings,
    reference: Vec<u8>,
    /// (H + 1, W + 1): sums of all channels' differences above and to the left.
    sums: Vec<u32>,
    difference: Vec<f32>,
    mask: Vec<bool>,
}

impl DifferenceBaseline {
    /// Compares images with `reference`, an interleaved RGB image without contact.
    ///
    /// # Errors
    /// [`ContactError::Length`] for a `reference` of another size, [`ContactError::Setting`] for a
    /// size that is empty or too large, or a threshold not in 0 to 255.
    pub fn new(reference: &[u8], settings: DifferenceSettings) -> Result<Self, ContactError> {
        let DifferenceSettings { size, threshold, .. } = settings;
        let pixels = size.pixels()?;
        setting("threshold (levels)", "0 to 255", threshold.into(), (0.0..=255.0).contains(&threshold))?;
        same_length("reference (3 bytes a pixel)", pixels * 3, reference.len())?;
        Ok(Self {
            settings,
            reference: reference.to_owned(),
            sums: vec![0; (size.height + 1) * (size.width + 1)],
            difference: vec![0.0; pixels],
            mask: vec![false; pixels],
        })
    }

    /// Compares an interleaved RGB image; O(pixels), whatever the radius.
    ///
    /// # Errors
    /// [`ContactError::Length`] if `rgb` is not of the size.
    pub fn measure(&mut self, rgb: &[u8]) -> Result<DifferenceReport, ContactError> {
        same_length("image (3 bytes a pixel)", self.reference.len(), rgb.len())?;
        let ImageSize { width, height } = self.settings.size;
        let stride = width + 1;
        let levels = rgb.chunks_exact(3).zip(self.reference.chunks_exact(3));
        let mut row_sum = 0;
        for (at, (image, reference)) in levels.enumerate() {
            let (x, y) = (at % width, at / width);
            row_sum = if x == 0 { 0 } else { row_sum };
            row_sum += image.iter().zip(reference).map(|(a, &b)| u32::from(a.abs_diff(b))).sum::<u32>();
            self.sums[(y + 1) * stride + x + 1] = self.sums[y * stride + x + 1] + row_sum;
        }
        let (mut pixels, mut x_sum, mut y_sum) = (0_usize, 0_usize, 0_usize);
        for y in 0..height {
            let rows = reached(y, self.settings.blur_radius, height);
            for x in 0..width {
                let columns = reached(x, self.settings.blur_radius, width);
                let above = |row: usize| {
                    self.sums[row * stride + columns.end] - self.sums[row * stride + columns.start]
                };
                let (sum, values) = (above(rows.end) - above(rows.start), 3 * rows.len() * columns.len());
                let difference = (f64::from(sum) / values as f64) as f32;
                let contact = difference > self.settings.threshold;
                self.difference[y * width + x] = difference;
                self.mask[y * width + x] = contact;
                if contact {
                    (pixels, x_sum, y_sum) = (pixels + 1, x_sum + x, y_sum + y);
                }
            }
        }
        let pixel = self.settings.pixel;
        let mean = |sum: usize| sum as f64 / pixels as f64;
        Ok(DifferenceReport {
            pixels,
            area_mm2: pixel.area_mm2(pixels),
            centroid: (pixels > 0).then(|| pixel.centroid(mean(x_sum), mean(y_sum))),
        })
    }

    /// The differences (H, W) of the last image, in levels.
    pub fn difference(&self) -> &[f32] {
        &self.difference
    }

    /// The pixels (H, W) in contact in the last image.
    pub fn mask(&self) -> &[bool] {
        &self.mask
    }
}

/// The indices below `length` that are within `reach` of `at`.
fn reached(at: usize, reach: usize, length: usize) -> Range<usize> {
    at.saturating_sub(reach)..at.saturating_add(reach).saturating_add(1).min(length)
}
