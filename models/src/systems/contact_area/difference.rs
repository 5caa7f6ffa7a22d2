//! Contact without a network: where the image differs from an image without contact.
//!
//! d(p) = mean over a box around p (cut at the border) and over the channels of |image - reference|, in levels of 0 to
//! 255; contact where d > threshold. Boxes are summed in integers, so d is rounded once.

use serde::Serialize;

use super::{Centroid, ContactError, ImageSize, PixelSize, same_length, setting};

/// How images are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferenceSettings {
    /// Size of the images.
    pub size: ImageSize,
    /// Size of a pixel on the surface of the sensor.
    pub pixel: PixelSize,
    /// A pixel is in contact where its difference is greater than this, in levels; 0 to 255.
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
    /// Sums of the differences of all channels over the part of the box that is in the pixel's row.
    across: Vec<u32>,
    /// For each column, the sum of `across` over the box's rows.
    down: Vec<u32>,
    difference: Vec<f32>,
    mask: Vec<bool>,
}

impl DifferenceBaseline {
    /// Compares images with `reference`, an interleaved RGB image without contact.
    ///
    /// # Errors
    /// [`ContactError::Length`] where `reference` is not of the size, [`ContactError::Setting`] where the size is empty
    /// or too large, or the threshold not in 0 to 255.
    pub fn new(reference: &[u8], settings: DifferenceSettings) -> Result<Self, ContactError> {
        let DifferenceSettings { size, threshold, .. } = settings;
        let pixels = size.pixels()?;
        setting("threshold (levels)", "0 to 255", threshold.into(), (0.0..=255.0).contains(&threshold))?;
        same_length("reference (3 bytes a pixel)", pixels * 3, reference.len())?;
        Ok(Self {
            settings,
            reference: reference.to_owned(),
            across: vec![0; pixels],
            down: vec![0; size.width],
            difference: vec![0.0; pixels],
            mask: vec![false; pixels],
        })
    }

    /// Compares an interleaved RGB image; O(pixels), whatever the radius.
    ///
    /// # Errors
    /// [`ContactError::Length`] where `rgb` is not of the size.
    pub fn measure(&mut self, rgb: &[u8]) -> Result<DifferenceReport, ContactError> {
        same_length("image (3 bytes a pixel)", self.reference.len(), rgb.len())?;
        let ImageSize { width, height } = self.settings.size;
        self.sum_across(rgb);
        // A longer reach than the image changes nothing.
        let reach = self.settings.blur_radius.min(width.max(height));
        let (mut pixels, mut x_sum, mut y_sum) = (0_usize, 0_usize, 0_usize);
        self.down.fill(0);
        for row in 0..reach.min(height) {
            add(&mut self.down, &self.across[row * width..][..width]);
        }
        for y in 0..height {
            if y + reach < height {
                add(&mut self.down, &self.across[(y + reach) * width..][..width]);
            }
            if let Some(row) = y.checked_sub(reach + 1) {
                let row = &self.across[row * width..][..width];
                self.down.iter_mut().zip(row).for_each(|(sum, value)| *sum -= value);
            }
            let rows = reached(y, reach, height);
            for x in 0..width {
                let values = 3 * rows * reached(x, reach, width);
                let difference = (f64::from(self.down[x]) / values as f64) as f32;
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

    /// Fills `across` by running sums along the rows.
    fn sum_across(&mut self, rgb: &[u8]) {
        let width = self.settings.size.width;
        let reach = self.settings.blur_radius.min(width);
        let rows = rgb.chunks_exact(width * 3).zip(self.reference.chunks_exact(width * 3));
        for ((image, reference), sums) in rows.zip(self.across.chunks_exact_mut(width)) {
            let at = |x: usize| -> u32 {
                (x * 3..x * 3 + 3).map(|i| u32::from(image[i].abs_diff(reference[i]))).sum()
            };
            let mut sum: u32 = (0..reach).map(at).sum();
            for (x, out) in sums.iter_mut().enumerate() {
                if x + reach < width {
                    sum += at(x + reach);
                }
                if let Some(left) = x.checked_sub(reach + 1) {
                    sum -= at(left);
                }
                *out = sum;
            }
        }
    }
}

fn add(sums: &mut [u32], row: &[u32]) {
    sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
}

/// Number of indices below `length` that are within `reach` of `at`.
fn reached(at: usize, reach: usize, length: usize) -> usize {
    (at + reach + 1).min(length) - at.saturating_sub(reach)
}

#[cfg(test)]
mod tests;
