//! The kind of an input, from its first bytes.
//!
//! AEDAT, Event Stream, npy and pictures start with a magic number. Prophesee's files have a text
//! header that names the encoding. A text contains electrodes if its header names electrodes, and
//! events if it has a header of events or a first line of four numbers; any other text with a comma
//! in its first line is tried as events, unless it begins like JSON. N-MNIST has no mark and is
//! tried last.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::csv::columns::{is_csv, is_of_events};
use crate::electrodes::header::names_electrodes;
use crate::error::{IoError, shown};
use crate::format::{Foreign, Format, ImageFormat, Kind, beginning};
#[cfg(feature = "hdf5")]
use crate::hdf5;
use crate::prophesee::{Header, has_header};
use crate::text::{content_lines, is_json, text_start};
use crate::{aedat2, aedat3, aedat4, es, nmnist, npy};

/// The formats whose files start with a mark.
const MARKS: &[(&[u8], Format)] = &[
    (aedat4::header::MAGIC, Format::Aedat4),
    (aedat3::MAGIC, Format::Aedat3),
    (aedat2::MAGIC, Format::Aedat2),
    (es::MAGIC, Format::Es),
    (npy::MAGIC, Format::Npy),
    (b"\x89MCAP", Format::Mcap),
    #[cfg(feature = "hdf5")]
    (hdf5::MAGIC, Format::Hdf5),
];

/// Maximum bytes of a file that [`Kind::of_file`] reads: complete events of N-MNIST.
pub(crate) const START: u64 = 5 << 14;

impl Kind {
    /// The kind of a file that starts with `bytes`: the whole file, or at least its first 4 KiB.
    /// `None`: unknown.
    ///
    /// A gzip file and a zip archive are foreign here: [`crate::read`] and [`crate::decode`] unpack
    /// them. A text that contains neither clearly events nor clearly electrodes, such as a list of
    /// pictures or JSON, is unknown. O(1), for N-MNIST O(n).
    pub fn of(bytes: &[u8]) -> Option<Self> {
        let marked = MARKS.iter().find(|(mark, _)| bytes.starts_with(mark));
        if let Some(&(_, format)) = marked {
            return Some(Self::Events(format));
        }
        if let Some(format) = ImageFormat::detect(bytes) {
            return Some(Self::Picture(format));
        }
        if let Some(foreign) = foreign(bytes) {
            return Some(Self::Foreign(foreign));
        }
        if has_header(bytes) {
            match Header::scan(bytes).encoding() {
                Some(Ok(format)) => return Some(Self::Events(format)),
                Some(Err(_)) => return None,
                // The comments of a text may start like this header.
                None => {}
            }
        }
        let line = text_start(bytes).and_then(|text| content_lines(text).next());
        if let Some(line) = line.filter(|line| !is_json(line)) {
            if names_electrodes(line) {
                return Some(Self::Electrodes);
            }
            if is_of_events(line) {
                return Some(Self::Events(Format::Csv));
            }
        }
        // A text has bytes of 34 and more in every line, so it is not taken for N-MNIST.
        (!is_csv(bytes) && nmnist::is_nmnist(bytes)).then_some(Self::Events(Format::Nmnist))
    }

    /// The kind of the file or folder at `path`; reads at most 80 KiB.
    ///
    /// # Errors
    /// The errors of opening and reading the file.
    pub fn of_file(path: &Path) -> io::Result<Option<Self>> {
        if path.is_dir() {
            return Ok(Some(Self::Folder));
        }
        let mut start = Vec::new();
        File::open(path)?.take(START).read_to_end(&mut start)?;
        Ok(Self::of(&start))
    }
}

/// The format of `bytes`, the whole content of a file; `None` if it has none of the formats.
///
/// Only the marks of the formats are examined: such a file can still be corrupt. An empty or packed
/// content has no format. O(n) for N-MNIST, O(1) for the others.
pub fn detect(bytes: &[u8]) -> Option<Format> {
    format_of(bytes).ok()
}

