//! Digits that an event camera sees while it moves, one class a folder (the layout of N-MNIST).
//!
//! ```text
//! DATA/<train|test>/<digit>/<number>.bin        DATA/train/3/00123.bin
//! ```
//!
//! Enters: the folder. Leaves: recordings with their split and class, those for training first, ordered by class and then
//! by file name in natural order. Each is read as [`Format::Nmnist`], whatever its content looks like.
//!
//! Invariant: every folder is a split or a digit, and every recording has an event. Names that start with a dot, files
//! beside the folders and what is not `.bin` in them are passed over and listed.
//!
//! Source: Orchard, Jayawant, Cohen and Thakor, "Converting static image datasets to spiking neuromorphic datasets using
//! saccades", 2015.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};

use meissner_engine::Event;

use super::error::DatasetError;
use super::folder::{classes, files};
use crate::codec::read_as;
use crate::error::IoError;
use crate::format::Format;

/// Names of the classes, which are the folders of a split.
const DIGITS: [&str; 10] = ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"];

/// What a recording is there for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Split {
    /// To train on.
    Train,
    /// To judge on.
    Test,
}

impl Split {
    /// Both, the one for training first.
    pub const ALL: [Self; 2] = [Self::Train, Self::Test];

    /// Its folder.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Test => "test",
        }
    }
}

impl fmt::Display for Split {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A digit as it was recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NmnistRecording {
    /// Split, class and file name without its extension: "train/3/00123".
    pub name: String,
    /// What it is there for.
    pub split: Split,
    /// The digit, from 0 to 9.
    pub class: usize,
    /// Its events on 34 x 34 pixels, in the file's order, with the file's times; at least one.
    pub events: Vec<Event>,
}

/// A data set of digits.
#[derive(Debug)]
pub struct NmnistDataset {
    /// The recordings, by split, by class and then by file name in natural order.
    pub recordings: Vec<NmnistRecording>,
    /// Files that are no recordings, in the order in which they were met.
    pub passed_over: Vec<PathBuf>,
}

impl NmnistDataset {
    /// Reads the data set in `folder`, which has one of the two splits or both. O(bytes); all events are held.
    ///
    /// # Errors
    /// [`DatasetError`], with the path, where the folder or a recording is missing, has another layout, cannot be read, or
    /// has no events.
    pub fn read(folder: impl AsRef<Path>) -> Result<Self, DatasetError> {
        let folder = folder.as_ref();
        let splits = classes(folder, &Split::ALL.map(Split::name))?;
        let mut set = Self { recordings: Vec::new(), passed_over: splits.files };
        for (index, folder) in splits.folders {
            let split = Split::ALL[index];
            let digits = classes(&folder, &DIGITS)?;
            set.passed_over.extend(digits.files);
            for (class, folder) in digits.folders {
                let (recordings, others) = files(&folder, "bin")?;
                for path in recordings {
                    set.recordings.push(NmnistRecording::read(&path, split, class)?);
                }
                set.passed_over.extend(others);
            }
        }
        if set.recordings.is_empty() {
            let (path, layout) = (folder.to_owned(), "<train|test>/<digit>/<number>.bin");
            let expected = DIGITS.map(str::to_owned).to_vec();
            return Err(DatasetError::NoRecordings { path, layout, expected });
        }
        Ok(set)
    }
}

impl NmnistRecording {
    fn read(path: &Path, split: Split, class: usize) -> Result<Self, DatasetError> {
        let recording = read_as(Format::Nmnist, path).map_err(|source| match source {
            // It names the file itself.
            IoError::File { .. } => DatasetError::File(source),
            _ => DatasetError::Recording { path: path.to_owned(), source },
        })?;
        if recording.events.is_empty() {
            return Err(DatasetError::Empty { path: path.to_owned(), expected: "events of five bytes" });
        }
        let stem = path.file_stem().and_then(OsStr::to_str).unwrap_or_default();
        Ok(Self { name: format!("{split}/{class}/{stem}"), split, class, events: recording.events })
    }
}
