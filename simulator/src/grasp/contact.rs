//! The contact of a bolt with a pad over time: tabled pressures, and their relaxation.
//!
//! Contacts are solved at [`DEPTHS`] depths. Between them, a field is linear in depth. It is the
//! pressure where the bolt touches, and negative in proportion to the gap elsewhere, so that the
//! edge of a contact moves evenly from one depth to the next.

use meissner_engine::Sensor;

use crate::Result;
use crate::gel::{GelSolver, Grid, Load, Placed, Relaxation};

/// Depths of the table, including 0.
const DEPTHS: usize = 12;
/// Negative pressure per gap, in MPa/mm: it shapes the edge between depths.
const PULL_MPA_PER_MM: f64 = 0.05;
/// The elastic force of a table as a multiple of a grasp's, because relaxation takes a part of it.
const SPARE: f64 = 1.4;
/// Halvings of the interval of a depth.
const HALVINGS: usize = 40;

/// A pad under a bolt.
pub struct PressedPad {
    depths_mm: Vec<f64>,
    /// Pressure, or negative gap, of each pixel, for each depth.
    pressed: Vec<Vec<f64>>,
    /// Displacement of each pixel in millimetres, for each depth.
    displaced: Vec<Vec<f64>>,
    relaxes: (f64, f64),
    relaxation: Relaxation,
    lowest_mm: f64,
    /// Current fields.
    pressure_mpa: Vec<f64>,
    displacement_mm: Vec<f64>,
}

impl PressedPad {
    /// The pad under `bolt`, for forces up to `force_n`; `relaxes`: share, seconds.
    ///
    /// # Errors
    /// As [`GelSolver::press`].
    pub fn new(solver: &mut GelSolver, bolt: &Placed, relaxes: (f64, f64), force_n: f64) -> Result<Self> {
        let heights = bolt.heights(&PAD);
        let deepest = solver.press(&heights, Load::Force(SPARE * force_n))?.depth_mm;
        let lowest_mm = PAD.heights(|x, y| bolt.height(x, y)).into_iter().fold(f64::INFINITY, f64::min);
        let mut made = Self {
            depths_mm: Vec::new(),
            pressed: Vec::new(),
            displaced: Vec::new(),
            relaxes,
            relaxation: Relaxation::new(PAD.pixels(), relaxes.0, relaxes.1),
            lowest_mm,
            pressure_mpa: vec![0.0; PAD.pixels()],
            displacement_mm: vec![0.0; PAD.pixels()],
        };
        for i in 0..DEPTHS {
            // Closer together where the contact begins.
            let share = i as f64 / (DEPTHS - 1) as f64;
            let depth_mm = deepest * share * share;
            let contact = solver.press(&heights, Load::Depth(depth_mm))?;
            let fields = contact.pressure_mpa.iter().zip(&contact.displacement_mm).zip(&heights);
            let field = fields.map(|((&pressure, displacement), height)| {
                // Beside the bolt the gap is bounded, because no contact will come there.
                let gap = (height.min(2.0 * deepest) + displacement - depth_mm).max(0.0);
                if pressure > 0.0 { pressure } else { -PULL_MPA_PER_MM * gap }
            });
            made.pressed.push(field.collect());
            made.depths_mm.push(depth_mm);
            made.displaced.push(contact.displacement_mm);
        }
        Ok(made)
    }

    /// The height of the bolt's lowest point above the pad, in millimetres.
    pub fn lowest_mm(&self) -> f64 {
        self.lowest_mm
    }

    /// The greatest depth in the table, in millimetres.
    pub fn deepest_mm(&self) -> f64 {
        self.depths_mm[DEPTHS - 1]
    }

    /// The elastic force at a depth, in newtons.
    pub fn elastic_n(&self, depth_mm: f64) -> f64 {
        let (below, share) = self.split(depth_mm);
        let [low, high] = [&self.pressed[below], &self.pressed[below + 1]];
        let sum: f64 = low.iter().zip(high).map(|(low, high)| (low + share * (high - low)).max(0.0)).sum();
        if depth_mm > 0.0 { sum * PAD.pitch_mm * PAD.pitch_mm } else { 0.0 }
    }

