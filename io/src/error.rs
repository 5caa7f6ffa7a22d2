//! Errors of all readers and writers: each has the place, the expected and the actual value.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use meissner_engine::Sensor;

use crate::format::{Format, Kind, UnknownName};

/// A position in the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Byte of the file, counted from 0.
    Byte(u64),
    /// Byte of the decompressed content of a packet.
    Packet {
        /// Byte of the file at which the packet's header starts.
        packet: u64,
        /// Byte of the packet's decompressed content.
        byte: u64,
    },
    /// Line of a text, counted from 1.
    Line(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(byte) => write!(f, "byte {byte}"),
            Self::Packet { packet, byte } => write!(f, "byte {byte} of the packet at byte {packet}"),
            Self::Line(line) => write!(f, "line {line}"),
        }
    }
}

/// Why a recording, readings of electrodes or an image could not be read or written.
///
/// `format` is the name of the format being read or written, as [`Format`] and [`ImageFormat`](crate::ImageFormat) show it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoError {
    /// The operating system refused a file or a folder.
    #[error("cannot {action} {}", path.display())]
    File {
        /// `open`, `read`, `list`, `create` or `write`.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// The content of a file cannot be read; the source has the place.
    #[error("cannot read {}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The fault of its content.
        source: Box<IoError>,
    },
    /// A file or folder does not fit into its sequence of images or its data set.
    #[error("{}: expected {expected}, found {actual}", path.display())]
    Unfit {
        /// The file or folder.
        path: PathBuf,
        /// The content, name or size that fits.
        expected: String,
        /// The content, name or size.
        actual: String,
    },
    /// Reading from or writing to a stream failed.
    #[error("{format}: cannot {action} at {place}")]
    Stream {
        /// Name of the format.
        format: &'static str,
        /// `read` or `write`.
        action: &'static str,
        /// The position reached.
        place: Place,
        /// The reader's or writer's reason.
        source: io::Error,
    },
    /// The name of a format, an order of columns or a unit is unknown.
    #[error(transparent)]
    UnknownName(#[from] UnknownName),
    /// The content has none of the formats.
    #[error("unknown {what}: expected {expected}, found {length} bytes starting with {start}")]
    UnknownFormat {
        /// `format` or `image format`.
        what: &'static str,
        /// The known formats.
        expected: &'static str,
        /// Length of the content in bytes.
        length: u64,
        /// Its first bytes.
        start: String,
    },
    /// The content or the request is known and not supported.
    #[error("unsupported: expected {expected}, found {actual}")]
    Unsupported {
        /// The supported alternatives.
        expected: &'static str,
        /// The content or the request.
        actual: String,
    },
    /// The input ends too early.
    #[error(
        "{format}: {what} at {place} is cut short: expected {expected} bytes, found {actual}{}",
        if *.at_least { " and no end" } else { "" }
    )]
    Truncated {
        /// Name of the format.
        format: &'static str,
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
        /// Name of the format.
        format: &'static str,
        /// The malformed part.
        what: &'static str,
        /// Where the part is, or the position reached.
        place: Place,
        /// The values that the format allows.
        expected: String,
        /// The value in the input.
        actual: String,
    },
    /// A length exceeds a bound of [`crate::limits`].
    #[error(
        "{format}: {what} at {place} is too large: expected at most {limit} {unit}, found {actual}{}",
        if *.at_least { " or more" } else { "" }
    )]
    TooLarge {
        /// Name of the format.
        format: &'static str,
        /// The part that is too large.
        what: &'static str,
        /// Where the part starts.
        place: Place,
        /// `bytes` or `pixels`.
        unit: &'static str,
        /// The bound.
        limit: u64,
        /// Size of the part.
        actual: u64,
        /// Whether reading stopped after `actual` bytes, so that the part may be longer.
        at_least: bool,
    },
    /// An event lies outside the recording's sensor.
    #[error("{format}: pixel at {place}: expected x < {} and y < {}, found x = {x}, y = {y}", sensor.width, sensor.height)]
    OutsideSensor {
        /// Name of the format.
        format: &'static str,
        /// Where the event is.
        place: Place,
        /// The sensor of the recording.
        sensor: Sensor,
        /// The event's column.
        x: u32,
        /// The event's row.
        y: u32,
    },
    /// A text of events can be read in several ways, and neither the text nor the options decide.
    #[error(
        "CSV: {what} at {place}: expected a text or options that say it, found {line}, which can be {readings}"
    )]
    Undecided {
        /// `order of the columns` or `unit of time`.
        what: &'static str,
        /// The first event's line.
        place: Place,
        /// The line, or its start.
        line: String,
        /// The possible readings, in words.
        readings: String,
    },
    /// The content is of another known kind.
    #[error("expected {expected}, found {found}")]
    OtherKind {
        /// The kind that the reader reads.
        expected: &'static str,
        /// The kind of the content.
        found: Kind,
    },
    /// The requested format cannot hold an event.
    #[error("{format} cannot hold event {index}: expected {field} {expected}, found {actual}")]
    CannotHold {
        /// The format to be written.
        format: Format,
        /// The event, counted from 0.
        index: usize,
        /// `t_us`, `x` or `y`.
        field: &'static str,
        /// The values that the format holds.
        expected: String,
        /// The event's value.
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

impl IoError {
    /// The error of the operating system for `action` on the file at `path`.
    pub(crate) fn file(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::File { action, path, source }
    }

    /// The error of the content of the file at `path`.
    pub(crate) fn content(path: &Path) -> impl FnOnce(Self) -> Self {
        let path = path.to_owned();
        move |source| match source {
            // This error has the path already.
            Self::File { .. } => source,
            _ => Self::Content { path, source: Box::new(source) },
        }
    }

    pub(crate) fn unfit(path: &Path, expected: impl Into<String>, actual: impl Into<String>) -> Self {
        Self::Unfit { path: path.to_owned(), expected: expected.into(), actual: actual.into() }
    }
}

/// The first `most` characters of a text for a message.
pub(crate) fn beginning(text: &str, most: usize) -> String {
    let mut characters = text.chars();
    let mut beginning: String = characters.by_ref().take(most).collect();
    if characters.next().is_some() {
        beginning.push_str("..");
    }
    beginning
}

/// The first 40 bytes of a field for a message, quoted and escaped.
pub(crate) fn shown(field: &[u8]) -> String {
    const MOST: usize = 40;
    let dots = if field.len() > MOST { ".." } else { "" };
    format!("`{}{dots}`", field[..field.len().min(MOST)].escape_ascii())
}
