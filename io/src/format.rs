//! The names of everything that this crate reads and writes: formats of recordings and images,
//! kinds of input, and the fields of an event.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

/// Names of the time in microseconds in headers of texts and of npy, in lower case.
pub(crate) const TIME: &[&str] =
    &["t", "t_us", "ts", "ts_us", "time", "time_us", "timestamp", "timestamp_us"];
/// Names of the pixel's column.
pub(crate) const X: &[&str] = &["x"];
/// Names of the pixel's row.
pub(crate) const Y: &[&str] = &["y"];
/// Names of the polarity.
pub(crate) const POLARITY: &[&str] = &["p", "pol", "polarity", "on"];

/// Names of the fields of an event, in lower case and with the preferred one first: time in
/// microseconds, column, row, polarity. Files and arrays of events use the same names.
pub const EVENT_FIELDS: [&[&str]; 4] = [TIME, X, Y, POLARITY];

/// The first `most` characters of a text for a message.
pub(crate) fn beginning(text: &str, most: usize) -> String {
    let mut characters = text.chars();
    let mut beginning: String = characters.by_ref().take(most).collect();
    if characters.next().is_some() {
        beginning.push_str("..");
    }
    beginning
}

/// A name that is not one of the known names.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown {what}: expected {expected}, found `{actual}`")]
#[non_exhaustive]
pub struct UnknownName {
    /// `format`, `file extension`, `order of columns`, `unit of time` or `pixel format`.
    pub what: &'static str,
    /// The known names.
    pub expected: &'static str,
    /// The given name, or its first 80 characters.
    pub actual: String,
}

impl UnknownName {
    pub(crate) fn new(what: &'static str, expected: &'static str, actual: &str) -> Self {
        Self { what, expected, actual: beginning(actual, 80) }
    }
}

/// A format of recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// iniVation's container of packets (`.aedat4`).
    Aedat4,
    /// AEDAT 3.1, the container of cAER, as in DVS Gesture (`.aedat`).
    Aedat3,
    /// AEDAT 2.0, the format of jAER: 8 bytes per event (`.aedat`).
    Aedat2,
    /// Prophesee EVT 2.0: words of 32 bits (`.evt2`, `.raw`).
    Evt2,
    /// Prophesee EVT 2.1: words of 64 bits, each of up to 32 events of a row (`.evt21`, `.raw`).
    Evt21,
    /// Prophesee EVT 3.0: words of 16 bits (`.evt3`, `.raw`).
    Evt3,
    /// Prophesee DAT, version 2: 8 bytes per event (`.dat`).
    Dat,
    /// Event Stream 2: 5 bytes per event (`.es`).
    Es,
    /// N-MNIST: 5 bytes per event, 34 x 34 pixels (`.bin`).
    Nmnist,
    /// Text, one event per line (`.csv`).
    Csv,
    /// `NumPy` structured array (`.npy`).
    Npy,
    /// HDF5 of DSEC and Prophesee (`.h5`, `.hdf5`); read if this crate has its feature `hdf5`.
    Hdf5,
    /// The container of ROS 2 and Foxglove, with packets of events (`.mcap`).
    Mcap,
}

impl Format {
    /// Every format, in the order of the documentation.
    pub const ALL: [Self; 13] = [
        Self::Aedat4,
        Self::Aedat3,
        Self::Aedat2,
        Self::Evt2,
        Self::Evt21,
        Self::Evt3,
        Self::Dat,
        Self::Es,
        Self::Nmnist,
        Self::Csv,
        Self::Npy,
        Self::Hdf5,
        Self::Mcap,
    ];

