//! Two transparent fingers grasp, hold and release a bolt; a camera sees one from within.
//!
//! Input: a plan of motion and light. Output: events, and force, depth and phase over time.
//!
//! A finger is a flat pad ([`PAD`]), 19.2 mm square and 4 mm thick; the other is its mirror image,
//! so that both press with the same force. The bolt is gripped on its smooth shank, a rigid
//! cylinder that may end within the pad. The motor moves the fingers. The force follows from the
//! contact (`grasp/contact.rs`), and the picture of the camera from the light (`grasp/view.rs`).
//!
//! | phase | motion |
//! |---|---|
//! | grasping | the bolt comes from a distance, touches, and is pressed to the greatest depth |
//! | holding | the depth stays, with a small vibration of depth and place; the force relaxes |
//! | releasing | the bolt leaves; the force is smaller than before at equal depth |
//!
//! The model leaves out: sliding, friction and the tilt of a bolt in the grip; the motor's
//! elasticity; large strains, for which silicone is stiffer.

mod contact;
mod view;

use std::f64::consts::{PI, TAU};

use libm::{cos, exp, log, sin};
use meissner_kernels::random::Random;

use crate::gel::{Gel, GelSolver, Indenter, Placed};
use crate::{Camera, CameraSettings, Result, SimulatedEvent};
pub use contact::{DURATION_US, PAD, PressedPad, SENSOR, STEP_US};
pub use view::Look;
use view::View;

/// The diameters of the bolts, in millimetres.
pub const BOLTS_MM: [f64; 3] = [8.0, 12.0, 16.0];
/// The greatest force, in newtons.
pub const MAX_FORCE_N: f64 = 3.12;

/// Forces at the end of grasping. Vibration adds up to 3.5 %, which stays below [`MAX_FORCE_N`].
const FORCE_N: [f64; 2] = [0.6, 3.0];
/// The silicone relaxes by this share of its stiffness, with this time constant.
const RELAXES: (f64, f64) = (0.25, 0.12);
/// Length of a bolt's shank.
const SHANK_MM: f64 = 24.0;
/// Minimum of the rests before and after the motion together.
const REST_MS: f64 = 20.0;

/// A part of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Until the greatest depth.
    Grasping,
    /// Until the fingers open.
    Holding,
    /// To the end.
    Releasing,
}

impl Phase {
    /// All phases, each at the index of its number.
    pub const ALL: [Self; 3] = [Self::Grasping, Self::Holding, Self::Releasing];

    /// A name for reports.
    pub fn name(self) -> &'static str {
        ["grasping", "holding", "releasing"][self as usize]
    }
}

/// The truth at a time of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the names say it")]
pub struct Grip {
    /// Time in microseconds.
    pub t_us: i64,
    /// Force on each finger, in newtons.
    pub force_n: f64,
    /// Depth of the bolt in the pad, in millimetres; 0 before it touches.
    pub depth_mm: f64,
    /// Area in contact, in square millimetres.
    pub area_mm2: f64,
    pub phase: Phase,
}

/// The plan of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the names say it")]
pub struct Grasp {
    /// The bolt on the pad.
    pub bolt: Placed,
    /// Force at the end of grasping, in newtons.
    pub force_n: f64,
    /// Distances of the bolt from the pad at the start and at the end, in millimetres.
    pub away_mm: [f64; 2],
    /// Rest, then lengths of the three phases' motion, in milliseconds; the remaining time is rest.
    pub lasts_ms: [f64; 4],
    /// 0: the fingers move evenly; 1: with a smooth start and a smooth end.
    pub smooth: [f64; 2],
    pub vibration: Vibration,
    /// Distance by which the bolt slips into place while the fingers close, in millimetres.
    pub settles_mm: [f64; 2],
    pub look: Look,
    /// Seed of the camera.
    pub seed: u64,
}

/// A sinusoidal vibration that begins softly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vibration {
    /// Frequency in hertz.
    pub hz: f64,
    /// Phases of depth and of the two directions of position, in radians.
    pub phases: [f64; 3],
    /// Amplitude of the depth, as a share of it.
    pub depth: f64,
    /// Amplitudes of the position along x and y, in millimetres.
    pub place_mm: [f64; 2],
}

impl Grasp {
    /// The plan number `number` of a seed: the bolts alternate, and the rest is drawn.
    pub fn drawn(seed: u64, number: usize) -> Self {
        let mut random = Random::new(Random::new(seed).bits() ^ Random::new(number as u64).bits());
        let mut from = |[low, high]: [f64; 2]| low + random.uniform() * (high - low);
        let radius_mm = BOLTS_MM[number % BOLTS_MM.len()] / 2.0;
        // The bolt lies along x or nearly so; its end is somewhere beside the pad or on it.
        let turn = from([-0.35, 0.35]);
        let along = from([0.0, 6.5]) * if from([-1.0, 1.0]) < 0.0 { -1.0 } else { 1.0 };
        let across = from([-1.5, 1.5]);
        let at_mm = [along * cos(turn) - across * sin(turn), along * sin(turn) + across * cos(turn)];
        let tilts = [from([-0.03, 0.03]), 0.0];
        let bolt =
            Placed { indenter: Indenter::Cylinder { radius_mm, length_mm: SHANK_MM }, at_mm, turn, tilts };
        let mut lasts_ms = [from([2.0, 30.0]), from([80.0, 160.0]), from([90.0, 170.0]), from([70.0, 140.0])];
        let most = DURATION_US as f64 / 1e3 - REST_MS;
        let total: f64 = lasts_ms.iter().sum();
        lasts_ms.iter_mut().for_each(|part| *part *= (most / total).min(1.0));
        Self {
            bolt,
            force_n: from(FORCE_N),
            away_mm: [from([0.1, 0.7]), from([0.1, 0.7])],
            lasts_ms,
            smooth: [from([0.3, 1.0]), from([0.3, 1.0])],
            vibration: Vibration {
                hz: from([8.0, 35.0]),
                phases: [from([0.0, TAU]), from([0.0, TAU]), from([0.0, TAU])],
                depth: from([0.003, 0.012]),
                place_mm: [from([0.0, 0.04]), from([0.0, 0.04])],
            },
            settles_mm: [from([-0.3, 0.3]), from([-0.3, 0.3])],
            look: Look {
                lux: exp(from([log(150.0), log(600.0)])),
                metal: from([0.35, 0.6]),
                wet: from([0.4, 0.6]),
                ground: from([0.03, 0.1]),
                reflection: from([0.01, 0.05]),
                scratches: (from([0.02, 0.12]), [from([0.0, TAU]), from([0.0, TAU]), from([0.0, TAU])]),
            },
            seed: random.bits(),
        }
    }

