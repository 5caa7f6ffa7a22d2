//! The response of a gel to pressure: the movement of its surface under a uniform pressure on one
//! pixel, the convolution with that kernel, and the slow part of the response.
//!
//! A half-space moves according to Love 1929 (Johnson 1985, "Contact Mechanics", Eq. 3.25). A layer
//! of thickness H bonded to a plate adds `(1 - nu^2) / (pi E H) * integral of (S(w) - 1) J0(w r /
//! H) dw` times the area of the pixel, with the transfer function S of Bentall and Johnson 1968,
//! "An elastic strip in plane rolling contact", section 2.
//!
//! `S(w) = ((3 - 4 nu) sinh 2w - 2w) / ((3 - 4 nu) cosh 2w + 2 w^2 + 5 - 12 nu + 8 nu^2)`: 1 for
//! short waves, which do not reach the plate. The difference from the half-space is smooth, so that
//! its value at the middle of a pixel stands for the pixel's area. The transforms are rustfft's
//! scalar ones, so that the bits are the same on every machine.

use std::f64::consts::PI;
use std::sync::Arc;

use libm::{asinh, cosh, expm1, fabs, j0, log1p, sinh, sqrt};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlannerScalar};

/// The movement of a gel under large pressures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strain {
    /// In proportion to the pressure. A gel of finite thickness is too soft if it moves by a third
    /// of the thickness or more.
    #[default]
    Small,
    /// Logarithmic: a surface that would move by `w` moves by `H (1 - exp(-w / H))` in a gel of
    /// thickness H, which gets stiffer under compression and is never pressed through.
    ///
    /// A wide, thin layer of Hencky's material (Hencky 1928; Anand 1979, "On H. Hencky's
    /// approximate strain-energy function for moderate deformations"), whose stress is linear in
    /// the logarithm of the stretch, moves exactly like this. In all other cases the law is a
    /// model: it keeps the small-strain field of a point load, and bends each point separately.
    Logarithmic,
}

impl Strain {
    /// The movement of the surface of a layer of this thickness, if it would move by `linear_mm`
    /// under small strains.
    pub fn moved(self, thickness_mm: f64, linear_mm: f64) -> f64 {
        match self {
            Self::Logarithmic if thickness_mm.is_finite() => -thickness_mm * expm1(-linear_mm / thickness_mm),
            _ => linear_mm,
        }
    }

    /// The inverse of [`Self::moved`]: infinite for a layer that is pressed through.
    pub fn linear(self, thickness_mm: f64, moved_mm: f64) -> f64 {
        match self {
            Self::Logarithmic if thickness_mm.is_finite() => {
                if moved_mm < thickness_mm {
                    -thickness_mm * log1p(-moved_mm / thickness_mm)
                } else {
                    f64::INFINITY
                }
            }
            _ => moved_mm,
        }
    }
}

/// Material and thickness of a gel. The default is a soft silicone of 4 mm.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the names say it")]
pub struct Gel {
    /// Young's modulus, in megapascals.
    pub modulus_mpa: f64,
    /// Poisson's ratio, from 0 to 0.5.
    pub poisson: f64,
    /// Thickness above the plate that it is bonded to, in millimetres; infinite: a half-space.
    pub thickness_mm: f64,
    pub friction: f64,
    pub strain: Strain,
}

impl Default for Gel {
    fn default() -> Self {
        Self { modulus_mpa: 0.15, poisson: 0.48, thickness_mm: 4.0, friction: 0.8, strain: Strain::Small }
    }
}

/// Pixels of the gel's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the names say it")]
pub struct Grid {
    pub width: usize,
    pub height: usize,
    /// Distance between neighbours, in millimetres.
    pub pitch_mm: f64,
}

impl Grid {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// The position of the pixel in this column and row relative to the middle of the grid, in
    /// millimetres.
    pub fn place(&self, column: usize, row: usize) -> (f64, f64) {
        let from_middle =
            |index: usize, count: usize| (index as f64 - (count - 1) as f64 / 2.0) * self.pitch_mm;
        (from_middle(column, self.width), from_middle(row, self.height))
    }

    /// The value at a position (column, row), bilinear from the values `at` pixels; outside, the
    /// border's value.
    pub fn between(&self, [column, row]: [f64; 2], at: impl Fn(usize) -> f64) -> f64 {
        let split = |place: f64, count: usize| {
            let place = place.clamp(0.0, (count - 1) as f64);
            let before = (place as usize).min(count.saturating_sub(2));
            (before, (before + 1).min(count - 1), place - before as f64)
        };
        let (left, right, along) = split(column, self.width);
        let (above, below, down) = split(row, self.height);
        let in_row = |row: usize| {
            let (left, right) = (at(row * self.width + left), at(row * self.width + right));
            left + along * (right - left)
        };
        let (above, below) = (in_row(above), in_row(below));
        above + down * (below - above)
    }

