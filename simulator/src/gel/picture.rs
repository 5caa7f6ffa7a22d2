//! Pictures of a gel's coated surface under coloured lights, as a camera behind the gel sees it.
//!
//! The surface bulges towards the camera where an indenter presses. A light adds its colour times
//! `(c + sqrt(c^2 + w^2)) / 2 / d^2` to a pixel: `c` is the cosine between the normal and the
//! direction of the light, `d` its distance, `w` its width, because a wide light sets little by
//! little behind a slope. A part of the surface that rises above the line to a light blocks some of
//! it: a cast shadow. The sum of the lights and an even light becomes grey levels by the power `1 /
//! gamma`. The [`Lens`] bends, darkens and blurs the picture.
//!
//! The model leaves out light that the surface reflects onto itself.

use libm::{ceil, exp, hypot, log, pow, sqrt};
use meissner_kernels::random::Random;

use crate::camera::normal_pair;
use crate::error::{Result, SimulatorError};
use crate::gel::{Gel, Grid, Strain};

/// A light beside a gel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Its column and row from the upper left corner, and height, in widths of the picture.
    pub place: [f64; 3],
    /// Its red, green and blue at a distance of one width.
    pub colour: [f64; 3],
}

/// Lights and camera of a sensor, fitted to a real one (`models/train/area/lights.py`).
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the names say it")]
pub struct GelCamera {
    pub lights: [Light; 3],
    /// Width of the lights, as a cosine.
    pub wide: f64,
    /// The share of a light that a cast shadow blocks; any value except 0 made the fit worse.
    pub shadow: f64,
    /// Red, green and blue of the light from all directions.
    pub even: [f64; 3],
    /// The power that converts grey levels to light.
    pub gamma: f64,
    pub lens: Lens,
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
            shadow: 0.0,
            even: [0.0051, 0.0248, 0.0456],
            gamma: 5.261,
            lens: Lens::default(),
            noise: 1.7,
        }
    }
}

impl GelCamera {
    /// Red, green and blue of each pixel of a picture of this `size`, row by row, from 0 to 255,
    /// with noise from `random` if there is one. The surface is `displacement_mm` towards the
    /// camera; its slopes are interpolated. O(pixels).
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
        let highest_mm = displacement_mm.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let surface = Surface { grid: surface, displacement_mm, highest_mm, slopes: &slopes };
        let level = |i: usize| {
            let (place, share) = self.lens.pixel(surface.grid, size, i);
            self.levels(&surface, place, share)
        };
        let mut levels: Vec<_> = (0..size[0] * size[1]).map(level).collect();
        self.lens.blur(size, &mut levels);
        Ok(levels.into_iter().map(|level| noisy(level, self.noise, random.as_deref_mut())).collect())
    }

    /// This camera for a picture on its side: if the surface is turned by a quarter from rows to
    /// columns, its picture is turned in the same way. `aspect` is the width of the picture over
    /// its height, before the turn.
    #[must_use]
    pub fn turned(&self, aspect: f64) -> Self {
        let lights = self.lights.map(|Light { place: [x, y, z], colour }| Light {
            place: [y * aspect, (1.0 - x) * aspect, z * aspect],
            colour: colour.map(|colour| colour * aspect * aspect),
        });
        Self { lights, ..*self }
    }

    /// The grey levels of the surface at a position (column, row); the lens passes a share of the
    /// light.
    fn levels(&self, surface: &Surface<'_>, [column, row]: [f64; 2], share: f64) -> [f64; 3] {
        let width = surface.grid.width as f64;
        let here = [column / width, row / width];
        let [along_x, along_y] =
            [0, 1].map(|axis| surface.grid.between([column, row], |i| surface.slopes[i][axis]));
        let mut light = self.even;
        for Light { place, colour } in self.lights {
            let to = [place[0] - here[0], place[1] - here[1], place[2]];
            let squared = to.iter().map(|part| part * part).sum::<f64>();
            let length = sqrt((1.0 + along_x * along_x + along_y * along_y) * squared);
            let cosine = (to[2] - along_x * to[0] - along_y * to[1]) / length;
            let mut part = (cosine + sqrt(cosine * cosine + self.wide * self.wide)) / (2.0 * squared);
            if self.shadow > 0.0 {
                part *= 1.0 - self.shadow * (1.0 - self.seen(surface, [column, row], to));
            }
            light.iter_mut().zip(colour).for_each(|(light, colour)| *light += part * colour);
        }
        light.map(|light| 255.0 * pow(share * light, 1.0 / self.gamma))
    }

    /// The share of a light, `to` widths away, that the surface does not hide. O(log side).
    fn seen(&self, surface: &Surface<'_>, [column, row]: [f64; 2], to: [f64; 3]) -> f64 {
        let Grid { width, height, pitch_mm } = *surface.grid;
        let away = hypot(to[0], to[1]);
        if away == 0.0 {
            return 1.0;
        }
        let (step_x, step_y) = (to[0] / away, to[1] / away);
        let here = surface.grid.between([column, row], |i| surface.displacement_mm[i]);
        let (rises, wide) = (to[2] / away, self.wide.max(1e-6));
        let (mut horizon, mut steps) = (0.0_f64, 1.0);
        // As long as a point at this distance can hide more of the light.
        while (surface.highest_mm - here) / (steps * pitch_mm) > horizon.max(rises - wide) {
            let place = [column + steps * step_x, row + steps * step_y];
            let is_outside = |place: f64, count: usize| !(0.0..=(count - 1) as f64).contains(&place);
            if is_outside(place[0], width) || is_outside(place[1], height) {
                break;
            }
            let rise = surface.grid.between(place, |i| surface.displacement_mm[i]) - here;
            horizon = horizon.max(rise / (steps * pitch_mm));
            steps = (steps + 1.0).max(1.25 * steps);
        }
        let share = |above: f64| (0.5 + above / (2.0 * wide)).clamp(0.0, 1.0);
        share(rises - horizon) / share(rises).max(1e-6)
    }
}

