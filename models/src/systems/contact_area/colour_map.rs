//! A number from 0 to 1 to a colour with opacity.

/// A colour map through five colours at 0, 1/4, 1/2, 3/4 and 1, linear between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColourMap {
    /// Red, green, blue and opacity, each from 0 to 255 (opacity 0: transparent).
    pub points: [[u8; 4]; 5],
}

impl ColourMap {
    /// From transparent through yellow and orange to red.
    pub const HEAT: Self = Self {
        points: [
            [255, 255, 160, 0],
            [255, 235, 60, 110],
            [255, 170, 0, 165],
            [240, 80, 0, 200],
            [190, 0, 0, 225],
        ],
    };

    /// The colour at `t`; below 0 and NaN as at 0, above 1 as at 1. Halves are rounded upwards.
    pub fn at(&self, t: f32) -> [u8; 4] {
        // NaN is not above 0.
        let place = if t > 0.0 { t.min(1.0) * 4.0 } else { 0.0 };
        let below = (place as usize).min(3);
        let part = place - below as f32;
        std::array::from_fn(|channel| {
            let (a, b) = (f32::from(self.points[below][channel]), f32::from(self.points[below + 1][channel]));
            (a + (b - a) * part + 0.5) as u8
        })
    }
}

impl Default for ColourMap {
    fn default() -> Self {
        Self::HEAT
    }
}

#[cfg(test)]
mod tests {
    use super::ColourMap;

    #[test]
    fn the_points_themselves_are_met() {
        for (index, point) in ColourMap::HEAT.points.into_iter().enumerate() {
            assert_eq!(ColourMap::HEAT.at(index as f32 / 4.0), point);
        }
    }

    #[test]
    fn between_two_points_it_is_linear() {
        let map = ColourMap { points: [[0; 4], [0, 100, 200, 255], [0; 4], [0; 4], [0; 4]] };
        assert_eq!(map.at(0.125), [0, 50, 100, 128]);
        assert_eq!(map.at(0.3125), [0, 75, 150, 191]);
    }

    #[test]
    fn beyond_its_ends_it_stays_at_them() {
        let map = ColourMap::HEAT;
        assert_eq!([-1.0, f32::NAN, f32::NEG_INFINITY].map(|t| map.at(t)), [map.points[0]; 3]);
        assert_eq!([1.5, f32::INFINITY].map(|t| map.at(t)), [map.points[4]; 2]);
    }
}