    /// The name for people.
    pub(crate) const fn name(self) -> &'static str {
        self.names()[0]
    }

    /// The name for people, the name for options, and the usual file extension.
    const fn names(self) -> [&'static str; 3] {
        match self {
            Self::Aedat4 => ["AEDAT4", "aedat4", "aedat4"],
            Self::Aedat3 => ["AEDAT3", "aedat3", "aedat"],
            Self::Aedat2 => ["AEDAT2", "aedat2", "aedat"],
            Self::Evt2 => ["EVT2", "evt2", "raw"],
            Self::Evt21 => ["EVT2.1", "evt21", "raw"],
            Self::Evt3 => ["EVT3", "evt3", "raw"],
            Self::Dat => ["DAT", "dat", "dat"],
            Self::Es => ["ES", "es", "es"],
            Self::Nmnist => ["N-MNIST", "nmnist", "bin"],
            Self::Csv => ["CSV", "csv", "csv"],
            Self::Npy => ["npy", "npy", "npy"],
            Self::Hdf5 => ["HDF5", "hdf5", "h5"],
            Self::Mcap => ["MCAP", "mcap", "mcap"],
        }
    }

    /// The format for an output with this file name, by its extension in upper or lower case;
    /// `.raw` is EVT3.
    ///
    /// The format of an input is found from its content ([`crate::detect()`]).
    ///
    /// # Errors
    /// [`UnknownName`] if the path has no extension, or an unknown one.
    pub fn from_path(path: &Path) -> Result<Self, UnknownName> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let lower = extension.to_ascii_lowercase();
        let found = match lower.as_str() {
            "raw" => Some(Self::Evt3),
            "nmnist" => None,
            lower => Self::ALL.into_iter().find(|format| format.names()[1..].contains(&lower)),
        };
        let expected = "aedat4, aedat, evt2, evt21, evt3, raw, dat, es, bin, csv, npy, h5, hdf5 or mcap";
        found.ok_or_else(|| UnknownName::new("file extension", expected, extension))
    }

    /// The usual extension of a file of this format, without the dot.
    pub fn extension(self) -> &'static str {
        self.names()[2]
    }

    /// Whether [`crate::encode`] can write it.
    pub fn is_writable(self) -> bool {
        matches!(self, Self::Aedat4 | Self::Csv | Self::Npy | Self::Dat | Self::Evt3 | Self::Es | Self::Mcap)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Format {
    type Err = UnknownName;

    /// The format of this name, in upper or lower case: `aedat4`, `aedat3`, `aedat2`, `evt2`,
    /// `evt21`, `evt3`, `dat`, `es`, `nmnist` or `n-mnist`, `csv`, `npy`, `hdf5`,
    /// `mcap`.
    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let is_named =
            |format: &Self| format.names()[..2].iter().any(|known| name.eq_ignore_ascii_case(known));
        let expected = "aedat4, aedat3, aedat2, evt2, evt21, evt3, dat, es, nmnist, csv, npy, hdf5 or mcap";
        Self::ALL.into_iter().find(is_named).ok_or_else(|| UnknownName::new("format", expected, name))
    }
}

/// A format of images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ImageFormat {
    /// Portable Network Graphics (`.png`).
    Png,
    /// JPEG (`.jpg`, `.jpeg`).
    Jpeg,
    /// Binary PPM and PGM (`.ppm`, `.pgm`, `.pnm`).
    Pnm,
}

impl ImageFormat {
    /// The name for people.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Pnm => "PNM",
        }
    }

    /// The format of a file that starts with `bytes`; the first three bytes decide.
    pub fn detect(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [0x89, b'P', b'N', ..] => Some(Self::Png),
            [0xff, 0xd8, 0xff, ..] => Some(Self::Jpeg),
            [b'P', b'5' | b'6', byte, ..] if byte.is_ascii_whitespace() || *byte == b'#' => Some(Self::Pnm),
            _ => None,
        }
    }

    /// The format of a file name's extension, in upper or lower case.
    pub fn from_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "png" => Some(Self::Png),
            "jpg" | "jpeg" => Some(Self::Jpeg),
            "ppm" | "pgm" | "pnm" => Some(Self::Pnm),
            _ => None,
        }
    }
}

impl fmt::Display for ImageFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A kind of input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// Events of a camera, for [`crate::read`].
    Events(Format),
    /// CSV with a column for each electrode, for [`crate::Electrodes`].
    Electrodes,
    /// A picture, for [`crate::read_image`].
    Picture(ImageFormat),
    /// A folder; [`crate::ImageSequence`] reads its pictures.
    Folder,
    /// A known format that this crate does not read.
    Foreign(Foreign),
}

/// A known format that this crate does not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Foreign {
    /// Its name.
    pub name: &'static str,
    /// How to convert it to a format that can be read.
    pub instead: &'static str,
}

impl Kind {
    /// The kind that readers of recordings expect, in words.
    pub(crate) const EVENTS: &'static str = "a recording of events";
    /// The kind that readers of electrodes expect, in words.
    pub(crate) const ELECTRODES: &'static str = "readings of electrodes";
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Events(format) => write!(f, "{} ({format})", Self::EVENTS),
            Self::Electrodes => write!(f, "{} (CSV)", Self::ELECTRODES),
            Self::Picture(format) => write!(f, "a picture ({format})"),
            Self::Folder => f.write_str("a folder"),
            Self::Foreign(Foreign { name, instead }) => write!(f, "{name}, which is not read: {instead}"),
        }
    }
}
