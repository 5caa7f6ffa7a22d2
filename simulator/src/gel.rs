//! A flat gel on a rigid plate, pressed by a rigid indenter of any shape.
//!
//! Input: the gel, a grid of pixels, the heights of the indenter, and a depth or a force. Output:
//! the pressure on each pixel, and the displaced surface.
//!
//! The surface moves by the convolution of the pressure with a kernel (`gel/response.rs`). The
//! contact has the one non-negative pressure for which gel and indenter touch wherever they press
//! and are apart elsewhere. Conjugate gradients on the pixels in contact find it (Polonsky and Keer
//! 1999, "A numerical method for solving rough contact problems based on the multi-level
//! multi-summation and conjugate gradient techniques", section 3), with products by FFT.
//!
//! A sideways shift is one of Cattaneo and Mindlin: the shear traction is the friction coefficient
//! times the difference of two pressures (Ciavarella 1998, "The generalized Cattaneo partial slip
//! plane contact problem", Eq. 16; Jaeger 1998). The gel relaxes by one Prony term.
//!
//! Under large pressures a gel gets stiffer ([`Strain::Logarithmic`]): a contact is then one of
//! small strains with heights that are bent like the surface.
//!
//! The model leaves out: adhesion; friction under the normal load; the coupling of shear and
//! pressure; the sides of the gel; the stiffening of the gel beside a strained place.
//!
//! ```
//! use meissner_simulator::gel::{Gel, GelCamera, GelSolver, Grid, Indenter, Load, Placed};
//!
//! let grid = Grid { width: 64, height: 48, pitch_mm: 0.2 };
//! let mut gel = GelSolver::new(Gel::default(), grid)?;
//! let ball = Placed::upright(Indenter::Ball { radius_mm: 4.0 }).heights(&grid);
//! let contact = gel.press(&ball, Load::Force(1.0))?;
//! assert!((contact.force_n - 1.0).abs() < 1e-9 && contact.depth_mm > 0.5);
//! let picture = GelCamera::default().picture(&grid, &contact.displacement_mm, [64, 48], None)?;
//! assert_eq!(picture.len(), 64 * 48);
//! # Ok::<(), meissner_simulator::SimulatorError>(())
//! ```

mod indenters;
mod optics;
mod picture;
mod response;

use crate::error::{Result, SimulatorError, setting};
pub use indenters::{Indenter, LETTERS, Placed};
pub use optics::MeasuredOptics;
pub use picture::GelSensor;
pub use picture::{Drift, GelCamera, Lens, Light, picture_bytes};
use response::Convolution;
pub use response::{Gel, Grid, Relaxation, Strain};

/// Greatest depth as a share of the thickness.
///
/// Beyond this depth, a gel of small strains is too soft, and a gel of logarithmic strains models a
/// material beyond its usual compression.
pub fn max_depth_share(strain: Strain) -> f64 {
    match strain {
        Strain::Small => 0.3,
        Strain::Logarithmic => 0.6,
    }
}

/// How an indenter is pressed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// The depth of its height 0 below the surface at rest, in millimetres.
    Depth(f64),
    /// The force of the indenter, in newtons.
    Force(f64),
}

/// A gel under an indenter. All fields are row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// Pressure in megapascals (N/mm^2); 0 where the indenter does not touch.
    pub pressure_mpa: Vec<f64>,
    /// Depth of the surface below its position at rest, in millimetres.
    pub displacement_mm: Vec<f64>,
    /// Sum of the pressure, in newtons.
    pub force_n: f64,
    /// Depth of the indenter's height 0 below the surface at rest, in millimetres.
    pub depth_mm: f64,
    /// Number of iterations of the search.
    pub iterations: usize,
}

/// A gel under an indenter that is shifted sideways.
#[derive(Clone, Debug, PartialEq)]
pub struct Slide {
    /// Shear traction along the shift in megapascals, row by row.
    pub traction_mpa: Vec<f64>,
    /// Whether the gel sticks to the indenter at each pixel, row by row; elsewhere in the contact
    /// it slips.
    pub sticks: Vec<bool>,
    /// Sum of the traction, in newtons.
    pub force_n: f64,
}

