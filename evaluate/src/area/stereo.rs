//! Contacts without a network: depth by photometric stereo, and a force in proportion to it.
//!
//! The slopes of the surface are a regression on the difference of a pixel's colours from the
//! sensor at rest, instead of the usual table of colours (Yuan, Dong and Adelson 2017, "`GelSight`:
//! High-resolution robot tactile sensors for estimating geometry and force", section 3.2). It is
//! fitted to balls pressed into the simulated sensor, whatever sensor took the pictures.
//!
//! The depth z has the slopes p, q in the sense of least squares, and is 0 around the picture:
//! `laplace z = dp/dx + dq/dy` (Horn and Brooks 1986, "The variational approach to shape from
//! shading", section 4). On pixels, sines along the rows make it a tridiagonal system along the
//! columns for each wave (Hockney 1965, "A fast direct solution of Poisson's equation using Fourier
//! analysis", section 2; Simchony, Chellappa and Shao 1990, "Direct analytical methods for solving
//! Poisson equations in computer vision problems", section III).

use std::f64::consts::PI;

use meissner_kernels::random::Random;
use meissner_models::systems::contact_area::{ContactMeter, ContactSettings, ImageSize, PixelSize};
use meissner_run::RunError;
use meissner_simulator::SimulatorError;
use meissner_simulator::gel::{GelSensor, GelSolver, Grid, Indenter, Load, Placed, picture_bytes};
use ndarray::{Array1, Array2, Axis, Zip, concatenate};

use crate::area::baselines::{BaselineFigures, THRESHOLDS, favoured};
use crate::area::figures::{Found, Known};
use crate::area::pictures::Set;
use crate::error::Result;
use crate::fit::cholesky::{Factor, add_products, block};
use crate::workers::Workers;

/// Depths in millimetres that are tried as thresholds of contact.
const DEPTHS_MM: [f32; THRESHOLDS] = [0.02, 0.03, 0.04, 0.06, 0.08, 0.1, 0.13, 0.17, 0.22, 0.3, 0.4, 0.5];
/// Radii of the balls of the calibration, in millimetres.
const RADII_MM: [f64; 3] = [3.0, 6.0, 12.0];
/// Depths to which each ball is pressed, in millimetres.
const PRESSED_MM: [f64; 4] = [0.4, 0.8, 1.3, 1.8];
/// Pixels of the calibration: slopes do not depend on the size of a picture.
const SIZE: ImageSize = ImageSize { width: 80, height: 60 };
/// Weight of the squared coefficients, for each pixel.
const RIDGE: f64 = 1e-5;
/// Grey levels that are 1 in the regression.
const LEVELS: f64 = 64.0;
/// Terms of the regression.
const TERMS: usize = 37;

/// A calibrated sensor.
pub(super) struct Stereo {
    /// Weights of each term, for slopes along columns and rows.
    weights: [[f64; 2]; TERMS],
    /// Force for a volume between the surface at rest and in contact, for each of [`DEPTHS_MM`].
    newtons_per_mm3: [f64; THRESHOLDS],
}

/// A press of the calibration.
struct Sample {
    rgb: Vec<u8>,
    reference: Vec<u8>,
    force_n: f64,
    /// (terms + 2, terms + 2), lower triangle: products of the terms and the slopes.
    products: Array2<f64>,
}

impl Stereo {
    /// Presses of the calibration.
    pub(super) const PRESSES: usize = RADII_MM.len() * PRESSED_MM.len();

    /// Presses balls into the default sensor, on 80 x 60 pixels.
    ///
    /// # Errors
    /// Errors of the simulator, never seen for these presses; the caller wants to stop.
    pub(super) fn calibrated(workers: &Workers) -> Result<Self> {
        let sensor = GelSensor::default();
        let grid = sensor.grid(SIZE.width, SIZE.height);
        let solver = GelSolver::new(sensor.gel, grid)?;
        let presses: Vec<usize> = (0..Self::PRESSES).collect();
        let samples =
            workers.for_each(&solver, &presses, |solver, &press| Sample::of(press, &sensor, solver))?;
        let mut products = Array2::zeros((TERMS + 2, TERMS + 2));
        samples.iter().for_each(|sample| products += &sample.products);
        let mut weights = block(products.view(), TERMS..TERMS + 2, 0..TERMS).to_owned();
        let ridge = RIDGE * (samples.len() * grid.pixels()) as f64;
        let factor = Factor::new(block(products.view(), 0..TERMS, 0..TERMS).to_owned(), ridge);
        factor.expect("a ridge makes it positive definite").solve(&mut weights);
        let weights = std::array::from_fn(|term| [weights[[0, term]], weights[[1, term]]]);
        let mut stereo = Self { weights, newtons_per_mm3: [0.0; THRESHOLDS] };
        let of = |engine: &mut Engine, sample: &Sample| -> Result<_, RunError> {
            let depth = stereo.depth_mm(&engine.poisson, &sample.rgb, &sample.reference, grid.pitch_mm);
            DEPTHS_MM.iter().enumerate().map(|(i, _)| Ok(engine.meters[i].measure(&depth)?.force_n)).collect()
        };
        let sums: Vec<Vec<f64>> = workers.for_each(&Engine::new(SIZE)?, &samples, of)?;
        for (i, factor) in stereo.newtons_per_mm3.iter_mut().enumerate() {
            let volumes = sums.iter().map(|sums| sums[i] * grid.pitch_mm * grid.pitch_mm);
            let (mut along, mut squared) = (0.0, f64::MIN_POSITIVE);
            for (volume, sample) in volumes.zip(&samples) {
                along += volume * sample.force_n;
                squared += volume * volume;
            }
            *factor = along / squared;
        }
        Ok(stereo)
    }

