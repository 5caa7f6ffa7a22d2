//! What the camera inside a dome sees of its markers.
//!
//! Enters: points of the dome in millimetres. Leaves: their places in the image. The camera is a pinhole on the axis of the dome,
//! below its base; the outermost ring of markers fills a share of the image, which leaves room for the deepest press.

use libm::sqrt;
use meissner_engine::Sensor;

use crate::{Dome, Vector};

/// Distance from the camera to the base, in millimetres.
const CAMERA_MM: f64 = 20.0;
/// The share of half the image's smaller side that the outermost ring fills at rest. The deepest press widens it by half.
const FILLED: f64 = 0.65;

/// The camera inside a dome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// In pixels.
    focal: f64,
    centre: [f64; 2],
}

impl View {
    /// The view of `dome` on the pixels of `sensor`.
    pub fn new(dome: &Dome, sensor: Sensor) -> Self {
        let rim = 0.5 * dome.rings_mm;
        let rim_height = sqrt(dome.radius_mm * dome.radius_mm - rim * rim);
        let side = f64::from(sensor.width.min(sensor.height));
        let focal = 0.5 * side * FILLED * (CAMERA_MM + rim_height) / rim;
        Self { focal, centre: [sensor.width, sensor.height].map(|side| 0.5 * (f64::from(side) - 1.0)) }
    }

    /// Column and row of a point in pixels, as in [`MarkerTracks`](crate::MarkerTracks).
    pub fn see(&self, [x, y, z]: Vector) -> [f32; 2] {
        let scale = self.focal / (CAMERA_MM + z);
        [(self.centre[0] + scale * x) as f32, (self.centre[1] + scale * y) as f32]
    }
}