/// Change of the pressure in one iteration, relative to its sum, at which a contact is found.
const TOLERANCE: f64 = 1e-7;
/// Change of the depth, as a share of the thickness, at which a contact of large strains is found.
const DEPTH_TOLERANCE: f64 = 1e-6;
/// Maximum number of iterations; contacts on 320 x 240 pixels take 10 to 50.
const MAX_ITERATIONS: usize = 5000;

/// Finds contacts of a gel on a grid: O(pixels log pixels) for each iteration of a press.
#[derive(Clone)]
pub struct GelSolver {
    gel: Gel,
    grid: Grid,
    convolution: Convolution,
}

impl GelSolver {
    /// Prepares the kernel. O(pixels log pixels).
    ///
    /// # Errors
    /// [`SimulatorError::Setting`] if a setting is outside its range.
    pub fn new(gel: Gel, grid: Grid) -> Result<Self> {
        for (name, found) in [
            ("modulus_mpa", gel.modulus_mpa),
            ("thickness_mm", gel.thickness_mm),
            ("pitch_mm", grid.pitch_mm),
            ("width", grid.width as f64),
            ("height", grid.height as f64),
        ] {
            setting(name, "above 0", found, found > 0.0)?;
        }
        setting("poisson", "0 to 0.5", gel.poisson, (0.0..=0.5).contains(&gel.poisson))?;
        setting("friction", "at least 0", gel.friction, gel.friction >= 0.0)?;
        let kernel = response::Kernel::new(&gel, &grid);
        let convolution = Convolution::new(grid.width, grid.height, |column, row| kernel.at(column, row));
        Ok(Self { gel, grid, convolution })
    }

    /// The gel.
    pub fn gel(&self) -> Gel {
        self.gel
    }

    /// The pixels.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The movement under `pressure_mpa`, row by row, in millimetres. O(pixels log pixels).
    ///
    /// # Panics
    /// If there is not one pressure for each pixel.
    pub fn displacement(&mut self, pressure_mpa: &[f64]) -> Vec<f64> {
        let Gel { strain, thickness_mm, .. } = self.gel;
        let mut moved = self.convolution.apply(pressure_mpa);
        moved.iter_mut().for_each(|moved| *moved = strain.moved(thickness_mm, *moved));
        moved
    }

    /// The contact with an indenter of these heights in millimetres, row by row
    /// ([`Grid::heights`]). A height may be infinite where there is no indenter.
    ///
    /// # Errors
    /// [`SimulatorError::Pixels`] without a height for each pixel; [`SimulatorError::Setting`] if a
    /// height or the load is out of range; [`SimulatorError::NoContact`] if no contact is found.
    pub fn press(&mut self, heights_mm: &[f64], load: Load) -> Result<Contact> {
        self.check(heights_mm, load)?;
        let Gel { strain, thickness_mm, .. } = self.gel;
        if strain == Strain::Small || !thickness_mm.is_finite() {
            return self.touch(heights_mm, load, self.first_guess(heights_mm, load));
        }
        // The search with small strains finds the contact if each height is bent like the surface.
        let bent = |depth_mm: f64| -> Vec<f64> {
            let deepest = strain.linear(thickness_mm, depth_mm);
            heights_mm.iter().map(|height| deepest - strain.linear(thickness_mm, depth_mm - height)).collect()
        };
        match load {
            Load::Depth(depth_mm) => {
                setting("depth", "below the gel's thickness", depth_mm, depth_mm < thickness_mm)?;
                let (heights, load) = (bent(depth_mm), Load::Depth(strain.linear(thickness_mm, depth_mm)));
                self.touch(&heights, load, self.first_guess(&heights, load))
            }
            Load::Force(_) => {
                // The bending of the heights depends on the depth, which a force determines only
                // afterwards. The secant method finds the depth at which the contact's depth equals
                // the assumed one.
                let mut contact = self.touch(heights_mm, load, self.first_guess(heights_mm, load))?;
                let (mut assumed_mm, mut last, mut iterations) = (contact.depth_mm, None, contact.iterations);
                while iterations < MAX_ITERATIONS {
                    contact = self.touch(&bent(assumed_mm), load, contact.pressure_mpa)?;
                    iterations += contact.iterations;
                    let off_mm = contact.depth_mm - assumed_mm;
                    if off_mm.abs() <= DEPTH_TOLERANCE * thickness_mm {
                        return Ok(Contact { iterations, ..contact });
                    }
                    let next_mm = match last {
                        Some((before_mm, off_before)) if off_mm != off_before => {
                            assumed_mm - off_mm * (assumed_mm - before_mm) / (off_mm - off_before)
                        }
                        _ => contact.depth_mm,
                    };
                    last = Some((assumed_mm, off_mm));
                    assumed_mm =
                        if (0.0..thickness_mm).contains(&next_mm) { next_mm } else { contact.depth_mm };
                }
                Err(SimulatorError::NoContact { iterations })
            }
        }
    }