    /// The heights of an indenter, row by row, from its height at a position in millimetres.
    pub fn heights(&self, height: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        let pixels =
            (0..self.height).flat_map(|row| (0..self.width).map(move |column| self.place(column, row)));
        pixels.map(|(x, y)| height(x, y)).collect()
    }
}

/// A kernel, and the plans of the transforms of `2 width` x `2 height` values.
#[derive(Clone)]
pub(super) struct Convolution {
    width: usize,
    height: usize,
    /// Rows and columns forward, then back.
    rows: [Arc<dyn Fft<f64>>; 2],
    columns: [Arc<dyn Fft<f64>>; 2],
    /// Transform of the kernel, column by column, divided by the number of values.
    kernel: Vec<f64>,
    by_rows: Vec<Complex<f64>>,
    by_columns: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

impl Convolution {
    /// `kernel` gives the value at a number of columns and rows from the middle, on either side.
    pub(super) fn new(width: usize, height: usize, kernel: impl Fn(usize, usize) -> f64) -> Self {
        let mut planner = FftPlannerScalar::new();
        let rows = [planner.plan_fft_forward(2 * width), planner.plan_fft_inverse(2 * width)];
        let columns = [planner.plan_fft_forward(2 * height), planner.plan_fft_inverse(2 * height)];
        let longest = rows.iter().chain(&columns).map(|fft| fft.get_inplace_scratch_len()).max().unwrap_or(0);
        let values = 4 * width * height;
        let zero = Complex::new(0.0, 0.0);
        let mut made = Self {
            width,
            height,
            rows,
            columns,
            kernel: Vec::new(),
            by_rows: vec![zero; values],
            by_columns: vec![zero; values],
            scratch: vec![zero; longest],
        };
        for (row, line) in made.by_rows.chunks_exact_mut(2 * width).enumerate() {
            for (column, value) in line.iter_mut().enumerate() {
                // The distance at `width` is never between two pixels.
                *value = Complex::new(kernel(column.min(2 * width - column), row.min(2 * height - row)), 0.0);
            }
        }
        made.forward(2 * height);
        // The kernel is symmetric, so that its transform is real.
        made.kernel = made.by_columns.iter().map(|value| value.re / values as f64).collect();
        made
    }

    /// The convolution of `picture`, row by row.
    pub(super) fn apply(&mut self, picture: &[f64]) -> Vec<f64> {
        let (width, height) = (self.width, self.height);
        assert_eq!(picture.len(), width * height, "a value for each pixel");
        self.by_rows.fill(Complex::new(0.0, 0.0));
        for (line, row) in self.by_rows.chunks_exact_mut(2 * width).zip(picture.chunks_exact(width)) {
            line.iter_mut().zip(row).for_each(|(value, &pixel)| value.re = pixel);
        }
        self.forward(height);
        self.by_columns.iter_mut().zip(&self.kernel).for_each(|(value, kernel)| *value *= kernel);
        let Self { rows, columns, by_rows, by_columns, scratch, .. } = self;
        columns[1].process_with_scratch(by_columns, scratch);
        // Only the rows of the picture are transformed back.
        let lines = &mut by_rows[..2 * width * height];
        for (row, line) in lines.chunks_exact_mut(2 * width).enumerate() {
            for (column, value) in line.iter_mut().enumerate() {
                *value = by_columns[column * 2 * height + row];
            }
        }
        rows[1].process_with_scratch(lines, scratch);
        lines.chunks_exact(2 * width).flat_map(|line| line[..width].iter().map(|value| value.re)).collect()
    }

    /// Transforms `by_rows` into `by_columns`; only its first `filled` rows are not zero.
    fn forward(&mut self, filled: usize) {
        let (width, height) = (2 * self.width, 2 * self.height);
        self.rows[0].process_with_scratch(&mut self.by_rows[..width * filled], &mut self.scratch);
        for (column, line) in self.by_columns.chunks_exact_mut(height).enumerate() {
            for (row, value) in line.iter_mut().enumerate() {
                *value = self.by_rows[row * width + column];
            }
        }
        self.columns[0].process_with_scratch(&mut self.by_columns, &mut self.scratch);
    }
}

/// The wave number from which S is 1 to the last bit, times the thickness.
const SHORT: f64 = 24.0;
/// Distances at which the difference from the half-space is tabled.
const TABLED: usize = 2048;

/// The kernel of a gel on a grid, in millimetres per megapascal.
pub(super) struct Kernel {
    /// `(1 - nu^2) / (pi E)`.
    compliance: f64,
    pitch_mm: f64,
    /// The layer's difference from the half-space at equally spaced distances; empty: a half-space.
    layer: Vec<f64>,
    /// Distance between them, in millimetres.
    spacing_mm: f64,
}

impl Kernel {
    pub(super) fn new(gel: &Gel, grid: &Grid) -> Self {
        let compliance = (1.0 - gel.poisson * gel.poisson) / (PI * gel.modulus_mpa);
        let (width, height) = (grid.width as f64, grid.height as f64);
        let farthest_mm = sqrt(width * width + height * height) * grid.pitch_mm;
        let spacing_mm = farthest_mm / (TABLED - 2) as f64;
        let scale = compliance / gel.thickness_mm * grid.pitch_mm * grid.pitch_mm;
        let difference = |i: usize| scale * layer(gel.poisson, i as f64 * spacing_mm / gel.thickness_mm);
        let layer =
            if gel.thickness_mm.is_finite() { (0..TABLED).map(difference).collect() } else { Vec::new() };
        Self { compliance, pitch_mm: grid.pitch_mm, layer, spacing_mm }
    }

