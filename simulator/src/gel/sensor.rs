//! Sensors of one kind: a gel and the lights and the camera behind it. No two are equal.

use libm::{exp, log};
use meissner_kernels::random::Random;

use super::{Gel, GelCamera, Grid, Lens};
use crate::camera::normal_pair;

/// A gel with its camera. The default has the lights that are fitted to pictures of a real sensor,
/// turned to pictures that are wider than high.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GelSensor {
    /// The gel.
    pub gel: Gel,
    /// Lights and camera.
    pub camera: GelCamera,
    /// Width of the surface that the picture shows, in millimetres.
    pub width_mm: f64,
}

impl Default for GelSensor {
    fn default() -> Self {
        // The fitted pictures have 120 columns and 160 rows.
        let camera = GelCamera { lens: Lens { blur: 0.002, ..Lens::default() }, ..GelCamera::default() };
        Self { gel: Gel::default(), camera: camera.turned(120.0 / 160.0), width_mm: 19.2 }
    }
}

impl GelSensor {
    /// A second sensor of the same kind: a stiffer and thinner gel, lights of other strength at
    /// other places, a lens that bends and darkens, shadows, another scale. Each differs from the
    /// default by about as much as [`Self::drawn`] spreads it.
    pub fn second() -> Self {
        let mut sensor = Self::default();
        sensor.gel.modulus_mpa *= 1.12;
        sensor.gel.thickness_mm *= 0.9;
        sensor.width_mm *= 0.93;
        let camera = &mut sensor.camera;
        let strengths = [1.25, 0.8, 1.15];
        let moves = [[0.35, -0.3], [-0.3, -0.35], [0.3, 0.35]];
        for ((light, strength), [x, y]) in camera.lights.iter_mut().zip(strengths).zip(moves) {
            light.colour = light.colour.map(|colour| colour * strength);
            light.place[0] += x;
            light.place[1] += y;
            light.place[2] *= 1.15;
        }
        camera.shadow = 0.25;
        camera.lens = Lens { distortion: 0.04, vignetting: 0.15, blur: 0.003 };
        camera.noise = 2.2;
        sensor
    }

    /// A sensor of the same kind whose properties are spread about the default's.
    ///
    /// Normal, of the logarithm: modulus 0.12, thickness 0.1, width 0.07, the strength of each
    /// light 0.2, its height 0.15. Normal: the place of each light 0.3 widths. Uniform: shadow 0 to
    /// 0.5, distortion -0.06 to 0.06, vignetting 0 to 0.2, blur 0.001 to 0.004 widths, noise 1 to 3
    /// grey levels.
    pub fn drawn(random: &mut Random) -> Self {
        let mut sensor = Self::default();
        let spread = |value: f64, random: &mut Random, deviation: f64| {
            exp(log(value) + deviation * normal_pair(random)[0])
        };
        let Gel { modulus_mpa, thickness_mm, .. } = sensor.gel;
        sensor.gel.modulus_mpa = spread(modulus_mpa, random, 0.12);
        sensor.gel.thickness_mm = spread(thickness_mm, random, 0.1);
        sensor.width_mm = spread(sensor.width_mm, random, 0.07);
        let camera = &mut sensor.camera;
        for light in &mut camera.lights {
            let strength = spread(1.0, random, 0.2);
            light.colour = light.colour.map(|colour| colour * strength);
            let [x, y] = normal_pair(random);
            light.place[0] += 0.3 * x;
            light.place[1] += 0.3 * y;
            light.place[2] = spread(light.place[2], random, 0.15);
        }
        let mut between = |low: f64, high: f64| low + random.uniform() * (high - low);
        camera.shadow = between(0.0, 0.5);
        let (distortion, vignetting) = (between(-0.06, 0.06), between(0.0, 0.2));
        camera.lens = Lens { distortion, vignetting, blur: between(0.001, 0.004) };
        camera.noise = between(1.0, 3.0);
        sensor
    }

    /// The pixels of a picture of this size.
    pub fn grid(&self, width: usize, height: usize) -> Grid {
        Grid { width, height, pitch_mm: self.width_mm / width as f64 }
    }
}
