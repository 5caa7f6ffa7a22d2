//! Between the RGB image and a network's input, and between its output and N per pixel.
//!
//! As trained: input = (v / 255 - mean) / std for each channel, v a level or its difference from a
//! reference's, and output = (force - mean) / std, inverted here. Each operation is rounded to f32,
//! in this order.

use super::{ContactError, same_length, setting};

/// Levels of an 8-bit channel.
const LEVELS: usize = 256;
/// Differences between two levels, from -255 to 255.
const DIFFERENCES: usize = 2 * LEVELS - 1;
const IMAGE_STD: &str = "standard deviation of the image";

/// Turns interleaved 8-bit RGB into the network's planar input.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageNormalisation {
    /// The input for each difference from -255, of each channel; a level is one from 0.
    tables: Box<[[f32; DIFFERENCES]; 3]>,
}

impl ImageNormalisation {
    /// Divisor of a level: means and deviations are those of values in [0, 1].
    pub const SCALE: f32 = 255.0;

    /// Normalisation by mean and deviation of red, green and blue, of values in [0, 1].
    ///
    /// # Errors
    /// [`ContactError::Setting`] for a mean that is not finite, or a deviation not positive and
    /// finite or so small that a level leaves f32.
    pub fn new(mean: [f32; 3], std: [f32; 3]) -> Result<Self, ContactError> {
        let mut tables = Box::new([[0.0; DIFFERENCES]; 3]);
        for (table, (mean, std)) in tables.iter_mut().zip(mean.into_iter().zip(std)) {
            check(["mean of the image", IMAGE_STD], mean, std)?;
            for (index, input) in table.iter_mut().enumerate() {
                let difference = index as f32 - (LEVELS - 1) as f32;
                *input = (difference / Self::SCALE - mean) / std;
            }
            let expected = "large enough that every level stays within f32's range";
            setting(IMAGE_STD, expected, std.into(), table.iter().all(|v| v.is_finite()))?;
        }
        Ok(Self { tables })
    }

    /// Normalises the interleaved pixels of `rgb`, less those of `reference` if given, into
    /// `planes` (3, H, W).
    ///
    /// One table look-up for each value.
    ///
    /// # Errors
    /// [`ContactError::Length`] if `rgb` is no whole number of pixels, or another does not fit it.
    pub fn apply(
        &self,
        rgb: &[u8],
        reference: Option<&[u8]>,
        planes: &mut [f32],
    ) -> Result<(), ContactError> {
        let pixels = rgb.len() / 3;
        same_length("image (3 bytes a pixel)", pixels * 3, rgb.len())?;
        same_length("planes", rgb.len(), planes.len())?;
        if let Some(reference) = reference {
            same_length("reference (3 bytes a pixel)", rgb.len(), reference.len())?;
        }
        if pixels == 0 {
            return Ok(());
        }
        for (channel, (plane, table)) in planes.chunks_exact_mut(pixels).zip(&*self.tables).enumerate() {
            for (i, input) in plane.iter_mut().enumerate() {
                let at = 3 * i + channel;
                let from = reference.map_or(0, |reference| reference[at]);
                *input = table[LEVELS - 1 + usize::from(rgb[at]) - usize::from(from)];
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
    /// For an output that is the force itself.
    pub const IDENTITY: Self = Self { mean: 0.0, std: 1.0 };

    /// The inverse of a normalisation by mean and deviation of the forces, in N per pixel.
    ///
    /// # Errors
    /// [`ContactError::Setting`] for a mean not finite, or a deviation not positive and finite.
    pub fn new(mean: f32, std: f32) -> Result<Self, ContactError> {
        check(["mean of the force", "standard deviation of the force"], mean, std)?;
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

/// Checks a mean and a standard deviation, which messages call `names`.
fn check(names: [&'static str; 2], mean: f32, std: f32) -> Result<(), ContactError> {
    setting(names[0], "a finite number", mean.into(), mean.is_finite())?;
    setting(names[1], "a positive number", std.into(), std > 0.0 && std.is_finite())
}

#[cfg(test)]
mod tests;
