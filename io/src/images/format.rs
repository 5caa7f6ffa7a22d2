//! The names of the image formats, and how their content starts.

use std::fmt;
use std::path::Path;

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
    /// The format of a file that starts with `bytes`; three bytes decide.
    pub fn detect(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [0x89, b'P', b'N', ..] => Some(Self::Png),
            [0xff, 0xd8, 0xff, ..] => Some(Self::Jpeg),
            [b'P', b'5' | b'6', byte, ..] if byte.is_ascii_whitespace() || *byte == b'#' => Some(Self::Pnm),
            _ => None,
        }
    }

    /// The format that a file name's extension stands for, in upper or lower case.
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
        f.pad(match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Pnm => "PNM",
        })
    }
}
