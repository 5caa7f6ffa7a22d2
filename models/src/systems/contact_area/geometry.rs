//! Sizes of images and of pixels, and places on them.

use super::error::{ContactError, setting};

/// Size of an image or a map in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSize {
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl ImageSize {
    /// The images that `CANFnet` reads: 320 x 240.
    pub const CANFNET: Self = Self { width: 320, height: 240 };

    /// Pixels of an image, at most (4 Mi): sums of 3 x 255 a pixel over a whole image stay within 32 bits.
    pub const MOST_PIXELS: usize = 4 << 20;

    /// Number of pixels, 1 to [`Self::MOST_PIXELS`].
    ///
    /// # Errors
    /// [`ContactError::Setting`] where there are none or more.
    pub fn pixels(self) -> Result<usize, ContactError> {
        let pixels = self.width.saturating_mul(self.height);
        let holds = (1..=Self::MOST_PIXELS).contains(&pixels);
        setting("pixels of an image", "1 to 4194304", pixels as f64, holds)?;
        Ok(pixels)
    }
}

/// What a pixel covers of the sensor's surface, in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelSize {
    x_mm: f64,
    y_mm: f64,
}

impl PixelSize {
    /// Pixels that are `x_mm` wide and `y_mm` high.
    ///
    /// # Errors
    /// [`ContactError::Setting`] where a side is not positive and finite.
    pub fn new(x_mm: f64, y_mm: f64) -> Result<Self, ContactError> {
        for (what, side) in [("width of a pixel (mm)", x_mm), ("height of a pixel (mm)", y_mm)] {
            setting(what, "a positive number", side, side > 0.0 && side.is_finite())?;
        }
        Ok(Self { x_mm, y_mm })
    }

    /// What `pixels` cover, in mm^2: pixels * (`x_mm` * `y_mm`).
    pub fn area_mm2(self, pixels: usize) -> f64 {
        pixels as f64 * (self.x_mm * self.y_mm)
    }

    /// The place at these pixel coordinates.
    pub(super) fn centroid(self, x_px: f64, y_px: f64) -> Centroid {
        Centroid { x_px, y_px, x_mm: x_px * self.x_mm, y_mm: y_px * self.y_mm }
    }
}

/// The middle of a contact.
///
/// The origin of both units is the centre of the image's top-left pixel; x runs along a row, y down a column.
#[derive(Clone, Copy, Debug, PartialEq)]
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
