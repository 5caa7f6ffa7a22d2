//! Enters: an RGB image, or the network's output. Leaves: the network's input, or forces in N per pixel.
//!
//! As the networks were trained: input = (v / 255 - mean) / std for each channel, and output = (force - mean) / std, of
//! which the inverse is applied here. Each operation is rounded to f32 on its own, in this order.

use super::error::{ContactError, same_length, setting};

/// Levels of an 8-bit channel.
const LEVELS: usize = 256;

/// Turns interleaved 8-bit RGB into the network's planar input.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageNormalisation {
    /// The input for every level of every channel: an 8-bit image has no others.
    tables: Box<[[f32; LEVELS]; 3]>,
}

impl ImageNormalisation {
    /// What a level is divided by before the mean is subtracted, so that means and deviations are those of [0, 1].
    pub const SCALE: f32 = 255.0;

    /// Normalisation by the mean and the standard deviation of red, green and blue, each of values in [0, 1].
    ///
    /// # Errors
    /// [`ContactError::Setting`] where a mean is not finite, a deviation not positive and finite, or so small that a
    /// level leaves f32's range.
    pub fn new(mean: [f32; 3], std: [f32; 3]) -> Result<Self, ContactError> {
        let mut tables = Box::new([[0.0; LEVELS]; 3]);
        for (table, (mean, std)) in tables.iter_mut().zip(mean.into_iter().zip(std)) {
            check("image", mean, std)?;
            for (level, input) in table.iter_mut().enumerate() {
                *input = (level as f32 / Self::SCALE - mean) / std;
            }
            let expected = "large enough that every level stays within f32's range";
            setting(
                "standard deviation of the image",
                expected,
                std.into(),
                table.iter().all(|v| v.is_finite()),
            )?;
        }
        Ok(Self { tables })
    }

    /// Normalises the pixels of `rgb`, interleaved, into `planes` (3, H, W): all of red, then green, then blue.
    ///
    /// One look-up a value.
    ///
    /// # Errors
    /// [`ContactError::Length`] where `rgb` is no whole number of pixels, or `planes` has another length.
    pub fn apply(&self, rgb: &[u8], planes: &mut [f32]) -> Result<(), ContactError> {
        let pixels = rgb.len() / 3;
        same_length("image (3 bytes a pixel)", pixels * 3, rgb.len())?;
        same_length("planes", rgb.len(), planes.len())?;
        if pixels == 0 {
            return Ok(());
        }
        for (channel, (plane, table)) in planes.chunks_exact_mut(pixels).zip(&*self.tables).enumerate() {
            for (input, pixel) in plane.iter_mut().zip(rgb.chunks_exact(3)) {
                *input = table[usize::from(pixel[channel])];
            }
        }
        Ok(())
    }
}

/// Turns the network's output into forces: force = y * std + mean, in N per pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceNormalisation {
    mean: f32,
    std: f32,
}

impl ForceNormalisation {
    /// Output that is the force already.
    pub const IDENTITY: Self = Self { mean: 0.0, std: 1.0 };

    /// The inverse of a normalisation by the mean and the standard deviation of the forces, in N per pixel.
    ///
    /// # Errors
    /// [`ContactError::Setting`] where the mean is not finite, or the deviation not positive and finite.
    pub fn new(mean: f32, std: f32) -> Result<Self, ContactError> {
        check("force", mean, std)?;
        Ok(Self { mean, std })
    }

    /// The force of one output.
    #[inline]
    pub fn force(self, y: f32) -> f32 {
        y * self.std + self.mean
    }

    /// Turns a map of outputs into a map of forces, in place.
    pub fn apply(self, map: &mut [f32]) {
        map.iter_mut().for_each(|y| *y = self.force(*y));
    }
}

fn check(of: &'static str, mean: f32, std: f32) -> Result<(), ContactError> {
    let (mean_of, std_of) = match of {
        "image" => ("mean of the image", "standard deviation of the image"),
        _ => ("mean of the force", "standard deviation of the force"),
    };
    setting(mean_of, "a finite number", mean.into(), mean.is_finite())?;
    setting(std_of, "a positive number", std.into(), std > 0.0 && std.is_finite())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{ForceNormalisation, ImageNormalisation};
    use crate::systems::contact_area::ContactError;

    #[test]
    fn two_pixels_become_three_planes() {
        let normalisation = ImageNormalisation::new([0.0, 0.5, 1.0], [1.0, 0.5, 0.25]).unwrap();
        let mut planes = [f32::NAN; 6];
        normalisation.apply(&[255, 255, 255, 0, 0, 0], &mut planes).unwrap();
        assert_eq!(planes, [1.0, 0.0, 1.0, -1.0, 0.0, -4.0]);
    }

    #[test]
    fn the_inverse_of_the_force_is_y_times_std_plus_mean() {
        let normalisation = ForceNormalisation::new(0.25, 2.0).unwrap();
        let mut map = [0.0, 1.0, -0.5];
        normalisation.apply(&mut map);
        assert_eq!(map, [0.25, 2.25, -0.75]);
        assert_eq!(ForceNormalisation::IDENTITY.force(1e-4), 1e-4);
    }

    #[test]
    fn means_must_be_finite_and_deviations_positive() {
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(ImageNormalisation::new([0.0; 3], [1.0, 1.0, bad]).is_err(), "{bad}");
            assert!(ForceNormalisation::new(0.0, bad).is_err(), "{bad}");
        }
        for bad in [f32::NAN, f32::NEG_INFINITY] {
            assert!(ImageNormalisation::new([0.0, bad, 0.0], [1.0; 3]).is_err(), "{bad}");
            assert!(ForceNormalisation::new(bad, 1.0).is_err(), "{bad}");
        }
        let error = ImageNormalisation::new([0.0; 3], [1.0, 1.0, -1.0]).unwrap_err().to_string();
        assert_eq!(error, "standard deviation of the image: expected a positive number, found -1");
        assert!(ImageNormalisation::new([0.0; 3], [1.0, 1.0, 1e-40]).is_err(), "1 / 1e-40 is beyond f32");
    }

    #[test]
    fn lengths_that_do_not_fit_are_refused() {
        let normalisation = ImageNormalisation::new([0.0; 3], [1.0; 3]).unwrap();
        let error = normalisation.apply(&[0; 6], &mut [0.0; 5]).unwrap_err();
        assert_eq!(error, ContactError::Length { what: "planes", expected: 6, found: 5 });
        assert!(normalisation.apply(&[0; 5], &mut [0.0; 5]).is_err());
        assert!(normalisation.apply(&[], &mut []).is_ok());
    }

    proptest! {
        #[test]
        fn the_tables_have_the_bits_of_the_equation(
            rgb in prop::collection::vec(any::<[u8; 3]>(), 0..40),
            mean in prop::array::uniform3(-1.0_f32..2.0),
            std in prop::array::uniform3(0.01_f32..3.0),
        ) {
            let mut planes = vec![f32::NAN; rgb.len() * 3];
            ImageNormalisation::new(mean, std).unwrap().apply(rgb.as_flattened(), &mut planes).unwrap();
            for (channel, (mean, std)) in mean.into_iter().zip(std).enumerate() {
                for (at, pixel) in rgb.iter().enumerate() {
                    let expected = (f32::from(pixel[channel]) / 255.0 - mean) / std;
                    prop_assert_eq!(planes[channel * rgb.len() + at].to_bits(), expected.to_bits());
                }
            }
        }
    }
}
