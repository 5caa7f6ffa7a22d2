//! Presses into a simulated gel, as pictures with the force on each pixel.
//!
//! Input: a [`GelPlan`]. Output: pictures, the picture of the sensor at rest, maps of force.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use libm::sin;
use meissner_io::datasets::SlopeColours;
use meissner_kernels::random::Random;
use meissner_models::TensorFile;
use meissner_run::text::grouped;
use meissner_simulator::SimulatorError;
use meissner_simulator::gel::{
    Contact, Drift, GelCamera, GelSensor, GelSolver, Indenter, LETTERS, Lens, Load, MeasuredOptics, Placed,
    max_depth_share, picture_bytes,
};
use rayon::ThreadPool;
use rayon::prelude::*;
use serde_json::json;

use super::{Prepared, metadata};
use crate::error::Result;

/// Indenters of a set of presses. Flat ones are pressed parallel to the gel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shapes {
    /// Balls, cylinders, punches, blocks, cones, irregular bodies, polygons, wires, half of
    /// [`LETTERS`].
    Seen,
    /// Rings, edges, squares of balls, and the second half of [`LETTERS`]: nothing from
    /// [`Self::Seen`].
    Unseen,
    /// Pins with flat ends: a body that touches in several places. No other set has them.
    Pins,
    /// Plates of parallel ridges with round crests. No other set has them.
    Ridges,
    /// Flat blocks that reach beyond the picture along both sides.
    Larger,
    /// Flat rings that reach beyond the picture: everything except the hole presses.
    LargerUnseen,
    /// Five rounded bodies with waves, the same in every file, one after another. None of them is
    /// in [`Self::Seen`].
    Irregular,
}

/// Kinds of [`Shapes::Irregular`]: each body is one.
const IRREGULAR: [&str; 5] = ["body 1", "body 2", "body 3", "body 4", "body 5"];

/// The indenters, the sensor, and the number of presses.
#[derive(Clone, Copy, Debug)]
#[expect(missing_docs, reason = "the names say it")]
pub struct GelPlan<'a> {
    /// The sensor of all presses; `None`: another one for each press ([`GelSensor::drawn`]).
    pub sensor: Option<GelSensor>,
    /// Measured optics instead of the sensor's camera.
    pub optics: Option<&'a MeasuredOptics>,
    /// Width of the surface that the picture shows, in millimetres, instead of the sensor's.
    pub width_mm: Option<f64>,
    pub shapes: Shapes,
    pub presses: usize,
    /// Pictures of a press, at least 1.
    pub pictures: usize,
    /// Range of the greatest force of a press, in newtons. An indenter that reaches
    /// [`max_depth_share`] before presses less.
    pub force_n: [f64; 2],
    /// How often the force rises and falls linearly in a press; 0: once, as a squared sine.
    pub saw_teeth: usize,
    /// Width and height of a picture in pixels.
    pub size: [usize; 2],
    /// Pixels of the picture for each one of the grid of contacts, along a side: at least 1. With
    /// 2, a press takes a quarter of the time, and edges are as coarse as the grid.
    pub coarseness: usize,
    /// The seed of all random values.
    pub seed: u64,
}

impl GelPlan<'_> {
    /// The share of the greatest force in picture number `picture` of a press.
    fn share(&self, picture: usize) -> f64 {
        let done = (picture + 1) as f64 / (self.pictures + 1) as f64;
        if self.saw_teeth == 0 {
            let rise = sin(PI * done);
            return rise * rise;
        }
        let tooth = done * self.saw_teeth as f64;
        1.0 - (2.0 * (tooth - tooth.floor()) - 1.0).abs()
    }
}

