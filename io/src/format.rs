//! The names of the formats, and the file extensions that stand for them.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use crate::error::IoError;

/// A format of recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// iniVation's container of packets (`.aedat4`).
    Aedat4,
    /// Prophesee EVT 2.0: words of 32 bits (`.evt2`, `.raw`).
    Evt2,
    /// Prophesee EVT 3.0: words of 16 bits (`.evt3`, `.raw`).
    Evt3,
    /// Prophesee DAT, version 2: 8 bytes an event (`.dat`).
    Dat,
    /// N-MNIST: 5 bytes an event, 34 x 34 pixels (`.bin`).
    Nmnist,
    /// Text, one event a line (`.csv`).
    Csv,
    /// `NumPy` structured array (`.npy`).
    Npy,
}

impl Format {
    /// Every format, in the order in which the documentation lists them.
    pub const ALL: [Self; 7] =
        [Self::Aedat4, Self::Evt2, Self::Evt3, Self::Dat, Self::Nmnist, Self::Csv, Self::Npy];

    /// The format that a file name's extension asks for, for outputs; `.raw` is EVT3.
    ///
    /// Inputs are told apart by their content ([`crate::detect()`]).
    ///
    /// # Errors
    /// [`IoError::UnknownName`] where the path has no extension, or one that stands for no format.
    pub fn from_path(path: &Path) -> Result<Self, IoError> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        match extension.to_ascii_lowercase().as_str() {
            "raw" => Ok(Self::Evt3),
            "bin" => Ok(Self::Nmnist),
            "nmnist" => Err(unknown("file extension", extension)),
            _ => extension.parse().map_err(|_| unknown("file extension", extension)),
        }
    }

    /// The usual extension of a file of this format, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Aedat4 => "aedat4",
            Self::Evt2 | Self::Evt3 => "raw",
            Self::Dat => "dat",
            Self::Nmnist => "bin",
            Self::Csv => "csv",
            Self::Npy => "npy",
        }
    }

    /// Whether [`crate::encode`] can write it.
    pub fn is_writable(self) -> bool {
        matches!(self, Self::Csv | Self::Npy | Self::Dat | Self::Evt3)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Aedat4 => "AEDAT4",
            Self::Evt2 => "EVT2",
            Self::Evt3 => "EVT3",
            Self::Dat => "DAT",
            Self::Nmnist => "N-MNIST",
            Self::Csv => "CSV",
            Self::Npy => "npy",
        })
    }
}

impl FromStr for Format {
    type Err = IoError;

    /// The format of this name, in upper or lower case: `aedat4`, `evt2`, `evt3`, `dat`, `nmnist`, `csv`,
    /// `npy`.
    fn from_str(name: &str) -> Result<Self, IoError> {
        match name.to_ascii_lowercase().as_str() {
            "aedat4" => Ok(Self::Aedat4),
            "evt2" => Ok(Self::Evt2),
            "evt3" => Ok(Self::Evt3),
            "dat" => Ok(Self::Dat),
            "nmnist" | "n-mnist" => Ok(Self::Nmnist),
            "csv" => Ok(Self::Csv),
            "npy" => Ok(Self::Npy),
            _ => Err(unknown("format", name)),
        }
    }
}

fn unknown(what: &'static str, actual: &str) -> IoError {
    let expected = match what {
        "format" => "aedat4, evt2, evt3, dat, nmnist, csv or npy",
        _ => "aedat4, evt2, evt3, raw, dat, bin, csv or npy",
    };
    IoError::UnknownName { what, expected, actual: actual.to_owned() }
}
