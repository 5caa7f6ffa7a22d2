//! Contact without a network: where the image differs from one without contact.
//!
//! d(p) = mean over a box around p (cut at the border) and over the channels of |image - reference|, in levels of 0 to
//! 255; contact where d > threshold. Boxes are summed in integers, so d is rounded once.

use super::error::{ContactError, same_length, setting};
use super::geometry::{Centroid, ImageSize, PixelSize};

/// How images are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferenceSettings {
    /// Size of the images.
    pub size: ImageSize,
    /// What a pixel covers of the sensor's surface.
    pub pixel: PixelSize,
    /// A pixel is in contact where its difference is greater than this, in levels; 0 to 255.
    pub threshold: f32,
    /// The box reaches so many pixels to each side; 0: no blur.
    pub blur_radius: usize,
}

/// What one image says about the contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferenceReport {
    /// Pixels in contact.
    pub pixels: usize,
    /// Their area in mm^2.
    pub area_mm2: f64,
    /// The mean of their places; `None` without a contact.
    pub centroid: Option<Centroid>,
}

/// Compares one image after another with a reference.
#[derive(Clone, Debug, PartialEq)]
pub struct DifferenceBaseline {
    settings: DifferenceSettings,
    reference: Vec<u8>,
    /// Sums of the differences of a pixel's channels over the box's part in its row.
    across: Vec<u32>,
    /// For each column, the sum of `across` over the box's rows.
    down: Vec<u32>,
    difference: Vec<f32>,
    mask: Vec<bool>,
}

impl DifferenceBaseline {
    /// Compares with `reference`, an interleaved RGB image without contact.
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
        // Beyond the image's sides a longer reach changes nothing.
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
                subtract(&mut self.down, &self.across[row * width..][..width]);
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

    /// The pixels (H, W) that were in contact in the last image.
    pub fn mask(&self) -> &[bool] {
        &self.mask
    }

    /// Fills `across`: a sum that runs along each row.
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

fn subtract(sums: &mut [u32], row: &[u32]) {
    sums.iter_mut().zip(row).for_each(|(sum, value)| *sum -= value);
}

/// How many of `length` places are within `reach` of `at`.
fn reached(at: usize, reach: usize, length: usize) -> usize {
    (at + reach + 1).min(length) - at.saturating_sub(reach)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{DifferenceBaseline, DifferenceSettings};
    use crate::systems::contact_area::{Centroid, ImageSize, PixelSize};

    fn settings(width: usize, height: usize, threshold: f32, blur_radius: usize) -> DifferenceSettings {
        let pixel = PixelSize::new(0.5, 0.25).unwrap();
        DifferenceSettings { size: ImageSize { width, height }, pixel, threshold, blur_radius }
    }

    #[test]
    fn without_a_blur_each_pixel_stands_for_itself() {
        let mut baseline = DifferenceBaseline::new(&[10; 12], settings(2, 2, 10.0, 0)).unwrap();
        // Differences of 10 (which does not exceed the threshold), 11, 0 and 40 levels.
        let report = baseline.measure(&[20, 0, 20, 43, 10, 10, 10, 10, 10, 50, 50, 50]).unwrap();
        assert_eq!(baseline.difference(), [10.0, 11.0, 0.0, 40.0]);
        assert_eq!(baseline.mask(), [false, true, false, true]);
        let centroid = Some(Centroid { x_px: 1.0, y_px: 0.5, x_mm: 0.5, y_mm: 0.125 });
        assert_eq!((report.pixels, report.area_mm2, report.centroid), (2, 0.25, centroid));
    }

    #[test]
    fn a_blur_spreads_a_difference_over_its_box() {
        let mut image = [0; 15];
        image[6..9].fill(90);
        let mut baseline = DifferenceBaseline::new(&[0; 15], settings(5, 1, 29.0, 1)).unwrap();
        let report = baseline.measure(&image).unwrap();
        assert_eq!(baseline.difference(), [0.0, 30.0, 30.0, 30.0, 0.0]);
        assert_eq!((report.pixels, report.centroid.map(|c| c.x_px)), (3, Some(2.0)));
    }

    #[test]
    fn at_the_border_the_box_is_cut() {
        let mut baseline = DifferenceBaseline::new(&[0; 12], settings(2, 2, 255.0, 1)).unwrap();
        baseline.measure(&[40, 40, 40, 0, 0, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        assert_eq!(baseline.difference(), [10.0; 4]);
    }

    #[test]
    fn the_reference_itself_is_no_contact() {
        let mut baseline = DifferenceBaseline::new(&[7; 12], settings(2, 2, 0.0, 9)).unwrap();
        let report = baseline.measure(&[7; 12]).unwrap();
        assert_eq!((report.pixels, report.area_mm2, report.centroid), (0, 0.0, None));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert!(DifferenceBaseline::new(&[0; 11], settings(2, 2, 1.0, 0)).is_err());
        assert!(DifferenceBaseline::new(&[], settings(0, 2, 1.0, 0)).is_err());
        assert!(DifferenceBaseline::new(&[], settings(usize::MAX, 2, 1.0, 0)).is_err());
        for threshold in [-1.0, 256.0, f32::NAN] {
            assert!(DifferenceBaseline::new(&[0; 12], settings(2, 2, threshold, 0)).is_err());
        }
        let mut baseline = DifferenceBaseline::new(&[0; 12], settings(2, 2, 1.0, 0)).unwrap();
        let error = baseline.measure(&[0; 13]).unwrap_err().to_string();
        assert_eq!(error, "image (3 bytes a pixel): expected 12 values, found 13");
    }

    proptest! {
        #[test]
        fn running_sums_have_the_bits_of_summing_every_box(
            (width, height, images) in (1_usize..8, 1_usize..8).prop_flat_map(|(w, h)| {
                (Just(w), Just(h), prop::collection::vec(any::<[u8; 2]>(), w * h * 3))
            }),
            radius in 0_usize..10,
        ) {
            let (image, reference): (Vec<u8>, Vec<u8>) = images.into_iter().map(<(u8, u8)>::from).unzip();
            let mut baseline =
                DifferenceBaseline::new(&reference, settings(width, height, 80.0, radius)).unwrap();
            // Nothing of an image before stays.
            baseline.measure(&reference).unwrap();
            let report = baseline.measure(&image).unwrap();
            let mut pixels = 0;
            for y in 0..height {
                for x in 0..width {
                    let mut values = Vec::new();
                    for v in (0..height).filter(|v| v.abs_diff(y) <= radius) {
                        for u in (0..width).filter(|u| u.abs_diff(x) <= radius) {
                            let at = (v * width + u) * 3;
                            values.extend((at..at + 3).map(|i| u32::from(image[i].abs_diff(reference[i]))));
                        }
                    }
                    let mean = (f64::from(values.iter().sum::<u32>()) / values.len() as f64) as f32;
                    prop_assert_eq!(baseline.difference()[y * width + x].to_bits(), mean.to_bits());
                    prop_assert_eq!(baseline.mask()[y * width + x], mean > 80.0);
                    pixels += usize::from(mean > 80.0);
                }
            }
            prop_assert_eq!(report.pixels, pixels);
        }
    }
}
