//! The decoded image, and its bounds.

use crate::bytes::Bytes;
use crate::error::IoError;
use crate::limits::IMAGE_PIXELS;

/// An RGB image of 8 bits a channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels of a row; at least 1.
    pub width: usize,
    /// Rows; at least 1.
    pub height: usize,
    /// `height` x `width` x 3 bytes: row-major from the top left; red, green and blue of a pixel side by side.
    pub data: Vec<u8>,
}

impl Image {
    /// Channels of every image: red, green, blue.
    pub const CHANNELS: usize = 3;

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }
}

/// The number of pixels of the image in `file`; an error beyond [`IMAGE_PIXELS`].
pub(super) fn pixels(file: Bytes<'_>, width: u64, height: u64) -> Result<usize, IoError> {
    let (limit, actual) = (IMAGE_PIXELS, width.saturating_mul(height));
    if actual > limit {
        let (format, what, place, unit) = (file.format, "image", file.origin, "pixels");
        return Err(IoError::TooLarge { format, what, place, unit, limit, actual, at_least: false });
    }
    Ok(actual as usize)
}

/// The big-endian sample in one or two bytes.
pub(super) fn sample(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |value, &byte| value << 8 | u32::from(byte))
}

/// round(255 v / m), halves upwards, for v from 0 to m.
pub(super) fn to_8_bits(v: u32, m: u32) -> u8 {
    ((v * 255 + m / 2) / m) as u8
}
