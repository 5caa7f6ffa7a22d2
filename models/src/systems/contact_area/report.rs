//! Enters: a map of forces. Leaves: where the contact is, how large, how strong, and its middle.
//!
//! With C the pixels whose force f exceeds the threshold: area = |C| times a pixel's area, total force = sum of f over C,
//! centroid = sum of f (x, y) over C / total force. Sums are in f64, in row-major order.

use super::error::{ContactError, same_length, setting};
use super::geometry::{Centroid, ImageSize, PixelSize};
use super::median::RunningMedian;

/// How a map of forces is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSettings {
    /// Size of the maps.
    pub size: ImageSize,
    /// What a pixel covers of the sensor's surface.
    pub pixel: PixelSize,
    /// A pixel is in contact where its force is greater than this, in N per pixel; at least 0.
    pub threshold_n: f32,
    /// Reports whose total forces the median is taken of; odd.
    pub median_window: usize,
}

impl ContactSettings {
    /// Threshold of the published network, in N per pixel.
    pub const THRESHOLD_N: f32 = 1e-4;
    /// Window of the published median.
    pub const MEDIAN_WINDOW: usize = 5;

    /// The published threshold and window for maps of this size.
    pub fn new(size: ImageSize, pixel: PixelSize) -> Self {
        Self { size, pixel, threshold_n: Self::THRESHOLD_N, median_window: Self::MEDIAN_WINDOW }
    }
}

/// What one map of forces says about the contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactReport {
    /// Pixels in contact.
    pub pixels: usize,
    /// Their area in mm^2.
    pub area_mm2: f64,
    /// The sum of their forces in N; 0 without a contact.
    pub force_n: f64,
    /// The median of the last total forces, this one included, in N ([`RunningMedian`]).
    pub median_force_n: f64,
    /// The mean of their places, weighted by force; `None` without a contact.
    pub centroid: Option<Centroid>,
}

/// Reads one map of forces after another.
///
/// ```
/// use meissner_models::systems::contact_area::{ContactMeter, ContactSettings, ImageSize, PixelSize};
///
/// let size = ImageSize { width: 3, height: 1 };
/// let mut meter = ContactMeter::new(ContactSettings::new(size, PixelSize::new(0.5, 0.5)?))?;
/// let report = meter.measure(&[0.0, 0.25, 0.75])?;
/// assert_eq!((report.pixels, report.area_mm2, report.force_n), (2, 0.5, 1.0));
/// assert_eq!(report.centroid.map(|c| (c.x_px, c.x_mm)), Some((1.75, 0.875)));
/// # Ok::<(), meissner_models::systems::contact_area::ContactError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ContactMeter {
    settings: ContactSettings,
    mask: Vec<bool>,
    median: RunningMedian,
}

impl ContactMeter {
    /// A meter that has seen nothing.
    ///
    /// # Errors
    /// [`ContactError::Setting`] where the size is empty or too large, the threshold negative or not finite, or the
    /// window even.
    pub fn new(settings: ContactSettings) -> Result<Self, ContactError> {
        let threshold = settings.threshold_n;
        let holds = threshold >= 0.0 && threshold.is_finite();
        setting("threshold (N per pixel)", "a number of at least 0", threshold.into(), holds)?;
        let median = RunningMedian::new(settings.median_window)?;
        Ok(Self { settings, mask: vec![false; settings.size.pixels()?], median })
    }

    /// Reads a map of forces (H, W) in N per pixel; O(pixels).
    ///
    /// # Errors
    /// [`ContactError::Length`] or [`ContactError::NotFinite`]; the meter is then as it was before.
    pub fn measure(&mut self, force: &[f32]) -> Result<ContactReport, ContactError> {
        let ImageSize { width, .. } = self.settings.size;
        same_length("map of forces", self.mask.len(), force.len())?;
        if let Some(at) = force.iter().position(|f| !f.is_finite()) {
            let (column, row) = (at % width, at / width);
            return Err(ContactError::NotFinite { what: "map of forces", column, row, found: force[at] });
        }
        let (mut pixels, mut total, mut x_sum, mut y_sum) = (0, 0.0, 0.0, 0.0);
        let rows = self.mask.chunks_exact_mut(width).zip(force.chunks_exact(width));
        for (y, (mask, forces)) in rows.enumerate() {
            for (x, (contact, &force)) in mask.iter_mut().zip(forces).enumerate() {
                *contact = force > self.settings.threshold_n;
                if *contact {
                    let force = f64::from(force);
                    pixels += 1;
                    total += force;
                    x_sum += force * x as f64;
                    y_sum += force * y as f64;
                }
            }
        }
        let pixel = self.settings.pixel;
        Ok(ContactReport {
            pixels,
            area_mm2: pixel.area_mm2(pixels),
            force_n: total,
            median_force_n: self.median.push(total),
            centroid: (pixels > 0).then(|| pixel.centroid(x_sum / total, y_sum / total)),
        })
    }

    /// The pixels (H, W) that were in contact in the last map.
    pub fn mask(&self) -> &[bool] {
        &self.mask
    }

