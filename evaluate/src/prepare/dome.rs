//! Presses of the simulated dome, as marker tracks with labels.
//!
//! Input: the number of presses, and a seed. Output: tracks for [`super::film_markers`], with
//! tilt, depth and force of each press.

use std::f64::consts::PI;

use meissner_engine::Sensor;
use meissner_kernels::random::Random;
use meissner_models::TensorFile;
use meissner_run::text::grouped;
use meissner_simulator::{Dome, DomeView, Press};
use rayon::ThreadPool;
use rayon::prelude::*;
use serde_json::json;

use super::{Prepared, metadata};

/// The published plan: tilts from 0 to 9 degrees, directions, ranges of depth and duration.
const TILTS: usize = 10;
const MAX_TILT: f64 = 9.0 * PI / 180.0;
const DIRECTIONS: usize = 20;
const DEPTH_MM: [f64; 2] = [5.0, 15.0];
const DURATION_US: [f64; 2] = [90_000.0, 200_000.0];
/// The dome rests before a press, and the press is held after it.
const REST_US: i64 = 10_000;

/// Number of pairs of a tilt and a direction in the plan.
pub const DOME_KINDS: usize = TILTS * DIRECTIONS;

/// Depth between two recorded positions, in millimetres; markers move straight between them.
const RECORD_MM: f64 = 0.5;

/// Presses of the default [`Dome`], `each` of all tilts and directions, or of `planes` with a tilt
/// of 0 to 9 degrees and a direction that `seed` determines, seen by a `sensor`.
///
/// Depth rises from 0 with a smooth start and a smooth end. Presses of one tilt and direction
/// differ in depth and duration, which `seed` determines. The result has `t_us` I64 (times),
/// `start` I64 (presses + 1) and `position` F32 (times, markers, 2), as [`super::film_markers`]
/// reads them, and for each time `roll`, `pitch` (radians), `depth` (mm) and `force` (N), F32
/// (times). Roll and pitch are the angles of the plane about x and y. The threads of `pool` share
/// the planes.
///
/// Complexity: a press to 15 mm for each plane, about two seconds of one core.
pub fn dome_presses(
    planes: Option<usize>,
    each: usize,
    sensor: Sensor,
    seed: u64,
    pool: &ThreadPool,
) -> Prepared {
    let mut random = Random::new(seed);
    let kinds = self::planes(planes, &mut random);
    let recorded: Vec<Vec<Recorded>> =
        pool.install(|| kinds.par_iter().map(|&(tilt, azimuth)| record(tilt, azimuth, sensor)).collect());
    let mut uniform = |[low, high]: [f64; 2]| low + random.uniform() * (high - low);
    let (mut t_us, mut start, mut positions) = (Vec::new(), vec![0], Vec::new());
    let mut labels = [const { Vec::new() }; 4];
    let markers = recorded[0][0].markers.len();
    for (&(tilt, azimuth), recorded) in kinds.iter().zip(&recorded) {
        // The plane leans towards `azimuth`: it is turned about the perpendicular axis.
        let (roll, pitch) = (-tilt * libm::sin(azimuth), tilt * libm::cos(azimuth));
        for _ in 0..each {
            let (depth_mm, duration_us) = (uniform(DEPTH_MM), uniform(DURATION_US));
            let mut add = |time: i64, recorded: &Recorded| {
                t_us.push(time);
                positions.extend(recorded.markers.iter().flatten());
                let values = [roll as f32, pitch as f32, recorded.depth_mm as f32, recorded.force_n as f32];
                labels.iter_mut().zip(values).for_each(|(label, value)| label.push(value));
            };
            add(0, &recorded[0]);
            let records = (depth_mm / RECORD_MM) as usize;
            let reached = |mm: f64| REST_US + (duration_us * rising_time(mm / depth_mm)) as i64;
            for (i, record) in recorded[..=records].iter().enumerate() {
                add(reached(i as f64 * RECORD_MM), record);
            }
            let rest_mm = depth_mm - records as f64 * RECORD_MM;
            if reached(depth_mm) > reached(depth_mm - rest_mm) {
                let last = recorded[records].towards(&recorded[records + 1], rest_mm / RECORD_MM);
                add(reached(depth_mm), &last);
            }
            start.push(t_us.len() as i64);
        }
    }
    let mut file = TensorFile::new(metadata([("sensor", json!([sensor.width, sensor.height]))]));
    file.i64("t_us", &[t_us.len()], &t_us);
    file.i64("start", &[start.len()], &start);
    file.f32("position", &[t_us.len(), markers, 2], &positions);
    for (name, values) in ["roll", "pitch", "depth", "force"].into_iter().zip(&labels) {
        file.f32(name, &[values.len()], values);
    }
    let presses = grouped(start.len() as u64 - 1);
    Prepared { file, contents: format!("tracks of {markers} markers in {presses} presses") }
}

/// Tilts and azimuths in radians: of the plan, or so many at random.
pub(crate) fn planes(number: Option<usize>, random: &mut Random) -> Vec<(f64, f64)> {
    match number {
        None => {
            let tilt = |i: usize| (i / DIRECTIONS) as f64 * PI / 180.0;
            let azimuth = |i: usize| (i % DIRECTIONS) as f64 * 2.0 * PI / DIRECTIONS as f64;
            (0..DOME_KINDS).map(|i| (tilt(i), azimuth(i))).collect()
        }
        Some(number) => {
            (0..number).map(|_| (MAX_TILT * random.uniform(), 2.0 * PI * random.uniform())).collect()
        }
    }
}

/// A dome during a press.
pub(crate) struct Recorded {
    /// Column and row of each marker in the image, in pixels.
    pub(crate) markers: Vec<[f32; 2]>,
    pub(crate) depth_mm: f64,
    pub(crate) force_n: f64,
}

impl Recorded {
    /// A `share` of the way to `other`.
    fn towards(&self, other: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + share * (b - a);
        let markers = self.markers.iter().zip(&other.markers);
        let mixed = |(a, b): (&[f32; 2], &[f32; 2])| {
            [mix(a[0].into(), b[0].into()) as f32, mix(a[1].into(), b[1].into()) as f32]
        };
        Self {
            markers: markers.map(mixed).collect(),
            depth_mm: mix(self.depth_mm, other.depth_mm),
            force_n: mix(self.force_n, other.force_n),
        }
    }
}

/// A press to the greatest depth.
pub(crate) fn record(tilt: f64, azimuth: f64, sensor: Sensor) -> Vec<Recorded> {
    let dome = Dome::default();
    let mut press = Press::new(&dome, tilt, azimuth);
    let view = DomeView::new(&dome, sensor);
    let steps = (DEPTH_MM[1] / RECORD_MM) as usize;
    let at = |i: usize| {
        press.press_to(i as f64 * RECORD_MM);
        let markers = press.markers().iter().map(|&marker| view.place(marker)).collect();
        Recorded { markers, depth_mm: press.depth_mm(), force_n: press.force_n() }
    };
    (0..=steps).map(at).collect()
}

/// Time at which depth has risen to `share`, as a share of the duration: inverse of `3 t^2 - 2
/// t^3`.
pub(crate) fn rising_time(share: f64) -> f64 {
    0.5 - libm::sin(libm::asin((1.0 - 2.0 * share).clamp(-1.0, 1.0)) / 3.0)
}
