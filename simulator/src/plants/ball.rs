//! A ball on a gel under a camera, which a controller moves.
//!
//! Input: motions of the ball. Output: pictures and the truth; equal for an equal seed.

use meissner_kernels::random::Random;

use crate::error::Result;
use crate::gel::{
    Contact, Drift, GelSensor, GelSolver, Grid, Indenter, Load, Placed, max_depth_share, picture_bytes,
};

/// Pixels of the picture for each pixel of the grid of contacts, along a side. A coarse grid is
/// enough because a ball is smooth.
const COARSENESS: usize = 4;
/// The ball stays within this share of the surface around its middle, along each side.
const WITHIN: f64 = 0.6;

/// A contact: the truth, or a network's reading of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BallContact {
    /// The force in newtons.
    pub force_n: f64,
    /// The contact's middle relative to that of the picture, in millimetres; `None` without
    /// contact.
    pub middle_mm: Option<[f64; 2]>,
}

/// A ball on a gel under a camera.
pub struct BallOnGel {
    sensor: GelSensor,
    solver: GelSolver,
    ball_mm: f64,
    size: [usize; 2],
    drift: Drift,
    random: Random,
    /// Depth of the ball, negative above the gel, and its position.
    depth_mm: f64,
    at_mm: [f64; 2],
    contact: Option<Contact>,
}

impl BallOnGel {
    /// A ball of radius `ball_mm` that touches the sensor's middle, and the picture at rest.
    ///
    /// # Errors
    /// As [`GelSolver::new`].
    pub fn new(sensor: &GelSensor, ball_mm: f64, size: [usize; 2], seed: u64) -> Result<(Self, Vec<u8>)> {
        let grid = grid(sensor, size);
        let mut random = Random::new(seed);
        let drift = Drift::drawn(&mut random);
        let at_rest = sensor.camera.picture(&grid, &vec![0.0; grid.pixels()], size, Some(&mut random))?;
        let solver = GelSolver::new(sensor.gel, grid)?;
        let (depth_mm, at_mm, contact) = (0.0, [0.0; 2], None);
        let plant = Self { sensor: *sensor, solver, ball_mm, size, drift, random, depth_mm, at_mm, contact };
        Ok((plant, picture_bytes(&at_rest, size, None)))
    }

    /// Moves the ball as far as possible, and returns the actual motion: deeper, along x, along y,
    /// in mm.
    ///
    /// # Errors
    /// As [`GelSolver::press`].
    pub fn move_by(&mut self, [deeper_mm, x_mm, y_mm]: [f64; 3]) -> Result<[f64; 3]> {
        let grid = self.solver.grid();
        let gel = self.sensor.gel;
        let deepest_mm = max_depth_share(gel.strain) * gel.thickness_mm;
        let depth_mm = (self.depth_mm + deeper_mm).clamp(-deepest_mm, deepest_mm);
        let reach = [grid.width, grid.height].map(|side| side as f64 * grid.pitch_mm * WITHIN / 2.0);
        let at_mm = [
            (self.at_mm[0] + x_mm).clamp(-reach[0], reach[0]),
            (self.at_mm[1] + y_mm).clamp(-reach[1], reach[1]),
        ];
        let moved = [depth_mm - self.depth_mm, at_mm[0] - self.at_mm[0], at_mm[1] - self.at_mm[1]];
        (self.depth_mm, self.at_mm) = (depth_mm, at_mm);
        let ball = Placed { at_mm, ..Placed::upright(Indenter::Ball { radius_mm: self.ball_mm }) };
        self.contact = if depth_mm > 0.0 {
            Some(self.solver.press(&ball.heights(&grid), Load::Depth(depth_mm))?)
        } else {
            None
        };
        Ok(moved)
    }

    /// The current truth.
    pub fn truth(&self) -> BallContact {
        let Some(contact) = &self.contact else { return BallContact::default() };
        BallContact { force_n: contact.force_n, middle_mm: (contact.force_n > 0.0).then_some(self.at_mm) }
    }

    /// The current picture of the camera: red, green and blue of each pixel, row by row.
    ///
    /// # Errors
    /// Never, once the plant exists.
    pub fn picture(&mut self) -> Result<Vec<u8>> {
        let grid = self.solver.grid();
        let flat;
        let displacement_mm = if let Some(contact) = &self.contact {
            &contact.displacement_mm
        } else {
            flat = vec![0.0; grid.pixels()];
            &flat
        };
        let levels = self.sensor.camera.picture(&grid, displacement_mm, self.size, Some(&mut self.random))?;
        Ok(picture_bytes(&levels, self.size, Some(&self.drift)))
    }
}

/// The depth in millimetres at which a ball presses on a gel like `sensor`'s with `force_n`.
///
/// # Errors
/// As [`GelSolver::press`].
pub fn ball_depth_mm(sensor: &GelSensor, ball_mm: f64, size: [usize; 2], force_n: f64) -> Result<f64> {
    let grid = grid(sensor, size);
    let ball = Placed::upright(Indenter::Ball { radius_mm: ball_mm });
    let contact = GelSolver::new(sensor.gel, grid)?.press(&ball.heights(&grid), Load::Force(force_n))?;
    Ok(contact.depth_mm)
}

/// The grid on which contacts are solved.
fn grid(sensor: &GelSensor, size: [usize; 2]) -> Grid {
    let [width, height] = size.map(|side| (side / COARSENESS).max(1));
    sensor.grid(width, height)
}
