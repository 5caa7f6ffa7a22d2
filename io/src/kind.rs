//! What kind of input some bytes are, from their start: the one place that tells recordings of events, readings of electrodes,
//! pictures, and files that are known and not read.
//!
//! AEDAT4, npy and pictures have a magic; Prophesee's files have a text header that names the encoding; text is of electrodes
//! by its header and of events by a header or a first line of four numbers; N-MNIST has no mark at all and is tried last.

use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::format::Format;
use crate::images::ImageFormat;
use crate::prophesee::{self, Header, has_header};
use crate::{aedat4, csv, electrodes, nmnist, npy};

/// Bytes that are looked at, at most; whole events of N-MNIST.
const START: u64 = 5 << 14;

/// What readers of recordings expect.
pub(crate) const EVENTS: &str = "a recording of events";
/// What readers of electrodes expect.
pub(crate) const ELECTRODES: &str = "readings of electrodes";

/// A kind of input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// Events of a camera, to be read with [`crate::read`].
    Events(Format),
    /// CSV with a column for each electrode, to be read with [`crate::Electrodes`].
    Electrodes,
    /// A picture, to be read with [`crate::read_image`].
    Picture(ImageFormat),
    /// A folder, which [`crate::ImageSequence`] reads the pictures of.
    Folder,
    /// A file of another kind, which nothing here reads.
    Foreign(Foreign),
}

/// A format that is known and not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Foreign {
    /// Its name.
    pub name: &'static str,
    /// What makes an input of it that is read.
    pub instead: &'static str,
}

impl Kind {
    /// The kind of a file that starts with `bytes`: all of them, or 4 KiB at least where it is longer. `None`: not known.
    ///
    /// A text that is neither plainly events nor plainly electrodes, such as a list of pictures, is not known. O(1), for N-MNIST
    /// O(n).
    pub fn of(bytes: &[u8]) -> Option<Self> {
        if aedat4::has_magic(bytes) {
            return Some(Self::Events(Format::Aedat4));
        }
        if npy::has_magic(bytes) {
            return Some(Self::Events(Format::Npy));
        }
        if let Some(format) = ImageFormat::detect(bytes) {
            return Some(Self::Picture(format));
        }
        if let Some(foreign) = foreign(bytes) {
            return Some(Self::Foreign(foreign));
        }
        if has_header(bytes) {
            match Header::scan(bytes).kind() {
                Some(prophesee::Kind::Known(format)) => return Some(Self::Events(format)),
                Some(prophesee::Kind::Unknown(encoding)) => {
                    let is_21 = matches!(encoding.as_str(), "2.1" | "EVT21");
                    return is_21.then_some(Self::Foreign(EVT21));
                }
                // Text may have comments that start so.
                None => {}
            }
        }
        if let Some(line) = csv::first_line(bytes) {
            if electrodes::are_named_in(line) {
                return Some(Self::Electrodes);
            }
            if csv::is_of_events(line) {
                return Some(Self::Events(Format::Csv));
            }
        }
        // Text has bytes from 34 on in every line: it is not taken for digits.
        (!csv::is_csv(bytes) && nmnist::is_nmnist(bytes)).then_some(Self::Events(Format::Nmnist))
    }
}

impl Kind {
    /// The kind of the file or folder at `path`, of which 80 KiB are read at most.
    ///
    /// # Errors
    /// Those of opening and reading the file.
    pub fn of_file(path: &Path) -> io::Result<Option<Self>> {
        if path.is_dir() {
            return Ok(Some(Self::Folder));
        }
        let mut start = Vec::new();
        File::open(path)?.take(START).read_to_end(&mut start)?;
        Ok(Self::of(&start))
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Events(format) => write!(f, "{EVENTS} ({format})"),
            Self::Electrodes => write!(f, "{ELECTRODES} (CSV)"),
            Self::Picture(format) => write!(f, "a picture ({format})"),
            Self::Folder => f.write_str("a folder"),
            Self::Foreign(Foreign { name, instead }) => write!(f, "{name}, which is not read: {instead}"),
        }
    }
}

