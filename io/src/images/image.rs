//! The image, and the way to it from a file or from bytes.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::error::ImageError;
use super::format::ImageFormat;
use super::{jpeg, png, pnm};
use crate::limits::{IMAGE_BYTES, IMAGE_PIXELS};

/// An RGB image of 8 bits a channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels of a row; at least 1.
    pub width: usize,
    /// Rows; at least 1.
    pub height: usize,
    /// `height` x `width` x 3 bytes: row-major from the top left, red, green and blue of a pixel side by side.
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

/// Reads the image of the file at `path`.
///
/// # Errors
/// [`ImageError::File`] where the file cannot be read, [`ImageError::Content`] with its path and the errors of
/// [`decode_image`] where its content is at fault or longer than [`IMAGE_BYTES`].
pub fn read_image(path: &Path) -> Result<Image, ImageError> {
    let bytes = read_bounded(path)?;
    decode_image(&bytes)
        .map_err(|source| ImageError::Content { path: path.to_owned(), source: Box::new(source) })
}

/// Decodes the image that the file content `bytes` is.
///
/// # Errors
/// [`ImageError::UnknownFormat`], or [`ImageError::Truncated`], [`ImageError::Malformed`] and
/// [`ImageError::TooLarge`] where the content is at fault.
pub fn decode_image(bytes: &[u8]) -> Result<Image, ImageError> {
    match ImageFormat::detect(bytes) {
        Some(ImageFormat::Png) => png::decode(bytes),
        Some(ImageFormat::Jpeg) => jpeg::decode(bytes),
        Some(ImageFormat::Pnm) => pnm::decode(bytes),
        None => Err(ImageError::UnknownFormat {
            length: bytes.len() as u64,
            start: format!("`{}`", bytes[..bytes.len().min(8)].escape_ascii()),
        }),
    }
}

/// The bytes of a file, [`IMAGE_BYTES`] at most.
pub(super) fn read_bounded(path: &Path) -> Result<Vec<u8>, ImageError> {
    let refused = |action| move |source| ImageError::File { action, path: path.to_owned(), source };
    let file = File::open(path).map_err(refused("open"))?;
    let mut bytes = Vec::new();
    // The length that the file system reports may be anything: what arrives is counted.
    file.take(IMAGE_BYTES + 1).read_to_end(&mut bytes).map_err(refused("read"))?;
    let actual = bytes.len() as u64;
    if actual > IMAGE_BYTES {
        let source = Box::new(ImageError::TooLarge { what: "bytes of a file", limit: IMAGE_BYTES, actual });
        return Err(ImageError::Content { path: path.to_owned(), source });
    }
    Ok(bytes)
}

/// The number of pixels of an image, where it is not beyond [`IMAGE_PIXELS`].
pub(super) fn pixels(width: u64, height: u64) -> Result<usize, ImageError> {
    let actual = width.saturating_mul(height);
    if actual > IMAGE_PIXELS {
        return Err(ImageError::TooLarge { what: "pixels of an image", limit: IMAGE_PIXELS, actual });
    }
    Ok(actual as usize)
}

/// round(255 v / m), halves upwards, for v from 0 to m.
pub(super) fn to_8_bits(v: u32, m: u32) -> u8 {
    ((v * 255 + m / 2) / m) as u8
}
