//! The lens of the camera behind a gel.

use libm::{ceil, exp};

use super::Grid;

/// How a lens changes a picture. The default changes nothing. Distances `r` are from the middle of
/// the picture, in half widths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lens {
    /// Radial distortion k: a pixel at `r` shows the surface at `r (1 + k r^2)` (Brown 1966,
    /// "Decentering distortion of lenses", first radial term). Above 0 straight lines bulge
    /// inwards, as a barrel does not.
    pub distortion: f64,
    /// Share of the light that is missing at `r = 1`; it grows with `r^2`.
    pub vignetting: f64,
    /// Standard deviation of the blur, in widths of the picture.
    pub blur: f64,
}

impl Lens {
    /// The place on the surface (column, row) that pixel number `i` of a picture of this size
    /// shows, and the share of the light that passes.
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
    /// in newtons where the pressure is in megapascals. O(pixels).
    ///
    /// # Panics
    /// Where there is not a pressure for each pixel of `surface`.
    pub fn forces(&self, surface: &Grid, pressure_mpa: &[f64], size: [usize; 2]) -> Vec<f64> {
        assert_eq!(pressure_mpa.len(), surface.pixels(), "a pressure for each pixel");
        let side_mm = surface.pitch_mm * surface.width as f64 / size[0] as f64;
        let force = |i: usize| {
            let [x, y] = offset(size, i);
            let bent = self.distortion * (x * x + y * y);
            // The determinant of the derivative of the place.
            let area = side_mm * side_mm * (1.0 + bent) * (1.0 + 3.0 * bent);
            area * surface.between(self.pixel(surface, size, i).0, |i| pressure_mpa[i])
        };
        (0..size[0] * size[1]).map(force).collect()
    }

    /// Blurs grey levels along rows, then along columns, by a Gaussian that is cut at three
    /// deviations. O(pixels x blur).
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
