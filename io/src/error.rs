//! Errors of all readers and writers: each contains the place, the expected and the actual value.

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
    /// Event of an array, counted from 0.
    Event(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(byte) => write!(f, "byte {byte}"),
            Self::Packet { packet, byte } => write!(f, "byte {byte} of the packet at byte {packet}"),
            Self::Line(line) => write!(f, "line {line}"),
            Self::Event(event) => write!(f, "event {event}"),
        }
    }
}

/// The reason why a recording, readings of electrodes or an image could not be read or written.
///
/// `format` is the name of the format being read or written, as [`Format`] and
/// [`ImageFormat`](crate::ImageFormat) show it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum IoError {
    /// The operating system refused a file or a folder.
    #[error("cannot {action} {}", path.display())]
    File {
        /// `open`, `read`, `list`, `create` or `write`.
        action: &'static str,
        path: PathBuf,
        source: io::Error,
    },
    /// The content of a file cannot be read; the source has the place.
    #[error("cannot read {}", path.display())]
    Content { path: PathBuf, source: Box<IoError> },
    /// A file or folder does not fit into its sequence of images or its data set.
    #[error("{}: expected {expected}, found {actual}", path.display())]
    Unfit { path: PathBuf, expected: String, actual: String },
    /// A datagram, or a part of one, is not an event; the next part is read as if this one had not
    /// arrived.
    #[error("datagram {number}")]
    Datagram {
        /// Number of the datagram, counted from 1.
        number: u64,
        source: Box<IoError>,
    },
    /// A word of a raw stream is left out.
    #[error("{format}: word at {place}: expected a known one, or an event on the sensor, found {word:#x}")]
    Word { format: &'static str, place: Place, word: u64 },
    /// Bytes of a raw stream were lost; reading continues with the next word that is in step.
    #[error("{format}: bytes were lost before {place}: {events} events are left out")]
    Lost {
        format: &'static str,
        /// Place where the loss was detected.
        place: Place,
        /// Events that were read out of step, or have lost their time or place.
        events: u64,
    },
    /// The connection of a stream was cut and made again.
    #[error("the connection was cut: what was sent before it was there again is lost")]
    Cut,
    /// Reading from or writing to a stream failed.
    #[error("{format}: cannot {action} at {place}")]
    Stream {
        format: &'static str,
        /// `read` or `write`.
        action: &'static str,
        place: Place,
        source: io::Error,
    },
    /// The name of a format, an order of columns or a unit is unknown.
    #[error(transparent)]
    UnknownName(#[from] UnknownName),
    /// The content has none of the formats.
    #[error("unknown {what}: expected {expected}, found {}", length_and_start(*length, start))]
    UnknownFormat {
        /// `format` or `image format`.
        what: &'static str,
        expected: &'static str,
        length: u64,
        start: String,
    },
    /// The content or the request is known and not supported.
    #[error("unsupported: expected {expected}, found {actual}")]
    Unsupported { expected: &'static str, actual: String },
    /// The input ends too early.
    #[error(
        "{format}: {what} at {place} is cut short: expected {expected} bytes, found {actual}{}",
        if *.at_least { " and no end" } else { "" }
    )]
    Truncated {
        format: &'static str,
        what: &'static str,
        place: Place,
        /// Length of the part in bytes, or one more than the bytes present.
        expected: u64,
        actual: u64,
        /// Whether `expected` is only a lower bound, as for data with an end marker.
        at_least: bool,
    },
    /// The content contradicts the format.
    #[error("{format}: {what} at {place}: expected {expected}, found {actual}")]
    Malformed { format: &'static str, what: &'static str, place: Place, expected: String, actual: String },
    /// A length exceeds a bound of [`crate::limits`].
    #[error(
        "{format}: {what} at {place} is too large: expected at most {limit} {unit}, found {actual}{}",
        if *.at_least { " or more" } else { "" }
    )]
    TooLarge {
        format: &'static str,
        what: &'static str,
        place: Place,
        /// `bytes`, `pixels` or `events`.
        unit: &'static str,
        limit: u64,
        actual: u64,
        /// Whether reading stopped after `actual` bytes, so that the part may be longer.
        at_least: bool,
    },
    /// An event lies outside the recording's sensor.
    #[error("{format}: pixel at {place}: expected x < {} and y < {}, found x = {x}, y = {y}", sensor.width, sensor.height)]
    OutsideSensor { format: &'static str, place: Place, sensor: Sensor, x: u32, y: u32 },
    /// A text of events can be read in several ways, and neither the text nor the options decide.
    #[error(
        "CSV: {what} at {place}: expected a text or options that say it, found {line}, which can be {readings}"
    )]
    Undecided {
        /// `order of the columns` or `unit of time`.
        what: &'static str,
        place: Place,
        line: String,
        readings: String,
    },
    /// Most of the first lines of a text are not events.
    #[error("expected events in most lines, found that {refused} of the first {lines} lines are refused")]
    Lines {
        /// Number of refused lines among the first lines.
        refused: u64,
        lines: u64,
        /// The reason why the first of them is refused.
        #[source]
        first: Box<IoError>,
    },
    /// The content is of another known kind.
    #[error("expected {expected}, found {found}")]
    OtherKind { expected: &'static str, found: Kind },
    /// The requested format cannot hold an event.
    #[error("{format} cannot hold event {index}: expected {field} {expected}, found {actual}")]
    CannotHold {
        format: Format,
        /// The event, counted from 0.
        index: usize,
        /// `t_us`, `x` or `y`.
        field: &'static str,
        expected: String,
        actual: String,
    },
    /// Pixels to be written do not have the image's size.
    #[error("expected {expected} bytes for {width}x{height} pixels (each side at least 1), found {actual}")]
    Buffer { width: usize, height: usize, expected: u64, actual: u64 },
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

    /// Whether the error is about one line of a text, a part of a datagram or a similar part, after
    /// which reading continues. The part is not an event, or an event outside the sensor.
    pub fn is_about_a_line(&self) -> bool {
        matches!(
            self,
            Self::Datagram { .. }
                | Self::Word { .. }
                | Self::Lost { .. }
                | Self::Cut
                | Self::Malformed { place: Place::Line(_), .. }
                | Self::OutsideSensor { place: Place::Line(_), .. }
        )
    }

    pub(crate) fn unfit(path: &Path, expected: impl Into<String>, actual: impl Into<String>) -> Self {
        Self::Unfit { path: path.to_owned(), expected: expected.into(), actual: actual.into() }
    }
}

/// A description of a content of `length` bytes that starts with `start`.
fn length_and_start(length: u64, start: &str) -> String {
    match length {
        0 => "nothing: it is empty".to_owned(),
        1 => format!("one byte: {start}"),
        _ => format!("{length} bytes starting with {start}"),
    }
}

/// The first 40 bytes of a field for a message, quoted and escaped.
pub(crate) fn shown(field: &[u8]) -> String {
    const MAX: usize = 40;
    let dots = if field.len() > MAX { ".." } else { "" };
    format!("`{}{dots}`", field[..field.len().min(MAX)].escape_ascii())
}