const EVT21: Foreign = Foreign {
    name: "Prophesee EVT 2.1",
    instead: "write it as CSV with Metavision's metavision_file_to_csv, or record in EVT 3.0",
};

/// Formats that people have recordings in, by what their files start with.
const BY_START: &[(&[u8], Foreign)] = &[
    (
        b"\x89HDF",
        Foreign {
            name: "HDF5",
            instead: "write its events as a structured .npy with Python's h5py, or Prophesee's as CSV with metavision_file_to_csv",
        },
    ),
    (b"\x1f\x8b", Foreign { name: "gzip", instead: "unpack it with gunzip" }),
    (b"BZh", Foreign { name: "bzip2", instead: "unpack it with bunzip2" }),
    (b"\xfd7zXZ\0", Foreign { name: "xz", instead: "unpack it with unxz" }),
    (b"\x28\xb5\x2f\xfd", Foreign { name: "Zstandard", instead: "unpack it with unzstd" }),
    (b"7z\xbc\xaf\x27\x1c", Foreign { name: "a 7z archive", instead: "unpack it with 7z x" }),
    (
        b"PK\x03\x04",
        Foreign {
            name: "a zip archive",
            instead: "unpack it with unzip; .npz is one, of .npy files, and so are weights of PyTorch (--weights)",
        },
    ),
    (
        b"#ROSBAG",
        Foreign {
            name: "a ROS bag",
            instead: "write the events of its dvs_msgs topic as text, such as t x y p, with Python's rosbags or rosbag",
        },
    ),
    (
        b"\x89MCAP",
        Foreign {
            name: "MCAP",
            instead: "write the events of its topic as text, such as t x y p, with Python's mcap or rosbags",
        },
    ),
    (
        b"SQLite format 3\0",
        Foreign {
            name: "an SQLite database, as ROS 2 records bags",
            instead: "write the events of its topic as text, such as t x y p, with Python's rosbags",
        },
    ),
    (b"#!AER-DAT1", Foreign { name: "AEDAT 1", instead: "convert it to AEDAT4 with iniVation's DV" }),
    (b"#!AER-DAT2", Foreign { name: "AEDAT 2", instead: "convert it to AEDAT4 with iniVation's DV" }),
    (b"#!AER-DAT3", Foreign { name: "AEDAT 3", instead: "convert it to AEDAT4 with iniVation's DV" }),
    (
        b"Event Stream",
        Foreign {
            name: "Event Stream (.es)",
            instead: "write its events as a structured .npy with Python's event_stream",
        },
    ),
    (
        b"MATLAB 5.0 MAT-file",
        Foreign {
            name: "a MATLAB file",
            instead: "write its events as a structured .npy with Python's scipy.io.loadmat",
        },
    ),
    (b"GIF8", PICTURE),
    (b"II*\0", PICTURE),
    (b"MM\0*", PICTURE),
];

const PICTURE: Foreign =
    Foreign { name: "a picture in GIF or TIFF", instead: "write it as PNG, JPEG, PPM or PGM" };

const VIDEO: Foreign = Foreign {
    name: "a video (MP4, MOV, AVI or Matroska)",
    instead: "it holds pictures and no events; write them as PNG, with ffmpeg -i VIDEO %06d.png",
};

/// The format that is known and not read, of which `bytes` are the start.
fn foreign(bytes: &[u8]) -> Option<Foreign> {
    let is_video = bytes.get(4..8) == Some(b"ftyp")
        || (bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"AVI "))
        || bytes.starts_with(b"\x1a\x45\xdf\xa3");
    if is_video {
        return Some(VIDEO);
    }
    if bytes.get(257..262) == Some(b"ustar") {
        return Some(Foreign { name: "a tar archive", instead: "unpack it with tar -xf" });
    }
    BY_START.iter().find(|(start, _)| bytes.starts_with(start)).map(|&(_, foreign)| foreign)
}
