//! What can be wrong with a folder of recordings.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::error::IoError;

/// A folder is not the data set that it should be.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// The data set is not there.
    #[error("{}: expected a folder with folders {}, found {found}", path.display(), expected.join(", "))]
    NoFolder {
        /// Where it should be.
        path: PathBuf,
        /// The names of its folders.
        expected: Vec<String>,
        /// What is there.
        found: &'static str,
    },
    /// A folder cannot be listed.
    #[error("cannot list {}", path.display())]
    List {
        /// The folder.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// Folders of other names than the layout has.
    #[error("{}: expected folders {}, found also {}", path.display(), expected.join(", "), found.join(", "))]
    UnknownClasses {
        /// The folder that holds them.
        path: PathBuf,
        /// The names.
        expected: Vec<String>,
        /// The other folders, in order.
        found: Vec<String>,
    },
    /// No class has a recording.
    #[error("{}: expected recordings {layout} of the classes {}, found none", path.display(), expected.join(", "))]
    NoRecordings {
        /// The data set.
        path: PathBuf,
        /// How recordings lie in it.
        layout: &'static str,
        /// The classes.
        expected: Vec<String>,
    },
    /// A recording's name does not say its object.
    #[error("{}: expected an object's name and a number, such as pen178.csv, found {found:?}", path.display())]
    Name {
        /// The recording.
        path: PathBuf,
        /// Its name.
        found: String,
    },
    /// A recording holds nothing.
    #[error("{}: expected {expected}, found none", path.display())]
    Empty {
        /// The recording.
        path: PathBuf,
        /// What it should hold.
        expected: &'static str,
    },
    /// A recording cannot be opened.
    #[error(transparent)]
    File(IoError),
    /// A recording cannot be read; the reason has the line.
    #[error("recording {}", path.display())]
    Recording {
        /// The recording.
        path: PathBuf,
        /// Why.
        source: IoError,
    },
}