/// Red, green and blue with noise of this standard deviation, from 0 to 255.
pub(super) fn noisy(level: [f64; 3], deviation: f64, random: Option<&mut Random>) -> [f32; 3] {
    match random {
        None => level,
        Some(random) => {
            let [[red, green], [blue, _]] = [normal_pair(random), normal_pair(random)];
            [0, 1, 2].map(|channel| level[channel] + deviation * [red, green, blue][channel])
        }
    }
    .map(|level| level.clamp(0.0, 255.0) as f32)
}

/// A surface with its slopes, between pixels too.
struct Surface<'a> {
    grid: &'a Grid,
    displacement_mm: &'a [f64],
    highest_mm: f64,
    slopes: &'a [[f64; 2]],
}

/// The slopes along columns and rows at each pixel: half the difference of the neighbours within.
///
/// # Errors
/// [`SimulatorError::Pixels`] if there is not one displacement for each pixel.
pub(super) fn slopes(grid: &Grid, displacement_mm: &[f64]) -> Result<Vec<[f64; 2]>> {
    let (expected, found) = (grid.pixels(), displacement_mm.len());
    if found != expected {
        return Err(SimulatorError::Pixels { expected, found });
    }
    let at = |column: usize, row: usize| displacement_mm[row * grid.width + column];
    let slope = |index: usize, count: usize, at: &dyn Fn(usize) -> f64| {
        let (before, after) = (index.saturating_sub(1), (index + 1).min(count - 1));
        if before == after {
            0.0
        } else {
            (at(after) - at(before)) / ((after - before) as f64 * grid.pitch_mm)
        }
    };
    let of = |i: usize| {
        let (column, row) = (i % grid.width, i / grid.width);
        [
            slope(column, grid.width, &|column| at(column, row)),
            slope(row, grid.height, &|row| at(column, row)),
        ]
    };
    Ok((0..expected).map(of).collect())
}

/// Standard deviations of the drift of the light from the picture at rest, in grey levels, for each
/// term of a quadratic in the position from -1 to 1. They are from the 20 real pictures to which
/// the lights are fitted, away from contacts, and equal for terms of equal degree.
const DRIFT: [f64; 6] = [12.0, 12.0, 12.0, 7.0, 7.0, 7.0];

/// The change of the light since the picture at rest: a quadratic for each colour.
#[derive(Clone, Copy, Debug)]
pub struct Drift([[f64; 3]; 6]);

impl Drift {
    /// A random change as large as the changes of the real sensor.
    pub fn drawn(random: &mut Random) -> Self {
        Self(DRIFT.map(|deviation| [(); 3].map(|()| deviation * normal(random))))
    }

