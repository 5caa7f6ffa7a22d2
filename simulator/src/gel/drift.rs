//! The light of a sensor, which drifts, and the bytes of a picture in it.

use meissner_kernels::random::Random;

/// Standard deviations of the drift of the light between the picture at rest and those of a press,
/// in grey levels, for each term of a quadratic in the place from -1 to 1: those of the 20 real
/// pictures that the lights are fitted to, away from their contacts, with equal values for terms of
/// equal degree.
const DRIFT: [f64; 6] = [12.0, 12.0, 12.0, 7.0, 7.0, 7.0];

/// How the light of a sensor has changed since its picture at rest: a quadratic in the place, for
/// each colour, in grey levels.
#[derive(Clone, Copy, Debug)]
pub struct Drift([[f64; 3]; 6]);

impl Drift {
    /// A change as large as those of the real sensor.
    pub fn drawn(random: &mut Random) -> Self {
        Self(DRIFT.map(|deviation| [(); 3].map(|()| deviation * normal(random))))
    }

    /// The change of red, green and blue at a place from -1 to 1.
    fn at(&self, [u, v]: [f64; 2]) -> [f64; 3] {
        let terms = [1.0, u, v, u * u, u * v, v * v];
        [0, 1, 2].map(|channel| terms.iter().zip(&self.0).map(|(term, drift)| term * drift[channel]).sum())
    }
}

/// The bytes of a picture of this width and height, from its grey levels, in a light that has
/// drifted: red, green and blue of each pixel, row by row.
pub fn picture_bytes(levels: &[[f32; 3]], size: [usize; 2], drift: Option<&Drift>) -> Vec<u8> {
    let [width, height] = size.map(|side| side as f64);
    let pixels = levels.iter().enumerate().flat_map(|(pixel, level)| {
        let (column, row) = ((pixel % size[0]) as f64, (pixel / size[0]) as f64);
        let place = [2.0 * column / width - 1.0, 2.0 * row / height - 1.0];
        let drifted = drift.map_or([0.0; 3], |drift| drift.at(place));
        [0, 1, 2]
            .map(|channel| (f64::from(level[channel]) + drifted[channel]).round().clamp(0.0, 255.0) as u8)
    });
    pixels.collect()
}

/// Roughly normal: the sum of twelve uniform values less six, whose variance is 1.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.uniform()).sum::<f64>() - 6.0
}
