//! Pictures of a gel's coated surface under coloured lights, as a camera behind the gel sees it.
//!
//! The surface bulges towards the camera where an indenter presses. A light adds its colour times
//! `(c + sqrt(c^2 + w^2)) / 2 / d^2` to a pixel: `c` is the cosine between the normal and the direction of the light, `d` its distance, `w`
//! its width, because a wide light sets little by little behind a slope. The sum of the lights and an even light becomes grey
//! levels by the power `1 / gamma`.
//!
//! Left out: shadows that one part of the surface casts on another; light that the surface reflects onto itself; the lens.

use libm::{pow, sqrt};
use meissner_models::random::Random;

use super::Grid;
use crate::camera::normal_pair;
use crate::error::SimulatorError;

/// A light beside a gel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Its place in widths of the picture: columns from the left border, rows from the upper one, and towards the camera.
    pub place: [f64; 3],
    /// Its red, green and blue at a distance of one width.
    pub colour: [f64; 3],
}

/// The lights and the camera of a sensor. The default is fitted to pictures of a real one (`train/area/lights.py`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GelCamera {
    /// The lights.
    pub lights: [Light; 3],
    /// How wide they are, as a cosine.
    pub wide: f64,
    /// Red, green and blue of light that comes from everywhere.
    pub even: [f64; 3],
    /// The power that makes light of grey levels.
    pub gamma: f64,
    /// Standard deviation of a grey level.
    pub noise: f64,
}

impl Default for GelCamera {
    fn default() -> Self {
        Self {
            lights: [
                Light { place: [-3.028, 0.071, 0.378], colour: [8.587, 0.524, 0.940] },
                Light { place: [0.597, 2.450, 0.138], colour: [0.095, 2.863, 0.375] },
                Light { place: [0.831, -2.719, 0.285], colour: [0.538, 0.091, 15.856] },
            ],
            wide: 0.0889,
            even: [0.0051, 0.0248, 0.0456],
            gamma: 5.261,
            noise: 1.7,
        }
    }
}

impl GelCamera {
    /// Red, green and blue of each pixel, row by row, in grey levels from 0 to 255, with noise from `random` if there is one. The
    /// surface is `displacement_mm` away from its place at rest, towards the camera ([`Contact::displacement_mm`](super::Contact::displacement_mm)). O(pixels).
    ///
    /// # Errors
    /// [`SimulatorError::Pixels`] where there is not a displacement for each pixel of `grid`.
    pub fn picture(
        &self,
        grid: &Grid,
        displacement_mm: &[f64],
        mut random: Option<&mut Random>,
    ) -> Result<Vec<[f32; 3]>, SimulatorError> {
        let (expected, found) = (grid.pixels(), displacement_mm.len());
        if found != expected {
            return Err(SimulatorError::Pixels { expected, found });
        }
        let pixel = |i: usize| {
            let (column, row) = (i % grid.width, i / grid.width);
            let level = self.levels(grid, column, row, slopes(grid, displacement_mm, column, row));
            match &mut random {
                None => level,
                Some(random) => {
                    let [[red, green], [blue, _]] = [normal_pair(random), normal_pair(random)];
                    [0, 1, 2].map(|channel| level[channel] + self.noise * [red, green, blue][channel])
                }
            }
            .map(|level| level.clamp(0.0, 255.0) as f32)
        };
        Ok((0..expected).map(pixel).collect())
    }

    /// The grey levels of a pixel whose surface rises by these slopes along columns and rows.
    fn levels(&self, grid: &Grid, column: usize, row: usize, [along_x, along_y]: [f64; 2]) -> [f64; 3] {
        let width = grid.width as f64;
        let here = [column as f64 / width, row as f64 / width];
        let mut light = self.even;
        for Light { place, colour } in self.lights {
            let to = [place[0] - here[0], place[1] - here[1], place[2]];
            let squared = to.iter().map(|part| part * part).sum::<f64>();
            let length = sqrt((1.0 + along_x * along_x + along_y * along_y) * squared);
            let cosine = (to[2] - along_x * to[0] - along_y * to[1]) / length;
            let part = (cosine + sqrt(cosine * cosine + self.wide * self.wide)) / (2.0 * squared);
            light.iter_mut().zip(colour).for_each(|(light, colour)| *light += part * colour);
        }
        light.map(|light| 255.0 * pow(light, 1.0 / self.gamma))
    }
}

/// The slopes of the surface along columns and rows: half the difference of the neighbours, at a border that of the pixel and its neighbour.
fn slopes(grid: &Grid, displacement_mm: &[f64], column: usize, row: usize) -> [f64; 2] {
    let at = |column: usize, row: usize| displacement_mm[row * grid.width + column];
    let slope = |index: usize, count: usize, at: &dyn Fn(usize) -> f64| {
        let (before, after) = (index.saturating_sub(1), (index + 1).min(count - 1));
        if before == after {
            0.0
        } else {
            (at(after) - at(before)) / ((after - before) as f64 * grid.pitch_mm)
        }
    };
    [slope(column, grid.width, &|column| at(column, row)), slope(row, grid.height, &|row| at(column, row))]
}