    /// The change of red, green and blue at a position from -1 to 1.
    fn at(&self, [u, v]: [f64; 2]) -> [f64; 3] {
        let terms = [1.0, u, v, u * u, u * v, v * v];
        [0, 1, 2].map(|channel| terms.iter().zip(&self.0).map(|(term, drift)| term * drift[channel]).sum())
    }
}

/// The bytes of a picture of this size in a drifted light: red, green, blue, row by row.
pub fn picture_bytes(levels: &[[f32; 3]], size: [usize; 2], drift: Option<&Drift>) -> Vec<u8> {
    let [width, height] = size.map(|side| side as f64);
    let pixels = levels.iter().enumerate().flat_map(|(pixel, level)| {
        let (column, row) = ((pixel % size[0]) as f64, (pixel / size[0]) as f64);
        let place = [2.0 * column / width - 1.0, 2.0 * row / height - 1.0];
        let drifted = drift.map_or([0.0; 3], |drift| drift.at(place));
        [0, 1, 2]
            .map(|channel| (f64::from(level[channel]) + drifted[channel]).round().clamp(0.0, 255.0) as u8)
    });
    pixels.collect()
}

/// Roughly normal: the sum of twelve uniform values minus six, with a variance of 1.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.uniform()).sum::<f64>() - 6.0
}

/// How a lens changes a picture. Distances `r` are from its middle, in half widths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lens {
    /// Radial distortion k: a pixel at `r` shows the surface at `r (1 + k r^2)` (Brown 1966,
    /// "Decentering distortion of lenses"). Above 0 straight lines bulge inwards.
    pub distortion: f64,
    /// Share of the light that is missing at `r = 1`; it grows with `r^2`.
    pub vignetting: f64,
    /// Standard deviation of the blur, in widths of the picture.
    pub blur: f64,
}

impl Lens {
    /// The position (column, row) that pixel `i` of a picture shows, and the share of its light.
    pub(super) fn pixel(&self, surface: &Grid, size: [usize; 2], i: usize) -> ([f64; 2], f64) {
        let [x, y] = offset(size, i);
        let squared = x * x + y * y;
        let stretch = 1.0 + self.distortion * squared;
        let half = surface.width as f64 / 2.0;
        let place = [(surface.width, x), (surface.height, y)]
            .map(|(count, offset)| (count - 1) as f64 / 2.0 + half * offset * stretch);
        (place, (1.0 - self.vignetting * squared).max(0.0))
    }

    /// The force on the surface that each pixel of a picture of this size shows, from the pressure:
    /// in newtons if the pressure is in megapascals. O(pixels).
    ///
    /// # Panics
    /// If there is not one pressure for each pixel of `surface`.
    pub fn forces(&self, surface: &Grid, pressure_mpa: &[f64], size: [usize; 2]) -> Vec<f64> {
        assert_eq!(pressure_mpa.len(), surface.pixels(), "a pressure for each pixel");
        let side_mm = surface.pitch_mm * surface.width as f64 / size[0] as f64;
        let force = |i: usize| {
            let [x, y] = offset(size, i);
            let bent = self.distortion * (x * x + y * y);
            // The determinant of the derivative of the position.
            let area = side_mm * side_mm * (1.0 + bent) * (1.0 + 3.0 * bent);
            area * surface.between(self.pixel(surface, size, i).0, |i| pressure_mpa[i])
        };
        (0..size[0] * size[1]).map(force).collect()
    }

    /// Blurs along rows, then columns, with a Gaussian that is cut at three deviations. O(pixels x
    /// blur).
    pub(super) fn blur(&self, size: [usize; 2], levels: &mut [[f64; 3]]) {
        let deviation = self.blur * size[0] as f64;
        if deviation <= 0.0 {
            return;
        }
        let reach = ceil(3.0 * deviation) as isize;
        let weight = |away: isize| exp(-0.5 * (away as f64 / deviation) * (away as f64 / deviation));
        let weights: Vec<_> = (-reach..=reach).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        let [width, height] = size.map(|side| side as isize);
        for (step_x, step_y) in [(1, 0), (0, 1)] {
            let sharp = levels.to_vec();
            for (i, level) in levels.iter_mut().enumerate() {
                let (column, row) = (i as isize % width, i as isize / width);
                *level = [0.0; 3];
                for (away, weight) in (-reach..=reach).zip(&weights) {
                    let column = (column + away * step_x).clamp(0, width - 1);
                    let row = (row + away * step_y).clamp(0, height - 1);
                    let from = sharp[(row * width + column) as usize];
                    level.iter_mut().zip(from).for_each(|(level, from)| *level += weight / sum * from);
                }
            }
        }
    }
}