    /// The contact for small strains, from a guess of the pressure on. Surface and depth are bent.
    fn touch(&mut self, heights_mm: &[f64], load: Load, guess: Vec<f64>) -> Result<Contact> {
        let pixels = self.grid.pixels();
        let area = self.grid.pitch_mm * self.grid.pitch_mm;
        let mut pressure = guess;
        let (mut direction, mut last_norm, mut is_conjugate) = (vec![0.0; pixels], 1.0, false);
        for iterations in 0..MAX_ITERATIONS {
            let total: f64 = pressure.iter().sum();
            if total <= 0.0 {
                return match load {
                    Load::Force(force_n) if force_n > 0.0 => Err(SimulatorError::NoContact { iterations }),
                    Load::Force(_) => Ok(self.contact(pressure, 0.0, iterations)),
                    Load::Depth(depth_mm) => Ok(self.contact(pressure, depth_mm, iterations)),
                };
            }
            // The gap between indenter and gel, which is 0 in contact and positive elsewhere.
            let displacement = self.convolution.apply(&pressure);
            let mut gap: Vec<_> =
                displacement.iter().zip(heights_mm).map(|(moved, height)| moved + height).collect();
            let depth_mm = match load {
                Load::Depth(depth_mm) => depth_mm,
                Load::Force(_) => mean_where(&gap, &pressure),
            };
            gap.iter_mut().for_each(|gap| *gap -= depth_mm);

            let in_contact = |i: usize| pressure[i] > 0.0;
            let norm: f64 = (0..pixels).filter(|&i| in_contact(i)).map(|i| gap[i] * gap[i]).sum();
            let share = if is_conjugate { norm / last_norm } else { 0.0 };
            last_norm = norm.max(f64::MIN_POSITIVE);
            for (i, direction) in direction.iter_mut().enumerate() {
                *direction = if in_contact(i) { gap[i] + share * *direction } else { 0.0 };
            }
            let mut answer = self.convolution.apply(&direction);
            if let Load::Force(_) = load {
                let mean = mean_where(&answer, &pressure);
                answer.iter_mut().for_each(|answer| *answer -= mean);
            }
            let (mut along, mut against) = (0.0, 0.0);
            for i in (0..pixels).filter(|&i| in_contact(i)) {
                along += gap[i] * direction[i];
                against += answer[i] * direction[i];
            }
            let step = if against > 0.0 { along / against } else { 0.0 };

            let before = pressure.clone();
            for (pressure, direction) in pressure.iter_mut().zip(&direction) {
                *pressure = (*pressure - step * direction).max(0.0);
            }
            // Pixels where the indenter would be inside the gel are in contact, too: a new search
            // begins.
            is_conjugate = true;
            for i in 0..pixels {
                if pressure[i] == 0.0 && gap[i] < 0.0 {
                    is_conjugate = false;
                    pressure[i] = -step.max(0.0) * gap[i];
                }
            }
            if let Load::Force(force_n) = load {
                scale(&mut pressure, force_n / area);
            }
            let change: f64 =
                before.iter().zip(&pressure).map(|(before, after)| (after - before).abs()).sum();
            if change <= TOLERANCE * total && is_conjugate {
                return Ok(self.contact(pressure, depth_mm, iterations));
            }
        }
        Err(SimulatorError::NoContact { iterations: MAX_ITERATIONS })
    }

