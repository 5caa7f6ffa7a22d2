//! The dome in real time: presses interpolated between precomputed ones, and its camera.
//!
//! Input: a dome, the greatest depth. Output: the markers at any tilt up to
//! [`PressTable::MAX_TILT`], direction and depth, in microseconds instead of a second, and their
//! positions in the image.
//!
//! The mesh of a [`Dome`] looks the same after a turn by 60 degrees, so presses in a sixth of all
//! directions are enough. Between them, the markers are linear in tilt, direction and depth.

use std::f64::consts::{FRAC_PI_3, PI};
use std::num::NonZero;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use libm::{cos, sin};
use meissner_engine::Sensor;

use crate::{Dome, Press, Vector};

/// Directions of the computed presses in a sixth of a turn.
const DIRECTIONS: usize = 3;
/// Tilts of the computed presses, without the flat one.
const TILTS: usize = 5;
/// Depth between two records of a press, in millimetres.
const STEP_MM: f64 = 0.5;

/// Presses of a dome by tilt, direction and depth.
#[derive(Clone, Debug)]
pub struct PressTable {
    rings: usize,
    markers: usize,
    /// Records of a press.
    records: usize,
    /// The flat press, then those of each tilt, by direction: markers by record.
    presses: Vec<Vec<Vector>>,
}

impl PressTable {
    /// The largest tilt of the plane, in radians: 10 degrees.
    pub const MAX_TILT: f64 = PI / 18.0;

    /// Presses of `dome` to `deepest_mm` millimetres. All processors share the work.
    ///
    /// Complexity: 16 presses; see [`Press::press_to`].
    pub fn new(dome: &Dome, deepest_mm: f64) -> Self {
        let records = (deepest_mm / STEP_MM).ceil() as usize + 1;
        let kinds: Vec<(f64, f64)> = std::iter::once((0.0, 0.0))
            .chain((0..TILTS * DIRECTIONS).map(|i| {
                let (tilt, direction) = (i / DIRECTIONS + 1, i % DIRECTIONS);
                let share = |part: usize, of: usize| part as f64 / of as f64;
                (Self::MAX_TILT * share(tilt, TILTS), FRAC_PI_3 * share(direction, DIRECTIONS))
            }))
            .collect();
        let next = AtomicUsize::new(0);
        let threads = thread::available_parallelism().map_or(1, NonZero::get).min(kinds.len());
        // A thread's share is a list of presses, each with its number.
        let share = || {
            let number = || Some(next.fetch_add(1, Ordering::Relaxed)).filter(|&i| i < kinds.len());
            std::iter::from_fn(number).map(|i| (i, pressed(dome, kinds[i], records))).collect::<Vec<_>>()
        };
        let mut presses: Vec<_> = thread::scope(|scope| {
            let workers: Vec<_> = (0..threads).map(|_| scope.spawn(share)).collect();
            let joined =
                workers.into_iter().map(|worker| worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
            joined.flatten().collect()
        });
        presses.sort_unstable_by_key(|&(i, _)| i);
        let presses: Vec<_> = presses.into_iter().map(|(_, press)| press).collect();
        Self { rings: dome.rings, markers: presses[0].len() / records, records, presses }
    }

    /// Markers of the dome.
    pub fn count(&self) -> usize {
        self.markers
    }

    /// Replaces the content of `markers` with the markers of a press, in the order of
    /// [`Press::markers`]. A tilt or depth beyond the table is clamped to its end.
    pub fn markers(&self, tilt: f64, azimuth: f64, depth_mm: f64, markers: &mut Vec<Vector>) {
        let (tilt, tilt_share) = split(tilt / Self::MAX_TILT * TILTS as f64, TILTS);
        let turns = azimuth.rem_euclid(2.0 * PI) / FRAC_PI_3 * DIRECTIONS as f64;
        let (direction, direction_share) = split(turns, 6 * DIRECTIONS);
        let (record, record_share) = split(depth_mm / STEP_MM, self.records - 1);
        markers.clear();
        markers.resize(self.markers, [0.0; 3]);
        for (corner, weight) in [0, 1].into_iter().zip([1.0 - direction_share, direction_share]) {
            let (sector, within) = ((direction + corner) / DIRECTIONS, (direction + corner) % DIRECTIONS);
            let (sine, cosine) = (sin(sector as f64 * FRAC_PI_3), cos(sector as f64 * FRAC_PI_3));
            for (tilt, weight) in [(tilt, weight * (1.0 - tilt_share)), (tilt + 1, weight * tilt_share)] {
                let press = &self.presses[if tilt == 0 { 0 } else { 1 + (tilt - 1) * DIRECTIONS + within }];
                for (record, weight) in
                    [(record, weight * (1.0 - record_share)), (record + 1, weight * record_share)]
                {
                    let record = &press[record * self.markers..][..self.markers];
                    for ring in 0..=self.rings {
                        let (first, count) = ring_of(ring);
                        for i in 0..count {
                            let [x, y, z] = record[first + (i + count - sector * ring % count) % count];
                            let turned = [cosine * x - sine * y, sine * x + cosine * y, z];
                            for (sum, value) in markers[first + i].iter_mut().zip(turned) {
                                *sum += weight * value;
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The whole part of `place`, at most `last - 1`, and the rest; `place` is clamped to 0 to `last`.
fn split(place: f64, last: usize) -> (usize, f64) {
    let place = place.clamp(0.0, last as f64);
    let whole = (place as usize).min(last - 1);
    (whole, place - whole as f64)
}

/// The first marker of a ring, and its number of markers.
fn ring_of(ring: usize) -> (usize, usize) {
    if ring == 0 { (0, 1) } else { (1 + 3 * ring * (ring - 1), 6 * ring) }
}

/// The markers of a press on a plane of a tilt and azimuth, record after record.
fn pressed(dome: &Dome, (tilt, azimuth): (f64, f64), records: usize) -> Vec<Vector> {
    let mut press = Press::new(dome, tilt, azimuth);
    let mut markers = Vec::new();
    for record in 0..records {
        press.press_to(record as f64 * STEP_MM);
        markers.extend_from_slice(press.markers());
    }
    markers
}

/// Distance from the camera to the base in millimetres.
const CAMERA_MM: f64 = 20.0;
/// The share of half the smaller side that the outermost ring fills; a deep press widens it.
const FILLED: f64 = 0.65;

/// A pinhole camera below a dome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DomeView {
    focal: f64,
    centre: [f64; 2],
}

impl DomeView {
    /// The view of `dome` on an image of `sensor`.
    pub fn new(dome: &Dome, sensor: Sensor) -> Self {
        let rim = 0.5 * dome.rings_mm;
        let rim_height = libm::sqrt(dome.radius_mm * dome.radius_mm - rim * rim);
        let side = f64::from(sensor.width.min(sensor.height));
        Self {
            focal: 0.5 * side * FILLED * (CAMERA_MM + rim_height) / rim,
            centre: [0.5 * (f64::from(sensor.width) - 1.0), 0.5 * (f64::from(sensor.height) - 1.0)],
        }
    }

    /// Column and row of a marker, as in [`crate::MarkerTracks`].
    pub fn place(&self, [x, y, z]: Vector) -> [f32; 2] {
        let scale = self.focal / (CAMERA_MM + z);
        [(self.centre[0] + scale * x) as f32, (self.centre[1] + scale * y) as f32]
    }
}
