//! What can be wrong with a recording, each with the place, what was expected and what was found.

use std::fmt;
use std::io;
use std::path::PathBuf;

use meissner_engine::Sensor;

use crate::format::Format;
use crate::kind::Kind;

/// Where in the input something was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Byte of the file, counted from 0.
    Byte(u64),
    /// Byte `byte` of the decompressed content of the packet whose header stands at byte `packet` of the
    /// file.
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

/// Why a recording could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoError {
    /// The operating system refused a file.
    #[error("cannot {action} {}", path.display())]
    File {
        /// `open`, `read`, `create` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// A stream that was being read or written failed.
    #[error("{format}: cannot {action} at {place}")]
    Stream {
        /// The format being read or written.
        format: Format,
        /// `read` or `write`.
        action: &'static str,
        /// How far it had come.
        place: Place,
        /// Its reason.
        source: io::Error,
    },
    /// A name that stands for no format.
    #[error("unknown {what}: expected {expected}, found `{actual}`")]
    UnknownName {
        /// `format` or `file extension`.
        what: &'static str,
        /// The names that there are.
        expected: &'static str,
        /// The name that came.
        actual: String,
    },
    /// The content is of none of the formats.
    #[error(
        "unknown format: expected AEDAT4, EVT2, EVT3, DAT, N-MNIST, CSV or npy, found {length} bytes starting with {start}"
    )]
    UnknownFormat {
        /// Length of the content in bytes.
        length: u64,
        /// Its first bytes.
        start: String,
    },
    /// The content, or what was asked for, is known and not supported.
    #[error("unsupported: expected {expected}, found {actual}")]
    Unsupported {
        /// What is supported in its place.
        expected: &'static str,
        /// What came.
        actual: String,
    },
    /// The bytes end before something does.
    #[error("{format}: {what} at {place} is cut short: expected {expected} bytes, found {actual}")]
    Truncated {
        /// The format being read.
        format: Format,
        /// What is cut short.
        what: &'static str,
        /// Where it starts.
        place: Place,
        /// The bytes that it takes.
        expected: u64,
        /// The bytes that there are.
        actual: u64,
    },
    /// Something is there and is not what the format says.
    #[error("{format}: {what} at {place}: expected {expected}, found {actual}")]
    Malformed {
        /// The format being read.
        format: Format,
        /// What is malformed.
        what: &'static str,
        /// Where it is.
        place: Place,
        /// What the format says.
        expected: String,
        /// What is there.
        actual: String,
    },
    /// A length exceeds the bounds of [`crate::limits`].
    #[error("{format}: {what} at {place} is too large: expected at most {limit} bytes, found {actual}{}", if *.at_least { " or more" } else { "" })]
    TooLarge {
        /// The format being read.
        format: Format,
        /// What is too large.
        what: &'static str,
        /// Where it starts.
        place: Place,
        /// The bound.
        limit: u64,
        /// What it would take.
        actual: u64,
        /// Whether `actual` is where reading stopped, and not the full length.
        at_least: bool,
    },
    /// An event lies on a pixel that the recording's sensor does not have.
    #[error("{format}: pixel at {place}: expected x < {} and y < {}, found x = {x}, y = {y}", sensor.width, sensor.height)]
    OutsideSensor {
        /// The format being read.
        format: Format,
        /// Where the event is.
        place: Place,
        /// The sensor that the recording names.
        sensor: Sensor,
        /// The event's column.
        x: u32,
        /// The event's row.
        y: u32,
    },
    /// A text of events can be read in several ways, and neither it nor the caller says in which.
    #[error(
        "{format}: {what} at {place}: expected a text or options that say it, found {line}, which can be {readings}"
    )]
    Undecided {
        /// The format being read.
        format: Format,
        /// `order of the columns` or `unit of time`.
        what: &'static str,
        /// The first event's line.
        place: Place,
        /// The line, or its start.
        line: String,
        /// The ways, in words.
        readings: String,
    },
    /// The content is known, and of another kind.
    #[error("expected {expected}, found {found}")]
    OtherKind {
        /// What the reader reads.
        expected: &'static str,
        /// What came.
        found: Kind,
    },
    /// The format that was asked for cannot hold an event.
    #[error("{format} cannot hold event {index}: expected {field} {expected}, found {actual}")]
    CannotHold {
        /// The format to be written.
        format: Format,
        /// The event, counted from 0.
        index: usize,
        /// `t_us`, `x` or `y`.
        field: &'static str,
        /// What the format holds.
        expected: String,
        /// What the event has.
        actual: String,
    },
}

/// The first `most` characters of what a file says, for a message that is no longer than a person wants to read.
pub(crate) fn beginning(text: &str, most: usize) -> String {
    let mut characters = text.chars();
    let mut beginning: String = characters.by_ref().take(most).collect();
    if characters.next().is_some() {
        beginning.push_str("..");
    }
    beginning
}