    /// The contact under this pressure, at the depth that small strains would have.
    fn contact(&mut self, pressure_mpa: Vec<f64>, linear_mm: f64, iterations: usize) -> Contact {
        let displacement_mm = self.displacement(&pressure_mpa);
        let depth_mm = self.gel.strain.moved(self.gel.thickness_mm, linear_mm);
        let force_n = pressure_mpa.iter().sum::<f64>() * self.grid.pitch_mm * self.grid.pitch_mm;
        Contact { pressure_mpa, displacement_mm, force_n, depth_mm, iterations }
    }

    fn check(&self, heights_mm: &[f64], load: Load) -> Result<()> {
        let (expected, found) = (self.grid.pixels(), heights_mm.len());
        if found != expected {
            return Err(SimulatorError::Pixels { expected, found });
        }
        if let Some(&found) =
            heights_mm.iter().find(|height| height.is_nan() || **height == f64::NEG_INFINITY)
        {
            return Err(SimulatorError::Setting { name: "height", expected: "above minus infinity", found });
        }
        match load {
            Load::Depth(depth_mm) => finite("depth", depth_mm),
            Load::Force(force_n) => finite("force", force_n),
        }
    }

    /// A pressure of the right size on the pixels where the indenter would be inside the gel, or on
    /// all pixels under it.
    fn first_guess(&self, heights_mm: &[f64], load: Load) -> Vec<f64> {
        let heights = heights_mm.iter();
        match load {
            Load::Depth(depth_mm) => {
                let stiffness = self.gel.modulus_mpa / self.gel.thickness_mm.min(10.0 * self.grid.pitch_mm);
                heights.map(|height| stiffness * (depth_mm - height).max(0.0)).collect()
            }
            Load::Force(force_n) => {
                let mut pressure =
                    heights.map(|height| f64::from(u8::from(height.is_finite()))).collect::<Vec<_>>();
                scale(&mut pressure, force_n / (self.grid.pitch_mm * self.grid.pitch_mm));
                pressure
            }
        }
    }

    /// Shifts the indenter, pressed to `contact`, sideways by `shift_mm`. O(one press).
    ///
    /// # Errors
    /// As [`GelSolver::press`]; [`SimulatorError::Setting`] where the shift is negative.
    pub fn slide(&mut self, heights_mm: &[f64], contact: &Contact, shift_mm: f64) -> Result<Slide> {
        finite("shift", shift_mm)?;
        let Gel { poisson, friction, .. } = self.gel;
        // Mindlin's ratio of the stiffness of a contact along its plane to that across it.
        let ratio = 2.0 * (1.0 - poisson) / (2.0 - poisson);
        let stuck_mm = if friction > 0.0 { contact.depth_mm - shift_mm * ratio / friction } else { 0.0 };
        let stuck = self.press(heights_mm, Load::Depth(stuck_mm.max(0.0)))?;
        let traction_mpa: Vec<_> = contact
            .pressure_mpa
            .iter()
            .zip(&stuck.pressure_mpa)
            .map(|(pressure, stuck)| friction * (pressure - stuck).max(0.0))
            .collect();
        let force_n = traction_mpa.iter().sum::<f64>() * self.grid.pitch_mm * self.grid.pitch_mm;
        Ok(Slide {
            sticks: stuck.pressure_mpa.iter().map(|&pressure| pressure > 0.0).collect(),
            traction_mpa,
            force_n,
        })
    }
}

/// Refuses a value that is negative or not finite.
fn finite(name: &'static str, found: f64) -> Result<()> {
    setting(name, "a finite number of at least 0", found, (0.0..f64::INFINITY).contains(&found))
}

fn mean_where(values: &[f64], pressure: &[f64]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for (value, _) in values.iter().zip(pressure).filter(|(_, pressure)| **pressure > 0.0) {
        sum += value;
        count += 1.0;
    }
    sum / count.max(1.0)
}

fn scale(pressure: &mut [f64], sum: f64) {
    let now: f64 = pressure.iter().sum();
    let factor = if now > 0.0 { sum / now } else { 0.0 };
    pressure.iter_mut().for_each(|pressure| *pressure *= factor);
}