    /// The displacement of a pixel so many columns and rows from the pressed one.
    pub(super) fn at(&self, columns: usize, rows: usize) -> f64 {
        let half = self.pitch_mm / 2.0;
        let (x, y) = (columns as f64 * self.pitch_mm, rows as f64 * self.pitch_mm);
        let half_space = corner(x + half, y + half) - corner(x + half, y - half) - corner(x - half, y + half)
            + corner(x - half, y - half);
        let half_space = self.compliance * half_space;
        if self.layer.is_empty() {
            return half_space;
        }
        let at = sqrt(x * x + y * y) / self.spacing_mm;
        let share = at - at.floor();
        let [below, above] = [0, 1].map(|next| self.layer[at as usize + next]);
        half_space + below + share * (above - below)
    }
}

/// A corner's part of Love's solution.
fn corner(x: f64, y: f64) -> f64 {
    x * asinh(y / fabs(x)) + y * asinh(x / fabs(y))
}

/// The integral of `(S(w) - 1) J0(w distance)`, by Simpson's rule.
fn layer(poisson: f64, distance: f64) -> f64 {
    // Enough steps to follow both S and the waves of J0.
    let steps = 2 * (SHORT * (20.0 + 4.0 * distance)) as usize;
    let width = SHORT / steps as f64;
    let value = |i: usize| {
        let w = i as f64 * width;
        (transfer(poisson, w) - 1.0) * j0(w * distance)
    };
    let inner: f64 = (1..steps).map(|i| if i % 2 == 1 { 4.0 * value(i) } else { 2.0 * value(i) }).sum();
    (value(0) + inner + value(steps)) * width / 3.0
}

/// S at the wave number `w` times the thickness.
fn transfer(nu: f64, w: f64) -> f64 {
    let above = (3.0 - 4.0 * nu) * sinh(2.0 * w) - 2.0 * w;
    let below = (3.0 - 4.0 * nu) * cosh(2.0 * w) + 2.0 * w * w + 5.0 - 12.0 * nu + 8.0 * nu * nu;
    above / below
}

/// The pressure of a gel with a partly relaxing stiffness, from elastic pressures.
///
/// `p(t) = (1 - share) e(t) + share * integral of exp(-(t - s) / time) de(s)`, with the elastic
/// pressure `e` linear between two steps (Fung 1981, "Biomechanics", section 7.6: quasi-linear
/// viscoelasticity). Where this is negative, the indenter has left the gel, and the pressure is 0.
/// The slow relaxation makes loading and unloading differ.
#[derive(Clone, Debug)]
pub struct Relaxation {
    share: f64,
    time_s: f64,
    /// The elastic pressure at the last step.
    elastic: Vec<f64>,
    /// The integral at the last step.
    memory: Vec<f64>,
}

impl Relaxation {
    /// A gel at rest; `share` (0 to 1) of its stiffness relaxes with the time constant `time_s`
    /// above 0.
    pub fn new(pixels: usize, share: f64, time_s: f64) -> Self {
        Self { share, time_s, elastic: vec![0.0; pixels], memory: vec![0.0; pixels] }
    }

    /// The pressure `seconds` after the last step, when the elastic one is `elastic`. O(pixels).
    ///
    /// # Panics
    /// If `elastic` has another number of pixels.
    pub fn step(&mut self, seconds: f64, elastic: &[f64]) -> Vec<f64> {
        assert_eq!(elastic.len(), self.elastic.len(), "a pressure for each pixel");
        let steps = seconds / self.time_s;
        let lost = -expm1(-steps);
        let kept = if steps > 0.0 { lost / steps } else { 1.0 };
        let memory = self.memory.iter_mut().zip(&mut self.elastic);
        let pressure = memory.zip(elastic).map(|((memory, before), &now)| {
            *memory += kept * (now - *before) - lost * *memory;
            *before = now;
            ((1.0 - self.share) * now + self.share * *memory).max(0.0)
        });
        pressure.collect()
    }
}
