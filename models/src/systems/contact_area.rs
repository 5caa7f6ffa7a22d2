//! Contact area and normal force from the images of an optical tactile sensor (`CANFnet`).
//!
//! The network maps an RGB image (3, 240, 320) to the normal force on each pixel's surface:
//!
//! - [`ImageNormalisation`] before it and [`ForceNormalisation`] after it,
//! - [`ContactMeter`]: from forces to a [`ContactReport`] (mask, area, force, median, centroid),
//! - [`DifferenceBaseline`]: area and centroid without a network, from an image without contact,
//! - [`iou`] and [`force_mae`]: the metrics that evaluate such maps,
//! - [`Overlay`]: draws forces, outline and centroid over the image.
//!
//! Images are row-major from the top left, a pixel's red, green and blue (`u8`) side by side; maps
//! have one value per pixel. Pixel coordinates are (column, row), the top-left centre (0, 0). Sums
//! have a fixed order: equal on every machine. Nothing is allocated after construction.

pub(crate) mod difference;
pub(crate) mod overlay;
pub(crate) mod report;

use serde::Serialize;
use thiserror::Error;

pub use difference::{DifferenceBaseline, DifferenceReport, DifferenceSettings};
pub use overlay::{ColourMap, Overlay, Picture};
pub use report::{ContactMeter, ContactReport, ContactSettings, RunningMedian, force_mae, iou};

/// A setting is out of range, or an image or map does not fit; `what` names it.
#[derive(Clone, Debug, PartialEq, Error)]
#[expect(missing_docs, reason = "the page of the enum and the messages explain the fields")]
#[non_exhaustive]
pub enum ContactError {
    /// A setting is out of range.
    #[error("{what}: expected {expected}, found {found}")]
    Setting { what: &'static str, expected: &'static str, found: f64 },
    /// A buffer has another length than the images.
    #[error("{what}: expected {expected} values, found {found}")]
    Length { what: &'static str, expected: usize, found: usize },
    /// A value of a map is NaN or infinite.
    #[error("{what}: expected finite values, found {found} at column {column}, row {row}")]
    NotFinite { what: &'static str, column: usize, row: usize, found: f32 },
}

fn same_length(what: &'static str, expected: usize, found: usize) -> Result<(), ContactError> {
    if found == expected { Ok(()) } else { Err(ContactError::Length { what, expected, found }) }
}

fn setting(what: &'static str, expected: &'static str, found: f64, holds: bool) -> Result<(), ContactError> {
    if holds { Ok(()) } else { Err(ContactError::Setting { what, expected, found }) }
}

/// Size of an image or a map in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSize {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl ImageSize {
    /// Maximum number of pixels of an image (4 Mi): sums of 3 x 255 per pixel stay within 32 bits.
    pub const MAX_PIXELS: usize = 4 << 20;

    /// Number of pixels, 1 to [`Self::MAX_PIXELS`].
    ///
    /// # Errors
    /// [`ContactError::Setting`] if there are none or more.
    pub fn pixels(self) -> Result<usize, ContactError> {
        let pixels = self.width.saturating_mul(self.height);
        let holds = (1..=Self::MAX_PIXELS).contains(&pixels);
        setting("pixels of an image", "1 to 4194304", pixels as f64, holds)?;
        Ok(pixels)
    }
}

/// Size of a pixel on the surface of the sensor, in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelSize {
    x_mm: f64,
    y_mm: f64,
}

impl PixelSize {
    /// Pixels that are `x_mm` wide and `y_mm` high.
    ///
    /// # Errors
    /// [`ContactError::Setting`] if a side is not positive and finite.
    pub fn new(x_mm: f64, y_mm: f64) -> Result<Self, ContactError> {
        for (what, side) in [("width of a pixel (mm)", x_mm), ("height of a pixel (mm)", y_mm)] {
            setting(what, "a positive number", side, side > 0.0 && side.is_finite())?;
        }
        Ok(Self { x_mm, y_mm })
    }

    /// Width and height.
    pub fn sides_mm(self) -> [f64; 2] {
        [self.x_mm, self.y_mm]
    }

    /// The area of `pixels` in mm^2: pixels * (`x_mm` * `y_mm`).
    pub fn area_mm2(self, pixels: usize) -> f64 {
        pixels as f64 * (self.x_mm * self.y_mm)
    }

    fn centroid(self, x_px: f64, y_px: f64) -> Centroid {
        Centroid { x_px, y_px, x_mm: x_px * self.x_mm, y_mm: y_px * self.y_mm }
    }
}

/// The middle of a contact.
///
/// Both units start at the centre of the top-left pixel; x runs along a row, y down a column.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Centroid {
    /// Column, in pixels.
    pub x_px: f64,
    /// Row, in pixels.
    pub y_px: f64,
    /// Along a row, in mm.
    pub x_mm: f64,
    /// Down a column, in mm.
    pub y_mm: f64,
}

const LEVELS: usize = 256;
/// Number of differences between two levels, from -255 to 255.
const DIFFERENCES: usize = 2 * LEVELS - 1;
const IMAGE_STD: &str = "standard deviation of the image";

/// Turns interleaved 8-bit RGB into the network's planar input.
///
/// As in the training of the networks: (v / 255 - mean) / std, where v is a level or its difference
/// from that of a reference. Each operation is rounded to f32, in this order.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageNormalisation {
    /// The input for each difference from -255 on, for each channel; a level is a difference from
    /// 0.
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

    /// Normalises the interleaved pixels of `rgb`, minus those of `reference` if given, into
    /// `planes` (3, H, W).
    ///
    /// One table look-up for each value.
    ///
    /// # Errors
    /// [`ContactError::Length`] if `rgb` is not a whole number of pixels, or another slice does not
    /// fit it.
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

/// Checks a mean and a standard deviation, which have the `names` in messages.
fn check(names: [&'static str; 2], mean: f32, std: f32) -> Result<(), ContactError> {
    setting(names[0], "a finite number", mean.into(), mean.is_finite())?;
    setting(names[1], "a positive number", std.into(), std > 0.0 && std.is_finite())
}
