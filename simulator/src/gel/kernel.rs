//! How far a gel's surface moves under a uniform pressure on one pixel.
//!
//! | gel | displacement | source |
//! |---|---|---|
//! | half-space | in closed form | Love 1929; Johnson 1985, "Contact Mechanics", Eq. 3.25 |
//! | layer of thickness H bonded to a plate | that, and `(1 - nu^2) / (pi E H) * integral of (S(w) - 1) J0(w r / H) dw` times the area of the pixel | transfer function S: Bentall and Johnson 1968, "An elastic strip in plane rolling contact", section 2 |
//!
//! `S(w) = ((3 - 4 nu) sinh 2w - 2w) / ((3 - 4 nu) cosh 2w + 2 w^2 + 5 - 12 nu + 8 nu^2)`: 1 for
//! short waves, which do not reach the plate. The difference from the half-space is smooth, so that
//! the middle of a pixel stands for its area.

use std::f64::consts::PI;

use libm::{asinh, cosh, fabs, j0, sinh, sqrt};

use super::{Gel, Grid};

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
    // Steps that follow both S and the waves of J0.
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
