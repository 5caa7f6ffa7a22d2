//! The decoded image, and the errors of images and sequences of images: each has the place, the expected and the actual value.

use std::io;
use std::path::PathBuf;

use crate::error::Place;
use crate::format::{ImageFormat, Kind};
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

/// The number of pixels of an image; an error beyond [`IMAGE_PIXELS`].
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

/// Why an image could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The operating system refused a file.
    #[error("cannot {action} {}", path.display())]
    File {
        /// `open`, `read`, `list` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// The content of a file is not a valid image.
    #[error("image {}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The fault of its content.
        source: Box<ImageError>,
    },
    /// The content has none of the formats.
    #[error(
        "unknown image format: expected PNG, JPEG, binary PPM or PGM, found {length} bytes starting with {start}"
    )]
    UnknownFormat {
        /// Length of the content in bytes.
        length: u64,
        /// Its first bytes.
        start: String,
    },
    /// The input ends too early.
    #[error("{format}: {what} at {place} is cut short: expected {expected} bytes, found {actual}{}", if *.at_least { " and no end" } else { "" })]
    Truncated {
        /// The format being read.
        format: ImageFormat,
        /// The part that is cut short.
        what: &'static str,
        /// Where the part starts.
        place: Place,
        /// Length of the part in bytes, or one more than the bytes present.
        expected: u64,
        /// Bytes present.
        actual: u64,
        /// Whether `expected` is only a lower bound, as for data with an end marker in place of a length.
        at_least: bool,
    },
    /// The content contradicts the format.
    #[error("{format}: {what} at {place}: expected {expected}, found {actual}")]
    Malformed {
        /// The format being read.
        format: ImageFormat,
        /// The malformed part.
        what: &'static str,
        /// Where the part is, or the position reached.
        place: Place,
        /// The values that the format allows.
        expected: String,
        /// The value in the input.
        actual: String,
    },
    /// A size exceeds the bounds of [`crate::limits`].
    #[error("{what}: expected at most {limit}, found {actual}")]
    TooLarge {
        /// The quantity that is too large, with its unit.
        what: &'static str,
        /// The bound.
        limit: u64,
        /// The size of the input.
        actual: u64,
    },
    /// An image of a sequence has another size than the first.
    #[error(
        "{}: expected {}x{} pixels as in the first image, found {}x{}",
        path.display(), expected.0, expected.1, found.0, found.1
    )]
    Size {
        /// The file.
        path: PathBuf,
        /// Width and height of the first image.
        expected: (usize, usize),
        /// Width and height of this one.
        found: (usize, usize),
    },
    /// A file has another known kind.
    #[error("{}: expected a picture, a folder or a list of them, found {found}", path.display())]
    OtherKind {
        /// The file.
        path: PathBuf,
        /// Its kind.
        found: Kind,
    },
    /// A folder or a list has no image.
    #[error("{}: expected at least one image ({expected}), found none", path.display())]
    NoImages {
        /// The folder or the list.
        path: PathBuf,
        /// The entries that count as images.
        expected: &'static str,
    },
    /// A list of paths is not text.
    #[error("{}: {place}: expected a path in UTF-8, found {actual}", path.display())]
    List {
        /// The list.
        path: PathBuf,
        /// The line.
        place: Place,
        /// The line, or its start.
        actual: String,
    },
    /// Pixels to be written do not have the image's size.
    #[error(
        "expected {expected} bytes of RGB for {width}x{height} pixels (each side at least 1), found {actual}"
    )]
    Buffer {
        /// Width of the image.
        width: usize,
        /// Height of the image.
        height: usize,
        /// Bytes of such an image.
        expected: u64,
        /// Bytes given.
        actual: u64,
    },
}

impl ImageError {
    pub(super) fn malformed(
        format: ImageFormat,
        what: &'static str,
        at: usize,
        expected: impl Into<String>,
        actual: impl ToString,
    ) -> Self {
        let (place, expected, actual) = (Place::Byte(at as u64), expected.into(), actual.to_string());
        Self::Malformed { format, what, place, expected, actual }
    }

    /// The part at byte `at` of an input of `length` bytes is cut short; `at_least`: it has no known length.
    pub(super) fn truncated(
        format: ImageFormat,
        what: &'static str,
        at: usize,
        expected: u64,
        length: usize,
        at_least: bool,
    ) -> Self {
        let (place, actual) = (Place::Byte(at as u64), (length - at) as u64);
        Self::Truncated { format, what, place, expected, actual, at_least }
    }
}