/// The format of `bytes`, or the reason why there is none.
pub(crate) fn format_of(bytes: &[u8]) -> Result<Format, IoError> {
    match Kind::of(bytes) {
        Some(Kind::Events(format)) => return Ok(format),
        Some(found) => return Err(IoError::OtherKind { expected: Kind::EVENTS, found }),
        None if is_csv(bytes) => return Ok(Format::Csv),
        None => {}
    }
    if let Some(Err(name)) = Header::scan(bytes).encoding() {
        let actual = format!("encoding `{}`", beginning(name, 40));
        return Err(IoError::Unsupported { expected: "EVT 2.0, 2.1 or 3.0", actual });
    }
    let (length, start) = (bytes.len() as u64, shown(&bytes[..bytes.len().min(16)]));
    let expected = "AEDAT 2 to 4, EVT2, EVT2.1, EVT3, DAT, ES, N-MNIST, CSV, npy or MCAP";
    Err(IoError::UnknownFormat { what: "format", expected, length, start })
}

/// The error of an input that starts with `start` and has another known kind than `wanted`.
pub(crate) fn other_kind(start: &[u8], wanted: Kind, expected: &'static str) -> Option<IoError> {
    let found = Kind::of(start).filter(|kind| *kind != wanted)?;
    Some(IoError::OtherKind { expected, found })
}

const DV: &str = "convert it to AEDAT4 with iniVation's DV";
const STILLS: &str = "a picture in GIF or TIFF";
const AS_STILL: &str = "write it as PNG, JPEG, PPM or PGM";
const VIDEO: Foreign = Foreign {
    name: "a video (MP4, MOV, AVI or Matroska)",
    instead: "it holds pictures and no events; write them as PNG, with ffmpeg -i VIDEO %06d.png",
};

/// Formats of recordings that are not read: first bytes, name, and how to convert.
const FOREIGN: &[(&[u8], &str, &str)] = &[
    (
        b"\x89HDF",
        "HDF5",
        "build with the feature `hdf5` for those of DSEC and Prophesee, or write its events as a structured .npy with Python's h5py",
    ),
    (b"\x1f\x8b", "gzip", "unpack it with gunzip"),
    (b"BZh", "bzip2", "unpack it with bunzip2"),
    (b"\xfd7zXZ\0", "xz", "unpack it with unxz"),
    (b"\x28\xb5\x2f\xfd", "Zstandard", "unpack it with unzstd"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", "unpack it with 7z x"),
    (
        b"PK\x03\x04",
        "a zip archive",
        "unpack it with unzip; .npz is one, of .npy files, and so are weights of PyTorch (--weights)",
    ),
    (
        b"#ROSBAG",
        "a ROS bag",
        "write the events of its dvs_msgs topic as text, such as t x y p, with Python's rosbags or rosbag",
    ),
    (
        b"SQLite format 3\0",
        "an SQLite database, as ROS 2 records bags",
        "write the events of its topic as text, such as t x y p, with Python's rosbags",
    ),
    (b"#!AER-DAT1", "AEDAT 1", DV),
    (b"#!AER-DAT3", "AEDAT 3.0", DV),
    (
        b"MATLAB 5.0 MAT-file",
        "a MATLAB file",
        "write its events as a structured .npy with Python's scipy.io.loadmat",
    ),
    (b"GIF8", STILLS, AS_STILL),
    (b"II*\0", STILLS, AS_STILL),
    (b"MM\0*", STILLS, AS_STILL),
];

/// The known format that is not read, if a file of it starts with `bytes`.
fn foreign(bytes: &[u8]) -> Option<Foreign> {
    let has = |at: usize, mark: &[u8]| bytes.get(at..).is_some_and(|tail| tail.starts_with(mark));
    if has(4, b"ftyp") || has(0, b"\x1a\x45\xdf\xa3") || (has(0, b"RIFF") && has(8, b"AVI ")) {
        return Some(VIDEO);
    }
    if has(257, b"ustar") {
        return Some(Foreign { name: "a tar archive", instead: "unpack it with tar -xf" });
    }
    let listed = FOREIGN.iter().find(|(start, ..)| bytes.starts_with(start));
    listed.map(|&(_, name, instead)| Foreign { name, instead })
}