    /// Figures of the contacts in a file of pictures.
    ///
    /// # Errors
    /// The pictures are too large; the caller wants to stop.
    pub(super) fn figures(&self, set: &Set, workers: &Workers) -> Result<BaselineFigures> {
        let engine = Engine::new(set.size)?;
        favoured(set, DEPTHS_MM, &engine, workers, |engine, press, pixel_mm| {
            let mut contacts: Vec<_> = DEPTHS_MM.iter().map(|_| Vec::new()).collect();
            for picture in &press.pictures {
                let known = Known::of(picture, pixel_mm, set.size.width);
                let depth = self.depth_mm(&engine.poisson, &picture.rgb, &press.reference, pixel_mm);
                let ways = engine.meters.iter_mut().zip(self.newtons_per_mm3).zip(&mut contacts);
                for ((meter, newtons_per_mm3), contacts) in ways {
                    let report = meter.measure(&depth)?;
                    let force_n = Some(newtons_per_mm3 * report.force_n * pixel_mm * pixel_mm);
                    let (mask, pixels, centroid) = (meter.mask(), report.pixels, report.centroid);
                    contacts.push(known.contact(&Found { mask, pixels, centroid, force_n }, pixel_mm)?);
                }
            }
            Ok(contacts)
        })
    }

    /// The depth on each pixel, in millimetres. O(pixels x width).
    fn depth_mm(&self, poisson: &Poisson, rgb: &[u8], reference: &[u8], pixel_mm: f64) -> Vec<f32> {
        let along = |terms: &[f64; TERMS], axis: usize| {
            terms.iter().zip(&self.weights).map(|(term, weights)| term * weights[axis]).sum::<f64>()
        };
        let size = poisson.size();
        let mut slopes = Array2::zeros((size.width * size.height, 2));
        for (mut slopes, terms) in slopes.rows_mut().into_iter().zip(terms(rgb, reference, size)) {
            [0, 1].into_iter().for_each(|axis| slopes[axis] = along(&terms, axis));
        }
        let depth = poisson.integral(&slopes);
        depth.iter().map(|&depth| (depth * pixel_mm) as f32).collect()
    }
}

impl Sample {
    fn of(press: usize, sensor: &GelSensor, solver: &mut GelSolver) -> Result<Self, SimulatorError> {
        let random = &mut Random::new(press as u64);
        let (grid, size) = (solver.grid(), [SIZE.width, SIZE.height]);
        let radius_mm = RADII_MM[press / PRESSED_MM.len()];
        let at_mm = size.map(|side| 0.5 * (random.uniform() - 0.5) * side as f64 * grid.pitch_mm);
        let ball = Placed { at_mm, ..Placed::upright(Indenter::Ball { radius_mm }) }.heights(&grid);
        let contact = solver.press(&ball, Load::Depth(PRESSED_MM[press % PRESSED_MM.len()]))?;
        // Without drift, because drift has little slope to learn from: a regression on both would
        // shrink.
        let mut picture = |displacement_mm: &[f64]| {
            let levels = sensor.camera.picture(&grid, displacement_mm, size, Some(random))?;
            Ok::<_, SimulatorError>(picture_bytes(&levels, size, None))
        };
        let (reference, rgb) = (picture(&vec![0.0; grid.pixels()])?, picture(&contact.displacement_mm)?);
        let terms: Vec<[f64; TERMS]> = terms(&rgb, &reference, SIZE).collect();
        let (terms, slopes) = (Array2::from(terms), slopes(&grid, &contact.displacement_mm));
        let columns = concatenate(Axis(1), &[terms.view(), slopes.view()]).expect("a row for each pixel");
        let mut products = Array2::zeros((TERMS + 2, TERMS + 2));
        add_products(&mut products, columns.view());
        Ok(Self { rgb, reference, force_n: contact.force_n, products })
    }
}

/// (pixels, 2): slopes along columns and rows, half the difference of the neighbours.
fn slopes(grid: &Grid, depth_mm: &[f64]) -> Array2<f64> {
    let at = |column: f64, row: f64| grid.between([column, row], |i| depth_mm[i]);
    Array2::from_shape_fn((grid.pixels(), 2), |(i, axis)| {
        let (column, row) = ((i % grid.width) as f64, (i / grid.width) as f64);
        let rise = match axis {
            0 => at(column + 1.0, row) - at(column - 1.0, row),
            _ => at(column, row + 1.0) - at(column, row - 1.0),
        };
        rise / (2.0 * grid.pitch_mm)
    })
}

