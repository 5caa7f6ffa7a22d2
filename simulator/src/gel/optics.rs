//! Measured optics: the change of a pixel's colour with the slope of the gel's surface.
//!
//! A ball of known radius was pressed on a real sensor at many places. Each of its pixels shows a
//! slope. For bins of the slope's angle and direction, a quadratic in the place of the pixel was
//! fitted to the change of its colour (Si and Yuan 2022, "Taxim: An Example-Based Simulation Model
//! for `GelSight` Tactile Sensors", section III). In this direction the surface rises towards the
//! camera; it is measured from columns to rows.
//!
//! A flat surface shows no change. The fits of the flattest bins have few pixels and differ by
//! direction, so that up to [`FLAT`] the table's change at zero slope is subtracted. Between bins
//! the table is linear.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use libm::{atan, atan2, sqrt};
use meissner_kernels::random::Random;

use super::Grid;
use super::picture::{noisy, slopes};
use crate::error::{Result, SimulatorError, setting};

/// Columns and rows of the pictures that the quadratics were fitted in.
const FITTED: [f64; 2] = [640.0, 480.0];
/// Terms of a quadratic: x^2, y^2, x y, x, y, 1.
const TERMS: usize = 6;
/// The angle in radians from which the table is used without correction: about 7 degrees.
const FLAT: f64 = 0.12;
/// Grey level of a pixel at rest: networks see differences from it.
const REST: f64 = 128.0;
/// Maximum change in grey levels, because quadratics exceed it in the corners.
const MAX_CHANGE: f64 = 120.0;

/// The optics of a real sensor, from a table of quadratics.
#[derive(Clone, Debug)]
pub struct MeasuredOptics {
    /// (3 colours, bins of the angle 0 to pi/2, bins of the direction -pi to pi, terms).
    table: Vec<f32>,
    bins: usize,
    /// Standard deviation of a grey level.
    noise: f64,
}

impl MeasuredOptics {
    /// The optics of a `table` of the shape (3, bins, bins, 6).
    ///
    /// # Errors
    /// [`SimulatorError::Setting`] if there are fewer than 2 bins, another number of values, or
    /// values that are not finite, or if the noise is negative.
    pub fn new(table: Vec<f32>, bins: usize, noise: f64) -> Result<Self> {
        setting("bins", "at least 2", bins as f64, bins >= 2)?;
        setting(
            "values of optics",
            "3 x bins x bins x 6",
            table.len() as f64,
            table.len() == 3 * bins * bins * TERMS,
        )?;
        if let Some(&found) = table.iter().find(|value| !value.is_finite()) {
            return Err(SimulatorError::Setting {
                name: "optics",
                expected: "finite values",
                found: found.into(),
            });
        }
        setting("noise", "at least 0", noise, noise >= 0.0)?;
        Ok(Self { table, bins, noise })
    }

    /// Red, green and blue of each pixel of a picture of this `size`, as
    /// [`GelCamera::picture`](super::GelCamera::picture), about a grey of 128 at rest. O(pixels).
    ///
    /// # Errors
    /// [`SimulatorError::Pixels`] if there is not one displacement for each pixel of `surface`.
    pub fn picture(
        &self,
        surface: &Grid,
        displacement_mm: &[f64],
        size: [usize; 2],
        mut random: Option<&mut Random>,
    ) -> Result<Vec<[f32; 3]>> {
        let slopes = slopes(surface, displacement_mm)?;
        let [width, height] = size.map(|side| side as f64);
        let level = |i: usize| {
            let pixel = [(i % size[0]) as f64 + 0.5, (i / size[0]) as f64 + 0.5];
            let place = [
                pixel[0] * surface.width as f64 / width - 0.5,
                pixel[1] * surface.height as f64 / height - 0.5,
            ];
            let slope = [0, 1].map(|axis| surface.between(place, |i| slopes[i][axis]));
            let fitted = [pixel[0] * FITTED[0] / width - 0.5, pixel[1] * FITTED[1] / height - 0.5];
            let level = self.change(slope, fitted).map(|change| REST + change.clamp(-MAX_CHANGE, MAX_CHANGE));
            noisy(level, self.noise, random.as_deref_mut())
        };
        Ok((0..size[0] * size[1]).map(level).collect())
    }

    /// The change of red, green and blue where the surface rises by `slope` along columns and rows,
    /// at a position in the fitted pictures.
    fn change(&self, [along_x, along_y]: [f64; 2], [x, y]: [f64; 2]) -> [f64; 3] {
        let angle = atan(sqrt(along_x * along_x + along_y * along_y));
        let direction = atan2(along_y, along_x);
        let last = (self.bins - 1) as f64;
        let (angle_bin, direction_bin) = (angle / FRAC_PI_2 * last, (direction + PI) / TAU * last);
        let terms = [x * x, y * y, x * y, x, y, 1.0];
        let grid = Grid { width: self.bins, height: self.bins, pitch_mm: 1.0 };
        let flat = (1.0 - angle / FLAT).max(0.0);
        [0, 1, 2].map(|colour| {
            let value = |bin: usize| {
                let first = (colour * self.bins * self.bins + bin) * TERMS;
                let quadratic = &self.table[first..first + TERMS];
                terms.iter().zip(quadratic).map(|(term, factor)| term * f64::from(*factor)).sum::<f64>()
            };
            let steep = grid.between([direction_bin, angle_bin], value);
            if flat > 0.0 { steep - flat * grid.between([direction_bin, 0.0], value) } else { steep }
        })
    }
}