/// Pictures of the presses of `plan`.
///
/// | tensor | type and shape | values |
/// |---|---|---|
/// | `picture` | U8 (pictures, H, W, 3) | red, green, blue |
/// | `force` | F32 (pictures, H, W) | normal force on the surface of each pixel, in N |
/// | `depth_mm` | F32 (pictures) | depth of the indenter |
/// | `start` | I64 (presses + 1) | the first picture of each press, and the number of pictures |
/// | `reference` | U8 (presses, H, W, 3) | the sensor at rest |
/// | `pixel_mm` | F32 (presses) | width of a pixel |
///
/// The metadata has the `indenters`. The threads of `pool` share the presses.
///
/// Complexity: a [`GelSolver::press`] for each picture; 0.1 s at 160 x 120, 0.7 s at 320 x 240.
///
/// # Errors
/// As [`GelSolver::press`]; never seen for shapes and forces of a plan.
pub fn gel_presses(plan: &GelPlan<'_>, pool: &ThreadPool) -> Result<Prepared, SimulatorError> {
    let [width, height] = plan.size;
    let presses: Vec<Press> =
        pool.install(|| (0..plan.presses).into_par_iter().map(|i| press(plan, i)).collect::<Result<_, _>>())?;
    let (mut pictures, mut forces, mut depths, mut references) = (vec![], vec![], vec![], vec![]);
    let (mut pixels, mut indenters) = (vec![], vec![]);
    for press in presses {
        pictures.extend(press.pictures);
        forces.extend(press.forces);
        depths.extend(press.depths);
        references.extend(press.reference);
        pixels.push(press.pixel_mm);
        indenters.push(press.indenter);
    }
    let count = depths.len();
    let start: Vec<_> = (0..=plan.presses).map(|i| (i * plan.pictures) as i64).collect();
    let mut file = TensorFile::new(metadata([("indenters", json!(indenters))]));
    file.u8("picture", &[count, height, width, 3], &pictures);
    file.f32("force", &[count, height, width], &forces);
    file.f32("depth_mm", &[count], &depths);
    file.i64("start", &[start.len()], &start);
    file.u8("reference", &[plan.presses, height, width, 3], &references);
    file.f32("pixel_mm", &[plan.presses], &pixels);
    let (count, presses) = (grouped(count as u64), grouped(plan.presses as u64));
    Ok(Prepared { file, contents: format!("{count} pictures of {presses} presses, {width} x {height}") })
}

struct Press {
    pictures: Vec<u8>,
    forces: Vec<f32>,
    depths: Vec<f32>,
    reference: Vec<u8>,
    pixel_mm: f32,
    indenter: &'static str,
}

fn press(plan: &GelPlan<'_>, i: usize) -> Result<Press, SimulatorError> {
    // Each press has its own sequence, so that presses can be computed in any order.
    let mut random = Random::new(Random::new(plan.seed ^ (i as u64) << 32).bits());
    let random = &mut random;
    let mut sensor = plan.sensor.unwrap_or_else(|| GelSensor::drawn(random));
    sensor.width_mm = plan.width_mm.unwrap_or(sensor.width_mm);
    if plan.optics.is_some() {
        sensor.camera.lens = Lens::default();
    }
    let [width, height] = plan.size.map(|side| (side / plan.coarseness).max(1));
    let grid = sensor.grid(width, height);
    let (indenter, name) = indenter(plan.shapes, i, random);
    let height_mm = grid.height as f64 * grid.pitch_mm;
    let at_mm = [sensor.width_mm, height_mm].map(|side| between(random, [-0.3, 0.3]) * side);
    let turn = TAU * random.uniform();
    let mut tilts = [(); 2].map(|()| between(random, [-0.04, 0.04]));
    if is_flat(&indenter) {
        tilts = [0.0; 2];
    }
    let heights = Placed { indenter, at_mm, turn, tilts }.heights(&grid);
    let mut solver = GelSolver::new(sensor.gel, grid)?;
    let most_n = between(random, plan.force_n);
    let peak = deepest(&mut solver, &heights, most_n)?;
    let drift = Drift::drawn(random);
    let shown = |displacement_mm: &[f64], random: &mut Random| match plan.optics {
        Some(optics) => optics.picture(&grid, displacement_mm, plan.size, Some(random)),
        None => sensor.camera.picture(&grid, displacement_mm, plan.size, Some(random)),
    };
    let reference = shown(&vec![0.0; grid.pixels()], random)?;
    let mut press = Press {
        pictures: Vec::new(),
        forces: Vec::new(),
        depths: Vec::new(),
        reference: picture_bytes(&reference, plan.size, None),
        pixel_mm: (sensor.width_mm / plan.size[0] as f64) as f32,
        indenter: name,
    };
    for picture in 0..plan.pictures {
        let contact = if plan.pictures == 1 {
            peak.clone()
        } else {
            solver.press(&heights, Load::Force(peak.force_n * plan.share(picture)))?
        };
        let seen = shown(&contact.displacement_mm, random)?;
        press.pictures.extend(picture_bytes(&seen, plan.size, Some(&drift)));
        let forces = sensor.camera.lens.forces(&grid, &contact.pressure_mpa, plan.size);
        press.forces.extend(forces.iter().map(|&force| force as f32));
        press.depths.push(contact.depth_mm as f32);
    }
    Ok(press)
}

/// The optics `name` in the archive at `path` ([`SlopeColours::read`]), with the noise of the
/// fitted sensor, because the table has none.
///
/// # Errors
/// The archive cannot be read, or it contains no optics.
pub fn measured_optics(path: &Path, name: &str) -> Result<MeasuredOptics> {
    let SlopeColours { bins, table } = SlopeColours::read(path, name)?;
    Ok(MeasuredOptics::new(table, bins, GelCamera::default().noise)?)
}

