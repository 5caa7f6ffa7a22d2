//! The camera inside a dome: where it sees each marker.
//!
//! Enters: markers in millimetres. Leaves: places in the image in pixels. The camera looks along
//! the axis from below the base.

use meissner_engine::Sensor;

use crate::{Dome, Vector};

/// Distance from the camera to the base in millimetres.
const CAMERA_MM: f64 = 20.0;
/// The share of half the image's smaller side that the outermost ring fills at rest. The deepest
/// press of the published plan, 15 mm, widens it by half.
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

    /// Column and row of a marker, as [`crate::MarkerTracks`] has them.
    pub fn place(&self, [x, y, z]: Vector) -> [f32; 2] {
        let scale = self.focal / (CAMERA_MM + z);
        [(self.centre[0] + scale * x) as f32, (self.centre[1] + scale * y) as f32]
    }
}
