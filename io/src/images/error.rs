//! What can be wrong with an image or a sequence of them, each with the place, what was expected and what was found.

use std::io;
use std::path::PathBuf;

use super::format::ImageFormat;
use crate::error::Place;
use crate::kind::Kind;

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
        /// Its reason.
        source: io::Error,
    },
    /// A file was read, and its content is no image that can be had.
    #[error("image {}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with its content.
        source: Box<ImageError>,
    },
    /// The content is of none of the formats.
    #[error(
        "unknown image format: expected PNG, JPEG, binary PPM or PGM, found {length} bytes starting with {start}"
    )]
    UnknownFormat {
        /// Length of the content in bytes.
        length: u64,
        /// Its first bytes.
        start: String,
    },
    /// The bytes end before something does.
    #[error("{format}: {what} at {place} is cut short: expected {expected} bytes, found {actual}{}", if *.at_least { " and no end" } else { "" })]
    Truncated {
        /// The format being read.
        format: ImageFormat,
        /// What is cut short.
        what: &'static str,
        /// Where it starts.
        place: Place,
        /// The bytes that it takes, or one more than there are.
        expected: u64,
        /// The bytes that there are.
        actual: u64,
        /// Whether `expected` is only a lower bound, as of data whose end is marked and not counted.
        at_least: bool,
    },
    /// Something is there and is not what the format says.
    #[error("{format}: {what} at {place}: expected {expected}, found {actual}")]
    Malformed {
        /// The format being read.
        format: ImageFormat,
        /// What is malformed.
        what: &'static str,
        /// Where it is, or how far the reader had come.
        place: Place,
        /// What the format says.
        expected: String,
        /// What is there.
        actual: String,
    },
    /// A size exceeds the bounds of [`crate::limits`].
    #[error("{what}: expected at most {limit}, found {actual}")]
    TooLarge {
        /// What is too large, and its unit.
        what: &'static str,
        /// The bound.
        limit: u64,
        /// What it would take.
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
    /// A file is known, and no image.
    #[error("{}: expected a picture, a folder or a list of them, found {found}", path.display())]
    OtherKind {
        /// The file.
        path: PathBuf,
        /// What it is.
        found: Kind,
    },
    /// A folder or a list names no image.
    #[error("{}: expected at least one image ({expected}), found none", path.display())]
    NoImages {
        /// The folder or the list.
        path: PathBuf,
        /// What would have counted as one.
        expected: &'static str,
    },
    /// A list of paths is no text.
    #[error("{}: {place}: expected a path in UTF-8, found {actual}", path.display())]
    List {
        /// The list.
        path: PathBuf,
        /// The line.
        place: Place,
        /// What is there.
        actual: String,
    },
    /// Pixels to be written do not fill the image, or are too many for it.
    #[error(
        "expected {expected} bytes of RGB for {width}x{height} pixels (each side at least 1), found {actual}"
    )]
    Buffer {
        /// Width of the image.
        width: usize,
        /// Height of the image.
        height: usize,
        /// Bytes that it takes.
        expected: u64,
        /// Bytes that came.
        actual: u64,
    },
}