/// The terms of each pixel: the differences of red, green and blue, their products of two and of
/// three, and the first two times column and row from -1 to 1.
fn terms(rgb: &[u8], reference: &[u8], size: ImageSize) -> impl Iterator<Item = [f64; TERMS]> {
    let pixels = rgb.chunks_exact(3).zip(reference.chunks_exact(3)).enumerate();
    pixels.map(move |(i, (now, rest))| {
        let [r, g, b] =
            [0, 1, 2].map(|channel| (f64::from(now[channel]) - f64::from(rest[channel])) / LEVELS);
        let from_middle = |index: usize, count: usize| (2 * index + 1) as f64 / count as f64 - 1.0;
        let (u, v) = (from_middle(i % size.width, size.width), from_middle(i / size.width, size.height));
        let plain = [r, g, b, r * r, r * g, r * b, g * g, g * b, b * b];
        let [.., rr, rg, rb, gg, gb, bb] = plain;
        let cubes = [rr * r, rr * g, rr * b, rg * g, rg * b, rb * b, gg * g, gg * b, gb * b, bb * b];
        let mut terms = [0.0; TERMS];
        let placed = plain.map(|term| term * u).into_iter().chain(plain.map(|term| term * v));
        let all = plain.into_iter().chain(placed).chain(cubes);
        terms.iter_mut().zip(all).for_each(|(term, value)| *term = value);
        terms
    })
}

/// An engine for pictures of one size.
#[derive(Clone)]
struct Engine {
    poisson: Poisson,
    /// One for each of [`DEPTHS_MM`]; they read a depth as if it were a force.
    meters: Vec<ContactMeter>,
}

impl Engine {
    fn new(size: ImageSize) -> Result<Self, RunError> {
        let settings = ContactSettings::new(size, PixelSize::new(1.0, 1.0)?);
        let meter = |threshold_n| ContactMeter::new(ContactSettings { threshold_n, ..settings });
        let meters = DEPTHS_MM.into_iter().map(meter).collect::<Result<_, _>>()?;
        Ok(Self { poisson: Poisson::new(size), meters })
    }
}

/// Integrates slopes on pictures of one size.
#[derive(Clone)]
struct Poisson {
    /// (width, width), orthogonal: sines that are 0 half a pixel outside the picture, a row each.
    sines: Array2<f64>,
    /// (height, width): divisors of each row of the tridiagonal systems.
    pivots: Array2<f64>,
}

impl Poisson {
    /// O(width^2 + pixels).
    fn new(ImageSize { width, height }: ImageSize) -> Self {
        let wave = |k: usize| PI * (k + 1) as f64 / width as f64;
        let sines = Array2::from_shape_fn((width, width), |(k, column)| {
            let share = if k + 1 == width { 1.0 } else { 2.0 };
            (share / width as f64).sqrt() * (wave(k) * (column as f64 + 0.5)).sin()
        });
        let mut pivots = Array2::zeros((height, width));
        for row in 0..height {
            // The value beyond a border is the negative of the value within.
            let borders = f64::from(u8::from(row == 0)) + f64::from(u8::from(row + 1 == height));
            for k in 0..width {
                let bend = 2.0 * (1.0 - wave(k).cos());
                let above = if row == 0 { 0.0 } else { 1.0 / pivots[[row - 1, k]] };
                pivots[[row, k]] = -2.0 - borders - bend - above;
            }
        }
        Self { sines, pivots }
    }

    fn size(&self) -> ImageSize {
        ImageSize { width: self.pivots.ncols(), height: self.pivots.nrows() }
    }

    /// (height, width): the depth that has these slopes (pixels, 2) and is 0 around the picture, in
    /// widths of a pixel. O(pixels x width).
    fn integral(&self, slopes: &Array2<f64>) -> Array2<f64> {
        let ImageSize { width, height } = self.size();
        let slope = |column: usize, row: usize, axis: usize| slopes[[row * width + column, axis]];
        let divergence = Array2::from_shape_fn((height, width), |(row, column)| {
            let (right, below) = ((column + 1).min(width - 1), (row + 1).min(height - 1));
            let along = slope(right, row, 0) - slope(column.saturating_sub(1), row, 0);
            (along + slope(column, below, 1) - slope(column, row.saturating_sub(1), 1)) / 2.0
        });
        let mut waves = divergence.dot(&self.sines.t());
        let mut last = Array1::zeros(width);
        for (mut row, pivots) in waves.rows_mut().into_iter().zip(self.pivots.rows()) {
            row -= &last;
            Zip::from(&mut last).and(&row).and(pivots).for_each(|last, &value, &pivot| *last = value / pivot);
        }
        last.fill(0.0);
        for (mut row, pivots) in waves.axis_iter_mut(Axis(0)).zip(self.pivots.rows()).rev() {
            Zip::from(&mut row).and(&mut last).and(pivots).for_each(|value, last, &pivot| {
                *value = (*value - *last) / pivot;
                *last = *value;
            });
        }
        waves.dot(&self.sines)
    }
}

#[cfg(test)]
mod tests;