/// Pixel number `i` from the middle of a picture of this size, in half widths.
fn offset([width, height]: [usize; 2], i: usize) -> [f64; 2] {
    let from_middle = |index: usize, count: usize| (2 * index) as f64 - (count - 1) as f64;
    [from_middle(i % width, width), from_middle(i / width, height)].map(|twice| twice / width as f64)
}

/// A gel with its camera. The default has the lights that were fitted to pictures of a real sensor,
/// turned for pictures that are wider than high.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the names say it")]
pub struct GelSensor {
    pub gel: Gel,
    pub camera: GelCamera,
    /// Width of the surface that the picture shows, in millimetres.
    pub width_mm: f64,
}

impl Default for GelSensor {
    fn default() -> Self {
        // The fitted pictures have 120 columns and 160 rows.
        let camera = GelCamera { lens: Lens { blur: 0.002, ..Lens::default() }, ..GelCamera::default() };
        let gel = Gel { strain: Strain::Logarithmic, ..Gel::default() };
        Self { gel, camera: camera.turned(120.0 / 160.0), width_mm: 19.2 }
    }
}

impl GelSensor {
    /// A second sensor of the same kind: a stiffer and thinner gel, lights of other strengths at
    /// other positions, a lens that bends and darkens, shadows, another scale. Each differs from
    /// the default by about as much as [`Self::drawn`] spreads it.
    pub fn second() -> Self {
        let mut sensor = Self::default();
        sensor.gel.modulus_mpa *= 1.12;
        sensor.gel.thickness_mm *= 0.9;
        sensor.width_mm *= 0.93;
        let camera = &mut sensor.camera;
        let strengths = [1.25, 0.8, 1.15];
        let moves = [[0.35, -0.3], [-0.3, -0.35], [0.3, 0.35]];
        for ((light, strength), [x, y]) in camera.lights.iter_mut().zip(strengths).zip(moves) {
            light.colour = light.colour.map(|colour| colour * strength);
            light.place[0] += x;
            light.place[1] += y;
            light.place[2] *= 1.15;
        }
        camera.shadow = 0.25;
        camera.lens = Lens { distortion: 0.04, vignetting: 0.15, blur: 0.003 };
        camera.noise = 2.2;
        sensor
    }

    /// A sensor of the same kind whose properties are spread about the default's.
    ///
    /// Normal, of the logarithm: modulus 0.12, thickness 0.1, width 0.07, the strength of each
    /// light 0.2, its height 0.15. Normal: the place of each light 0.3 widths. Uniform: shadow 0 to
    /// 0.5, distortion -0.06 to 0.06, vignetting 0 to 0.2, blur 0.001 to 0.004 widths, noise 1 to 3
    /// grey levels.
    pub fn drawn(random: &mut Random) -> Self {
        let mut sensor = Self::default();
        let spread = |value: f64, random: &mut Random, deviation: f64| {
            exp(log(value) + deviation * normal_pair(random)[0])
        };
        let Gel { modulus_mpa, thickness_mm, .. } = sensor.gel;
        sensor.gel.modulus_mpa = spread(modulus_mpa, random, 0.12);
        sensor.gel.thickness_mm = spread(thickness_mm, random, 0.1);
        sensor.width_mm = spread(sensor.width_mm, random, 0.07);
        let camera = &mut sensor.camera;
        for light in &mut camera.lights {
            let strength = spread(1.0, random, 0.2);
            light.colour = light.colour.map(|colour| colour * strength);
            let [x, y] = normal_pair(random);
            light.place[0] += 0.3 * x;
            light.place[1] += 0.3 * y;
            light.place[2] = spread(light.place[2], random, 0.15);
        }
        let mut between = |low: f64, high: f64| low + random.uniform() * (high - low);
        camera.shadow = between(0.0, 0.5);
        let (distortion, vignetting) = (between(-0.06, 0.06), between(0.0, 0.2));
        camera.lens = Lens { distortion, vignetting, blur: between(0.001, 0.004) };
        camera.noise = between(1.0, 3.0);
        sensor
    }

    /// The pixels of a picture of this size.
    pub fn grid(&self, width: usize, height: usize) -> Grid {
        Grid { width, height, pitch_mm: self.width_mm / width as f64 }
    }
}
