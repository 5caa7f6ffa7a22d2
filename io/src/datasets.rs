//! Labelled sets of recordings: a folder to recordings with their labels, in an order that is the same on every machine.
//!
//! Recordings are ordered by class and then by file name in natural order (`pen2` before `pen10`). Entries whose names start
//! with a dot are ignored. Files beside the class folders, and files with another extension in them, are skipped and listed.

use std::ffi::OsStr;
use std::fmt;
use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

use meissner_engine::Event;
use thiserror::Error;

use crate::codec::read_as;
use crate::electrodes::{ElectrodeSettings, ElectrodeWarnings, Electrodes, Reading};
use crate::error::IoError;
use crate::files::entries;
use crate::format::Format;

/// Why a folder could not be read as a data set.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// The folder does not exist.
    #[error("{}: expected a folder with folders {}, found {found}", path.display(), expected.join(", "))]
    NoFolder {
        /// The folder.
        path: PathBuf,
        /// The names of its subfolders.
        expected: Vec<String>,
        /// `a file` or `nothing`.
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
    /// Subfolders have unknown names.
    #[error("{}: expected folders {}, found also {}", path.display(), expected.join(", "), found.join(", "))]
    UnknownClasses {
        /// The folder.
        path: PathBuf,
        /// The known names.
        expected: Vec<String>,
        /// The unknown names, in natural order.
        found: Vec<String>,
    },
    /// No class has a recording.
    #[error("{}: expected recordings {layout} of the classes {}, found none", path.display(), expected.join(", "))]
    NoRecordings {
        /// The data set.
        path: PathBuf,
        /// The layout of a data set.
        layout: &'static str,
        /// The classes.
        expected: Vec<String>,
    },
    /// A recording's name does not contain its object.
    #[error("{}: expected an object's name and a number, such as pen178.csv, found {found:?}", path.display())]
    Name {
        /// The recording.
        path: PathBuf,
        /// Its name.
        found: String,
    },
    /// A recording is empty.
    #[error("{}: expected {expected}, found none", path.display())]
    Empty {
        /// The recording.
        path: PathBuf,
        /// The content of a recording.
        expected: &'static str,
    },
    /// A recording cannot be opened.
    #[error(transparent)]
    File(IoError),
    /// A recording cannot be read; the source has the place.
    #[error("recording {}", path.display())]
    Recording {
        /// The recording.
        path: PathBuf,
        /// The reason.
        source: IoError,
    },
}

/// Names of the classes of N-MNIST, which are the folders of a split.
const DIGITS: [&str; 10] = ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"];

/// The purpose of a recording of N-MNIST.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Split {
    /// Training.
    Train,
    /// Evaluation.
    Test,
}

impl Split {
    /// Both, training first.
    pub const ALL: [Self; 2] = [Self::Train, Self::Test];

    /// The name of its folder.
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

/// A recording of a digit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NmnistRecording {
    /// Split, class and file name without its extension: "train/3/00123".
    pub name: String,
    /// Its purpose.
    pub split: Split,
    /// The digit, from 0 to 9.
    pub class: usize,
    /// Its events on 34 x 34 pixels, in the file's order, with the file's times; at least one.
    pub events: Vec<Event>,
}

/// Digits seen by a moving event camera: the layout of N-MNIST.
///
/// ```text
/// DATA/<train|test>/<digit>/<number>.bin        DATA/train/3/00123.bin
/// ```
///
/// Every folder is a split or a digit, and every recording has an event. Every `.bin` file is read as [`Format::Nmnist`],
/// whatever its content. Source: Orchard, Jayawant, Cohen and Thakor, "Converting static image datasets to spiking
/// neuromorphic datasets using saccades", 2015.
#[derive(Debug)]
pub struct NmnistDataset {
    /// The recordings: training first, then by class and by file name in natural order.
    pub recordings: Vec<NmnistRecording>,
    /// Files that are not recordings, in the order of reading.
    pub passed_over: Vec<PathBuf>,
}