    /// Forgets all maps.
    pub fn reset(&mut self) {
        self.mask.fill(false);
        self.median.reset();
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{ContactMeter, ContactReport, ContactSettings};
    use crate::systems::contact_area::{Centroid, ContactError, ImageSize, PixelSize};

    fn settings(width: usize, height: usize) -> ContactSettings {
        ContactSettings::new(ImageSize { width, height }, PixelSize::new(0.5, 0.25).unwrap())
    }

    fn meter(width: usize, height: usize) -> ContactMeter {
        ContactMeter::new(settings(width, height)).unwrap()
    }

    #[test]
    fn a_contact_is_counted_weighed_and_placed() {
        let mut meter = meter(3, 2);
        let report = meter.measure(&[0.0, 1.0, 0.0, -5.0, 1.0, 2.0]).unwrap();
        let expected = ContactReport {
            pixels: 3,
            area_mm2: 0.375,
            force_n: 4.0,
            median_force_n: 4.0,
            // (1 * 1 + 1 * 1 + 2 * 2) / 4 and (1 * 0 + 1 * 1 + 2 * 1) / 4.
            centroid: Some(Centroid { x_px: 1.5, y_px: 0.75, x_mm: 0.75, y_mm: 0.1875 }),
        };
        assert_eq!(report, expected);
        assert_eq!(meter.mask(), [false, true, false, false, true, true]);
    }

    #[test]
    fn a_force_at_the_threshold_is_no_contact() {
        let above = f32::from_bits(1e-4_f32.to_bits() + 1);
        let report = meter(2, 1).measure(&[1e-4, above]).unwrap();
        assert_eq!((report.pixels, report.force_n), (1, f64::from(above)));
    }

    #[test]
    fn without_a_contact_there_is_no_force_and_no_centroid() {
        let report = meter(2, 1).measure(&[1e-5, -1.0]).unwrap();
        assert_eq!((report.pixels, report.area_mm2, report.force_n, report.centroid), (0, 0.0, 0.0, None));
    }

    #[test]
    fn the_median_of_five_passes_over_an_outlier() {
        let mut meter = meter(1, 1);
        let medians = [1.0, 1.0, 50.0, 2.0, 2.0, 3.0].map(|f| meter.measure(&[f]).unwrap().median_force_n);
        assert_eq!(medians, [1.0, 1.0, 1.0, 1.5, 2.0, 2.0]);
        meter.reset();
        assert_eq!(meter.mask(), [false]);
        assert_eq!(meter.measure(&[9.0]).unwrap().median_force_n, 9.0);
    }

    #[test]
    fn a_map_that_is_refused_leaves_no_trace() {
        let mut meter = meter(2, 2);
        meter.measure(&[1.0, 0.0, 0.0, 0.0]).unwrap();
        let before = meter.clone();
        let error = meter.measure(&[2.0, 2.0, f32::NEG_INFINITY, 2.0]).unwrap_err().to_string();
        assert_eq!(error, "map of forces: expected finite values, found -inf at column 0, row 1");
        let error = meter.measure(&[2.0; 3]).unwrap_err();
        assert_eq!(error, ContactError::Length { what: "map of forces", expected: 4, found: 3 });
        assert_eq!(meter, before);
    }

    #[test]
    fn settings_that_mean_nothing_are_refused() {
        for threshold_n in [-1e-4, f32::NAN, f32::INFINITY] {
            assert!(ContactMeter::new(ContactSettings { threshold_n, ..settings(1, 1) }).is_err());
        }
        assert!(ContactMeter::new(ContactSettings { median_window: 4, ..settings(1, 1) }).is_err());
        for (width, height) in [(0, 4), (4, 0), (usize::MAX, 2), (1 << 11, (1 << 11) + 1)] {
            assert!(ContactMeter::new(settings(width, height)).is_err(), "{width} {height}");
        }
        for (x_mm, y_mm) in [(0.0, 1.0), (1.0, -1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
            assert!(PixelSize::new(x_mm, y_mm).is_err(), "{x_mm} {y_mm}");
        }
    }

    proptest! {
        #[test]
        fn the_report_has_the_bits_of_the_plain_sums(
            width in 1_usize..6,
            forces in prop::collection::vec(-1e-3_f32..1e-3, 6..30),
        ) {
            let height = forces.len() / width;
            let forces = &forces[..width * height];
            let report = meter(width, height).measure(forces).unwrap();
            let contact: Vec<usize> = (0..forces.len()).filter(|&at| forces[at] > 1e-4).collect();
            let sum = |weight: &dyn Fn(usize) -> usize| {
                contact.iter().map(|&at| f64::from(forces[at]) * weight(at) as f64).fold(0.0, |a, b| a + b)
            };
            let total = sum(&|_| 1);
            prop_assert_eq!((report.pixels, report.force_n.to_bits()), (contact.len(), total.to_bits()));
            let place = report.centroid.map(|c| (c.x_px, c.y_px));
            let expected = (sum(&|at| at % width) / total, sum(&|at| at / width) / total);
            prop_assert_eq!(place, (!contact.is_empty()).then_some(expected));
        }
    }
}
