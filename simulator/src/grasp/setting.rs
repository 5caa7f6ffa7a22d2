//! What all recordings of a grasp share, and their light.

use meissner_engine::Sensor;

use crate::gel::Grid;

/// The pixels of a pad's surface, on which contacts are solved.
pub const PAD: Grid = Grid { width: 48, height: 48, pitch_mm: 0.4 };
/// The part of the camera's picture that sees the pad: the crop of the published networks.
pub const SENSOR: Sensor = Sensor { width: 115, height: 115 };
/// Length of a recording: 41 frames of 10 ms.
pub const DURATION_US: i64 = 410_000;
/// Time from one picture and one label to the next. An edge of a contact moves by at most half a
/// pixel in it.
pub const STEP_US: i64 = 2_000;

/// Light, and how bolt and pad reflect it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Light of a white surface, in lux.
    pub lux: f64,
    /// Share of the light that the metal gives back where it faces the camera.
    pub metal: f64,
    /// The same share, relative to the metal, where silicone touches it.
    pub wet: f64,
    /// Brightness far behind the pad.
    pub ground: f64,
    /// Share of the light that the free surface of the pad reflects.
    pub reflection: f64,
    /// Contrast of scratches on the bolt, and their phases in radians.
    pub scratches: (f64, [f64; 3]),
}