    /// The greatest depth of a loading to `force_n`; `depths` gives the depths at each step for a
    /// greatest depth.
    pub fn depth_of<I: Iterator<Item = f64>>(&self, force_n: f64, depths: impl Fn(f64) -> I) -> f64 {
        let (mut low, mut high) = (0.0, self.deepest_mm());
        // While every pixel is loaded, the sum relaxes like each pixel.
        let table: Vec<f64> = (0..=TABLED).map(|i| self.elastic_n(high * i as f64 / TABLED as f64)).collect();
        let spacing = high / TABLED as f64;
        let elastic = |depth_mm: f64| {
            let at = (depth_mm / spacing).clamp(0.0, TABLED as f64);
            let below = (at as usize).min(TABLED - 1);
            table[below] + (at - below as f64) * (table[below + 1] - table[below])
        };
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            let mut relaxation = Relaxation::new(1, self.relaxes.0, self.relaxes.1);
            let seconds = STEP_US as f64 / 1e6;
            let force = depths(middle).map(|depth| relaxation.step(seconds, &[elastic(depth)])[0]).last();
            if force.unwrap_or(0.0) < force_n { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// Moves the bolt to a depth `seconds` later; below 0 it does not touch. O(pixels).
    pub fn press_to(&mut self, depth_mm: f64, seconds: f64) {
        let (below, share) = self.split(depth_mm);
        let touches = depth_mm > 0.0;
        let mixed = |fields: &[Vec<f64>], i: usize| {
            fields[below][i] + share * (fields[below + 1][i] - fields[below][i])
        };
        let elastic: Vec<f64> =
            (0..PAD.pixels()).map(|i| if touches { mixed(&self.pressed, i).max(0.0) } else { 0.0 }).collect();
        for (i, displacement) in self.displacement_mm.iter_mut().enumerate() {
            *displacement = if touches { mixed(&self.displaced, i) } else { 0.0 };
        }
        self.pressure_mpa = self.relaxation.step(seconds, &elastic);
    }

    /// Pressure of each pixel now, in megapascals.
    pub fn pressure_mpa(&self) -> &[f64] {
        &self.pressure_mpa
    }

    /// Displacement of each pixel now, in millimetres: that of the elastic pad at this depth.
    pub fn displacement_mm(&self) -> &[f64] {
        &self.displacement_mm
    }

    /// The force now, in newtons: the sum of the pressure.
    pub fn force_n(&self) -> f64 {
        self.pressure_mpa.iter().sum::<f64>() * PAD.pitch_mm * PAD.pitch_mm
    }

    /// The area with pressure now, in square millimetres.
    pub fn area_mm2(&self) -> f64 {
        let pixels = self.pressure_mpa.iter().filter(|&&pressure| pressure > 0.0).count();
        pixels as f64 * PAD.pitch_mm * PAD.pitch_mm
    }

    /// The entry of the table below a depth, and the share of the way to the next.
    fn split(&self, depth_mm: f64) -> (usize, f64) {
        let above = self.depths_mm.partition_point(|&known| known <= depth_mm).clamp(1, DEPTHS - 1);
        let [low, high] = [self.depths_mm[above - 1], self.depths_mm[above]];
        (above - 1, (depth_mm - low) / (high - low))
    }
}

/// Number of tabled forces for the search for a depth.
const TABLED: usize = 256;

/// The pixels of a pad's surface, on which contacts are solved.
pub const PAD: Grid = Grid { width: 48, height: 48, pitch_mm: 0.4 };
/// The part of the camera's picture that sees the pad: the crop of the published networks.
pub const SENSOR: Sensor = Sensor { width: 115, height: 115 };
/// Length of a recording: 41 frames of 10 ms.
pub const DURATION_US: i64 = 410_000;
/// Time from one picture and label to the next, in which an edge moves half a pixel at most.
pub const STEP_US: i64 = 2_000;