/// The contact at this force, or at the greatest depth if that comes first.
fn deepest(solver: &mut GelSolver, heights: &[f64], force_n: f64) -> Result<Contact, SimulatorError> {
    let deepest_mm = max_depth_share(solver.gel().strain) * solver.gel().thickness_mm;
    let contact = solver.press(heights, Load::Depth(deepest_mm))?;
    if contact.force_n <= force_n { Ok(contact) } else { solver.press(heights, Load::Force(force_n)) }
}

/// Whether the underside is flat: such an indenter is pressed parallel to the gel.
fn is_flat(indenter: &Indenter) -> bool {
    use Indenter::{Block, Letter, Polygon, Punch, Ring};
    matches!(indenter, Block { .. } | Letter { .. } | Polygon { .. } | Punch { .. } | Ring { .. })
}

/// The indenter of press number `i`, and the name of its kind. Lengths are in millimetres.
fn indenter(shapes: Shapes, i: usize, random: &mut Random) -> (Indenter, &'static str) {
    let seed = random.bits();
    let mut draw = |low: f64, high: f64| between(random, [low, high]);
    let mut letter = |half: usize| {
        let index = half * LETTERS.len() / 2 + (seed % (LETTERS.len() as u64 / 2)) as usize;
        let letter = LETTERS.as_bytes()[index] as char;
        (Indenter::Letter { letter, size_mm: draw(5.0, 14.0) }, "letter")
    };
    let kinds = match shapes {
        Shapes::Seen => 9,
        Shapes::Unseen => 4,
        Shapes::Pins | Shapes::Ridges | Shapes::Larger | Shapes::LargerUnseen | Shapes::Irregular => 1,
    };
    // These bits are not used by the letter.
    let kind = (seed >> 32) % kinds;
    match (shapes, kind) {
        (Shapes::Seen, 0) => letter(0),
        (Shapes::Unseen, 0) => letter(1),
        (Shapes::Seen, 1) => (Indenter::Ball { radius_mm: draw(2.0, 12.0) }, "ball"),
        (Shapes::Seen, 2) => {
            (Indenter::Cylinder { radius_mm: draw(1.5, 8.0), length_mm: draw(3.0, 20.0) }, "cylinder")
        }
        (Shapes::Seen, 3) => (Indenter::Punch { radius_mm: draw(1.5, 9.0) }, "punch"),
        (Shapes::Seen, 4) => {
            (Indenter::Block { width_mm: draw(3.0, 22.0), length_mm: draw(3.0, 22.0) }, "block")
        }
        (Shapes::Seen, 5) => (Indenter::Cone { half_angle: draw(0.9, 1.4) }, "cone"),
        (Shapes::Seen, 6) => (Indenter::Polygon { seed, radius_mm: draw(3.0, 11.0) }, "polygon"),
        (Shapes::Seen, 7) => {
            let (radius_mm, bend_mm) = (draw(0.3, 2.0), draw(2.0, 12.0));
            (Indenter::Wire { radius_mm, bend_mm, arc: (draw(4.0, 16.0) / bend_mm).min(PI) }, "wire")
        }
        (Shapes::Seen, _) => (Indenter::Irregular { seed, radius_mm: draw(5.0, 20.0) }, "irregular"),
        (Shapes::Unseen, 1) => {
            let radius_mm = draw(2.5, 8.0);
            (Indenter::Ring { radius_mm, hole_mm: radius_mm * draw(0.4, 0.75) }, "ring")
        }
        (Shapes::Unseen, 2) => {
            (Indenter::Edge { half_angle: draw(0.7, 1.4), length_mm: draw(4.0, 18.0) }, "edge")
        }
        (Shapes::Unseen, _) => {
            let (radius_mm, spacing_mm) = (draw(0.6, 2.0), draw(2.4, 4.5));
            (Indenter::Dots { radius_mm, spacing_mm, side: 2 + (seed >> 8) as u8 % 3 }, "dots")
        }
        (Shapes::Pins, _) => (Indenter::Pins { seed, radius_mm: draw(2.0, 9.0) }, "pins"),
        (Shapes::Ridges, _) => (Indenter::Ridges { seed, radius_mm: draw(2.0, 11.0) }, "ridges"),
        (Shapes::Larger, _) => {
            (Indenter::Block { width_mm: draw(40.0, 60.0), length_mm: draw(40.0, 60.0) }, "larger block")
        }
        (Shapes::LargerUnseen, _) => {
            (Indenter::Ring { radius_mm: 40.0, hole_mm: draw(1.5, 5.0) }, "larger ring")
        }
        (Shapes::Irregular, _) => {
            let body = i % IRREGULAR.len();
            // Fixed seeds: the seeds of the seen bodies are drawn.
            (Indenter::Irregular { seed: body as u64, radius_mm: 6.0 + 3.0 * body as f64 }, IRREGULAR[body])
        }
    }
}

fn between(random: &mut Random, [low, high]: [f64; 2]) -> f64 {
    low + random.uniform() * (high - low)
}

#[cfg(test)]
mod tests;
