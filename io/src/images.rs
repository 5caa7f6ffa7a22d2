//! Images: bytes to interleaved 8-bit RGB, and RGB to PNG.
//!
//! | format | reads | writes |
//! |---|---|---|
//! | PNG, any colour type and depth, interlaced or not | yes | 8-bit RGB |
//! | PPM and PGM, binary (`P6`, `P5`), 8 and 16 bits | yes | |
//! | JPEG, baseline and progressive | yes | |
//!
//! The format is found from the content; a raw video ([`RawVideo`]) has no format, so the caller
//! must give its properties. Grey is repeated in the three channels; alpha is dropped, not blended.
//! A sample v of the range 0..=m becomes round(255 v / m). Gamma, colour profiles and the camera's
//! orientation are ignored.
//!
//! Invariant: a file that is cut short or corrupt gives an [`IoError`] with the place; an image of
//! more than [`crate::limits::IMAGE_PIXELS`] is refused before it is allocated.

mod jpeg;
mod png;
mod pnm;
mod video;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::bytes::Bytes;
use crate::error::{IoError, shown};
use crate::format::ImageFormat;
use crate::limits::{IMAGE_BYTES, IMAGE_PIXELS};
pub use png::{encode_palette_png, encode_png, write_png};
pub use video::{PixelFormat, RawVideo, VideoFormat};

/// Reads the image of the file at `path`.
///
/// # Errors
/// [`IoError::File`] if the file cannot be read, [`IoError::Content`] with its path and the
/// errors of [`decode_image`] if its content is malformed or longer than [`IMAGE_BYTES`].
pub fn read_image(path: &Path) -> Result<Image, IoError> {
    decode_image(&read_bounded(path)?).map_err(IoError::content(path))
}

/// Decodes `bytes`, the whole content of an image file.
///
/// # Errors
/// [`IoError::UnknownFormat`], or [`IoError::Truncated`], [`IoError::Malformed`] and
/// [`IoError::TooLarge`] if the content is malformed.
pub fn decode_image(bytes: &[u8]) -> Result<Image, IoError> {
    let Some(format) = ImageFormat::detect(bytes) else {
        let (length, start) = (bytes.len() as u64, shown(&bytes[..bytes.len().min(8)]));
        let expected = "PNG, JPEG, binary PPM or PGM";
        return Err(IoError::UnknownFormat { what: "image format", expected, length, start });
    };
    let file = Bytes::file(format.name(), bytes);
    match format {
        ImageFormat::Png => png::decode(file),
        ImageFormat::Jpeg => jpeg::decode(file),
        ImageFormat::Pnm => pnm::decode(file),
    }
}

/// The bytes of a file, at most [`IMAGE_BYTES`].
pub(crate) fn read_bounded(path: &Path) -> Result<Vec<u8>, IoError> {
    let file = File::open(path).map_err(IoError::file("open", path))?;
    let mut bytes = Vec::new();
    // The length that the file system reports may be wrong, so the bytes read are counted.
    file.take(IMAGE_BYTES + 1).read_to_end(&mut bytes).map_err(IoError::file("read", path))?;
    let actual = bytes.len() as u64;
    if actual > IMAGE_BYTES {
        let error = Bytes::file("image", &bytes).too_large("file", 0, IMAGE_BYTES, actual, true);
        return Err(IoError::content(path)(error));
    }
    Ok(bytes)
}

/// An RGB image of 8 bits per channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels of a row; at least 1.
    pub width: usize,
    /// Rows; at least 1.
    pub height: usize,
    /// `height` x `width` x 3 bytes: row-major from the top left; red, green and blue of a pixel
    /// side by side.
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
pub(crate) fn pixels(file: Bytes<'_>, width: u64, height: u64) -> Result<usize, IoError> {
    let (limit, actual) = (IMAGE_PIXELS, width.saturating_mul(height));
    if actual > limit {
        let (format, what, place, unit) = (file.format, "image", file.origin, "pixels");
        return Err(IoError::TooLarge { format, what, place, unit, limit, actual, at_least: false });
    }
    Ok(actual as usize)
}

/// The big-endian sample in one or two bytes.
fn sample(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |value, &byte| value << 8 | u32::from(byte))
}

/// round(255 v / m), halves upwards, for v from 0 to m.
fn to_8_bits(v: u32, m: u32) -> u8 {
    ((v * 255 + m / 2) / m) as u8
}
