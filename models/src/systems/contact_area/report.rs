//! Reads a map of forces: the pixels in contact, their area, force and centroid.
//!
//! C is the set of pixels whose force f exceeds the threshold: area = |C| times the area of a
//! pixel, total force = sum of f over C, centroid = sum of f (x, y) over C / total force; f64 sums,
//! row-major.

use std::collections::VecDeque;

use serde::Serialize;

use super::{Centroid, ContactError, ImageSize, PixelSize, same_length, setting};

/// Settings for reading maps of forces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSettings {
    /// Size of the maps.
    pub size: ImageSize,
    /// Size of a pixel on the surface of the sensor.
    pub pixel: PixelSize,
    /// A pixel is in contact if its force is greater than this, in N per pixel; at least 0.
    pub threshold_n: f32,
    /// Number of reports in the running median of total forces; odd.
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

/// The contact in one map of forces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ContactReport {
    /// Pixels in contact; not serialised.
    #[serde(skip)]
    pub pixels: usize,
    /// Area of these pixels in mm^2.
    pub area_mm2: f64,
    /// The sum of their forces in N; 0 without a contact.
    pub force_n: f64,
    /// The median of the last total forces, including this one, in N ([`RunningMedian`]).
    pub median_force_n: f64,
    /// Mean of their coordinates, weighted by force; `None` without a contact.
    pub centroid: Option<Centroid>,
}

/// Reads one map of forces after another.
///
/// ```
/// use meissner_models::systems::contact_area::{ContactMeter, ContactSettings};
/// use meissner_models::systems::contact_area::{ImageSize, PixelSize};
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
    /// A meter that has read no maps.
    ///
    /// # Errors
    /// [`ContactError::Setting`] for a bad size, a threshold negative or not finite, or an even
    /// window.
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
    /// [`ContactError::Length`] or [`ContactError::NotFinite`]; the meter is then unchanged.
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

    /// The pixels (H, W) in contact in the last map.
    pub fn mask(&self) -> &[bool] {
        &self.mask
    }

    /// Forgets all maps.
    pub fn reset(&mut self) {
        self.mask.fill(false);
        self.median.reset();
    }
}

/// The running median of an odd number of values.
///
/// Until the window is full, it is the median so far; of an even number, the mean of the middle two
/// (a / 2 + b / 2), by [`f64::total_cmp`]. O(window) per value, without allocation.
///
/// Invariant: `sorted` holds the values of `ring` in order.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningMedian {
    window: usize,
    /// The last values, in order of arrival.
    ring: VecDeque<f64>,
    sorted: Vec<f64>,
}

impl RunningMedian {
    /// A median over `window` values.
    ///
    /// # Errors
    /// [`ContactError::Setting`] if `window` is even (0 included) or above 65535.
    pub fn new(window: usize) -> Result<Self, ContactError> {
        let holds = window % 2 == 1 && window < 1 << 16;
        setting("window of the running median", "an odd number up to 65535", window as f64, holds)?;
        Ok(Self { window, ring: VecDeque::with_capacity(window), sorted: Vec::with_capacity(window) })
    }

    /// Takes the next value; returns the median of the last values, including this one.
    pub fn push(&mut self, value: f64) -> f64 {
        let place = |sorted: &[f64], value: f64| sorted.partition_point(|v| v.total_cmp(&value).is_lt());
        if self.ring.len() == self.window
            && let Some(left) = self.ring.pop_front()
        {
            self.sorted.remove(place(&self.sorted, left));
        }
        self.ring.push_back(value);
        self.sorted.insert(place(&self.sorted, value), value);
        let middle = self.sorted.len() / 2;
        match self.sorted.len() % 2 {
            1 => self.sorted[middle],
            _ => self.sorted[middle - 1] / 2.0 + self.sorted[middle] / 2.0,
        }
    }

    /// Forgets all values.
    pub fn reset(&mut self) {
        self.ring.clear();
        self.sorted.clear();
    }
}

/// Intersection over union of two masks; 1 if neither has a contact, because they agree.
///
/// # Errors
/// [`ContactError::Length`] if the masks differ in length.
pub fn iou(found: &[bool], truth: &[bool]) -> Result<f64, ContactError> {
    same_length("mask", truth.len(), found.len())?;
    let (mut both, mut either) = (0_usize, 0_usize);
    for (&a, &b) in found.iter().zip(truth) {
        both += usize::from(a & b);
        either += usize::from(a | b);
    }
    Ok(if either == 0 { 1.0 } else { both as f64 / either as f64 })
}

/// Mean absolute error of a map of forces, in its unit; summed in f64 in row-major order.
///
/// # Errors
/// [`ContactError::Length`] for maps of two lengths, [`ContactError::Setting`] for empty ones.
pub fn force_mae(found: &[f32], truth: &[f32]) -> Result<f64, ContactError> {
    same_length("map of forces", truth.len(), found.len())?;
    setting("pixels of a map of forces", "at least 1", 0.0, !truth.is_empty())?;
    let sum: f64 = found.iter().zip(truth).map(|(&a, &b)| (f64::from(a) - f64::from(b)).abs()).sum();
    Ok(sum / truth.len() as f64)
}