    /// Diameter of the bolt in millimetres; 0 for another indenter.
    pub fn bolt_mm(&self) -> f64 {
        if let Indenter::Cylinder { radius_mm, .. } = self.bolt.indenter { 2.0 * radius_mm } else { 0.0 }
    }

    /// A solver for [`PAD`], which recordings can share.
    ///
    /// # Errors
    /// None: the pad is within the ranges of [`GelSolver::new`].
    pub fn solver() -> Result<GelSolver> {
        GelSolver::new(Gel::default(), PAD)
    }

    /// Films the recording with the light of [`Look::lux`]; events come in order of time.
    ///
    /// Complexity: 13 contacts, and 206 pictures of the pixels of [`SENSOR`].
    ///
    /// # Errors
    /// As [`GelSolver::press`] and [`Camera::push`].
    pub fn film(
        &self,
        solver: &mut GelSolver,
        settings: CameraSettings,
    ) -> Result<(Vec<SimulatedEvent>, Vec<Grip>)> {
        let mut pad = PressedPad::new(solver, &self.bolt, RELAXES, self.force_n)?;
        let peak_mm = pad.depth_of(self.force_n, |depth_mm| self.loading(depth_mm));
        let mut camera = Camera::new(SENSOR, CameraSettings { lux: self.look.lux, ..settings }, self.seed)?;
        let view = View::new(&self.bolt, pad.lowest_mm(), &self.look);
        let (mut events, mut grips) = (Vec::new(), Vec::new());
        let mut picture = vec![0.0; usize::from(SENSOR.width) * usize::from(SENSOR.height)];
        for t_us in (0..=DURATION_US).step_by(STEP_US as usize) {
            let motion = self.motion(t_us as f64 / 1e3, peak_mm);
            pad.press_to(motion.depth_mm, STEP_US as f64 / 1e6);
            view.draw(&pad, motion.depth_mm, motion.place_mm, &mut picture);
            camera.push(t_us, &picture, &mut events)?;
            grips.push(Grip {
                t_us,
                force_n: pad.force_n(),
                depth_mm: motion.depth_mm.max(0.0),
                area_mm2: pad.area_mm2(),
                phase: motion.phase,
            });
        }
        camera.finish(&mut events);
        // Latency moves some events beyond the last frame.
        events.retain(|simulated| simulated.event.t_us < DURATION_US);
        Ok((events, grips))
    }

    /// The depths at every step from the start to the end of grasping, for a greatest depth.
    fn loading(&self, peak_mm: f64) -> impl Iterator<Item = f64> {
        let end_ms = self.lasts_ms[0] + self.lasts_ms[1];
        let steps = (end_ms * 1e3 / STEP_US as f64) as i64;
        (0..=steps).map(move |step| self.motion((step * STEP_US) as f64 / 1e3, peak_mm).depth_mm)
    }

    /// The position of the bolt, and its phase.
    fn motion(&self, t_ms: f64, peak_mm: f64) -> Motion {
        let [rest, grasp, hold, release] = self.lasts_ms;
        let [from_mm, to_mm] = self.away_mm;
        let [along, across] = self.settles_mm;
        let closed = eased((t_ms - rest) / grasp, self.smooth[0]);
        let opened = eased((t_ms - rest - grasp - hold) / release, self.smooth[1]);
        let since = t_ms - rest - grasp;
        let (phase, envelope) = match since {
            ..0.0 => (Phase::Grasping, 0.0),
            _ if since < hold => (Phase::Holding, sin(PI * since / hold)),
            _ => (Phase::Releasing, 0.0),
        };
        let Vibration { hz, phases, depth, place_mm } = self.vibration;
        let wave = |phase: f64| envelope * sin(TAU * hz * since / 1e3 + phase);
        let pressed = -from_mm + closed * (from_mm + peak_mm) - opened * (peak_mm + to_mm);
        Motion {
            depth_mm: pressed + depth * peak_mm * wave(phases[0]),
            // After grasping, the bolt no longer slips.
            place_mm: [
                along * (1.0 - closed) + place_mm[0] * wave(phases[1]),
                across * (1.0 - closed) + place_mm[1] * wave(phases[2]),
            ],
            phase,
        }
    }
}

struct Motion {
    /// Below 0: away from the pad.
    depth_mm: f64,
    place_mm: [f64; 2],
    phase: Phase,
}

/// From 0 to 1 between the times 0 and 1: a line, or with `smooth` 1 the step `3 t^2 - 2 t^3`.
fn eased(time: f64, smooth: f64) -> f64 {
    let time = time.clamp(0.0, 1.0);
    (1.0 - smooth) * time + smooth * time * time * (3.0 - 2.0 * time)
}