impl NmnistDataset {
    /// Reads the data set in `folder`, which has one or both splits. O(bytes); all events are held in memory.
    ///
    /// # Errors
    /// [`DatasetError`], with the path, where the folder or a recording is missing, has another layout, cannot be read, or
    /// has no events.
    pub fn read(folder: impl AsRef<Path>) -> Result<Self, DatasetError> {
        let folder = folder.as_ref();
        let splits = class_folders(folder, &Split::ALL.map(Split::name))?;
        let mut set = Self { recordings: Vec::new(), passed_over: splits.files };
        for (index, folder) in splits.folders {
            let split = Split::ALL[index];
            let digits = class_folders(&folder, &DIGITS)?;
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
            // This error has the path already.
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

/// The treatment of a row that is not a reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BadRows {
    /// The row is an error.
    #[default]
    Refuse,
    /// The row is skipped and listed with the recording.
    PassOver,
}

/// A row that is not a reading.
#[derive(Debug)]
pub struct RefusedRow {
    /// Number of the recording's readings before it.
    pub after: usize,
    /// The error, with the line.
    pub problem: IoError,
}

/// A recording of a slip.
#[derive(Debug)]
pub struct SlipRecording {
    /// Class, `/` and file name without its extension: "n/pen178".
    pub name: String,
    /// The direction of the slip: an index into the classes.
    pub class: usize,
    /// The object that slipped, from the file name.
    pub object: String,
    /// The readings, in order.
    pub readings: Vec<Reading>,
    /// Rows that are not readings, in order; none with [`BadRows::Refuse`].
    pub refused: Vec<RefusedRow>,
    /// Counts of the suspicious readings.
    pub warnings: ElectrodeWarnings,
}

/// Slips under 24 electrodes, one folder per class: the layout of the `BioTac` direction-of-slip data set.
///
/// ```text
/// DATA/<class>/<object><number>.csv        DATA/n/pen178.csv
/// ```
///
/// Every folder is a class. Every `.csv` file is read as [`Electrodes`] reads it.
#[derive(Debug)]
pub struct SlipDataset {
    /// The recordings, by class and then by file name in natural order.
    pub recordings: Vec<SlipRecording>,
    /// Files that are not recordings, in the order of reading.
    pub passed_over: Vec<PathBuf>,
}

impl SlipRecording {
    /// The readings in stretches without a refused row between them.
    ///
    /// # Panics
    /// Where [`Self::refused`] was changed so that its positions do not ascend or exceed the number of readings.
    pub fn stretches(&self) -> impl Iterator<Item = &[Reading]> {
        let ends = self.refused.iter().map(|row| row.after).chain([self.readings.len()]);
        let stretches = ends.scan(0, |start, end| {
            let stretch = &self.readings[*start..end];
            *start = end;
            Some(stretch)
        });
        stretches.filter(|stretch| !stretch.is_empty())
    }
}

impl SlipDataset {
    /// Reads the data set in `folder`, whose folders are some or all of `classes`; a recording's class is an index into
    /// `classes`, and classes come in that order. O(bytes); all readings are held in memory.
    ///
    /// # Errors
    /// [`DatasetError`], with the path, where the folder or a recording is missing, has another layout, cannot be read, or
    /// has no readings; with the line too for a row that is no reading, where `bad_rows` refuses it.
    pub fn read(folder: impl AsRef<Path>, classes: &[&str], bad_rows: BadRows) -> Result<Self, DatasetError> {
        let folder = folder.as_ref();
        let Classes { folders, files: beside } = class_folders(folder, classes)?;
        let mut set = Self { recordings: Vec::new(), passed_over: beside };
        for (class, folder) in folders {
            let (recordings, others) = files(&folder, "csv")?;
            for path in recordings {
                set.recordings.push(SlipRecording::read(&path, (class, classes[class]), bad_rows)?);
            }
            set.passed_over.extend(others);
        }
        if set.recordings.is_empty() {
            let (path, layout) = (folder.to_owned(), "<class>/<object><number>.csv");
            let expected = classes.iter().map(|&class| class.to_owned()).collect();
            return Err(DatasetError::NoRecordings { path, layout, expected });
        }
        Ok(set)
    }
}

impl SlipRecording {
    fn read(path: &Path, class: (usize, &str), bad_rows: BadRows) -> Result<Self, DatasetError> {
        let file =
            File::open(path).map_err(|source| DatasetError::File(IoError::file("open", path)(source)))?;
        let stem = path.file_stem().and_then(OsStr::to_str).unwrap_or_default();
        let object = stem.trim_end_matches(|c: char| c.is_ascii_digit());
        if object.is_empty() || object.len() == stem.len() {
            return Err(DatasetError::Name { path: path.to_owned(), found: name(path) });
        }
        let mut rows = Electrodes::new(BufReader::new(file), ElectrodeSettings::new());
        let (mut readings, mut refused) = (Vec::new(), Vec::new());
        for row in rows.by_ref() {
            match row {
                Ok(reading) => readings.push(reading),
                Err(problem) if bad_rows == BadRows::PassOver && is_of_a_row(&problem) => {
                    refused.push(RefusedRow { after: readings.len(), problem });
                }
                Err(source) => return Err(DatasetError::Recording { path: path.to_owned(), source }),
            }
        }
        if readings.is_empty() {
            return Err(DatasetError::Empty {
                path: path.to_owned(),
                expected: "rows of readings below a header",
            });
        }
        let (name, object) = (format!("{}/{stem}", class.1), object.to_owned());
        Ok(Self { name, class: class.0, object, readings, refused, warnings: rows.warnings() })
    }
}

/// Whether an error is about one row, not about the header or the file.
fn is_of_a_row(problem: &IoError) -> bool {
    matches!(problem, IoError::Malformed { what: "row" | "field", .. })
}

/// The content of a folder whose subfolders are some or all of a list of names.
struct Classes {
    /// Index into the names, and the subfolder of that name, ascending.
    folders: Vec<(usize, PathBuf)>,
    /// Files beside the subfolders, in natural order.
    files: Vec<PathBuf>,
}

/// The content of `folder`, whose subfolders must have some of these names.
fn class_folders(folder: &Path, names: &[&str]) -> Result<Classes, DatasetError> {
    let expected = || names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
    if !folder.is_dir() {
        let found = if folder.exists() { "a file" } else { "nothing" };
        return Err(DatasetError::NoFolder { path: folder.to_owned(), expected: expected(), found });
    }
    let (folders, files): (Vec<_>, Vec<_>) =
        visible_entries(folder)?.into_iter().partition(|path| path.is_dir());
    let unknown = folders.iter().map(|path| name(path)).filter(|name| !names.contains(&name.as_str()));
    let unknown: Vec<_> = unknown.collect();
    if !unknown.is_empty() {
        let (path, expected) = (folder.to_owned(), expected());
        return Err(DatasetError::UnknownClasses { path, expected, found: unknown });
    }
    let find = |(index, sought): (usize, &&str)| {
        folders.iter().find(|path| name(path) == *sought).map(|path| (index, path.clone()))
    };
    Ok(Classes { folders: names.iter().enumerate().filter_map(find).collect(), files })
}

/// The files in `folder` with this extension in either case, and its other entries, both in natural order.
fn files(folder: &Path, extension: &str) -> Result<(Vec<PathBuf>, Vec<PathBuf>), DatasetError> {
    let fits = |path: &PathBuf| {
        path.is_file() && path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
    };
    Ok(visible_entries(folder)?.into_iter().partition(fits))
}

/// The last part of `path`.
fn name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The entries of a folder in natural order of their names, without hidden ones.
fn visible_entries(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let mut paths =
        entries(folder).map_err(|source| DatasetError::List { path: folder.to_owned(), source })?;
    paths.retain(|path| !name(path).starts_with('.'));
    Ok(paths)
}
