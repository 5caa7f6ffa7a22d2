//! Recordings of slips under 24 electrodes, one class a folder (the `BioTac` direction-of-slip data set's layout).
//!
//! ```text
//! DATA/<class>/<object><number>.csv        DATA/n/pen178.csv
//! ```
//!
//! Enters: the folder and the names of the classes. Leaves: recordings with their class and object, ordered by class and
//! then by file name in natural order. Each is read as [`Electrodes`] reads it.
//!
//! Invariant: every folder is a class, and nothing that is no reading is taken for one. Names that start with a dot, files
//! beside the class folders and what is not CSV in them are passed over and listed.

use std::ffi::OsStr;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::error::DatasetError;
use crate::electrodes::{ElectrodeSettings, ElectrodeWarnings, Electrodes, Reading};
use crate::error::IoError;
use crate::natural;

/// What becomes of a row that is no reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BadRows {
    /// It is an error.
    #[default]
    Refuse,
    /// It is passed over and listed with the recording.
    PassOver,
}

/// A row that is no reading.
#[derive(Debug)]
pub struct RefusedRow {
    /// How many of the recording's readings stand before it.
    pub after: usize,
    /// What is wrong with it, with its line.
    pub problem: IoError,
}

/// A slip as it was recorded.
#[derive(Debug)]
pub struct SlipRecording {
    /// Class, `/` and file name without its extension: "n/pen178".
    pub name: String,
    /// The direction of the slip: an index into the classes.
    pub class: usize,
    /// The object that slipped, as the file name has it.
    pub object: String,
    /// The readings, in order.
    pub readings: Vec<Reading>,
    /// Rows that are no readings, in order; none with [`BadRows::Refuse`].
    pub refused: Vec<RefusedRow>,
    /// What was suspicious in the readings.
    pub warnings: ElectrodeWarnings,
}

/// A data set of slips.
#[derive(Debug)]
pub struct SlipDataset {
    /// The recordings, by class and then by file name in natural order.
    pub recordings: Vec<SlipRecording>,
    /// Files that are no recordings, in the order in which they were met.
    pub passed_over: Vec<PathBuf>,
}

impl SlipRecording {
    /// The readings between the rows that were refused: readings of a stretch follow each other.
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
    /// `classes`, and classes come in that order. O(bytes); all readings are held.
    ///
    /// # Errors
    /// [`DatasetError`], with the path, where the folder or a recording is missing, has another layout, cannot be read, or
    /// has no readings; with the line too for a row that is no reading, where `bad_rows` refuses it.
    pub fn read(folder: impl AsRef<Path>, classes: &[&str], bad_rows: BadRows) -> Result<Self, DatasetError> {
        let folder = folder.as_ref();
        let expected = || classes.iter().map(|&class| class.to_owned()).collect::<Vec<_>>();
        if !folder.is_dir() {
            let found = if folder.exists() { "a file" } else { "nothing" };
            return Err(DatasetError::NoFolder { path: folder.to_owned(), expected: expected(), found });
        }
        let (folders, files): (Vec<_>, Vec<_>) = entries(folder)?.into_iter().partition(|path| path.is_dir());
        let unknown = folders.iter().map(|path| name(path)).filter(|name| !classes.contains(&name.as_str()));
        let unknown: Vec<_> = unknown.collect();
        if !unknown.is_empty() {
            let (path, expected) = (folder.to_owned(), expected());
            return Err(DatasetError::UnknownClasses { path, expected, found: unknown });
        }
        let mut set = Self { recordings: Vec::new(), passed_over: files };
        for (class, &class_name) in classes.iter().enumerate() {
            let Some(folder) = folders.iter().find(|path| name(path) == class_name) else { continue };
            for path in entries(folder)? {
                if path.is_file() && path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
                    set.recordings.push(SlipRecording::read(&path, (class, class_name), bad_rows)?);
                } else {
                    set.passed_over.push(path);
                }
            }
        }
        if set.recordings.is_empty() {
            return Err(DatasetError::NoRecordings { path: folder.to_owned(), expected: expected() });
        }
        Ok(set)
    }
}

impl SlipRecording {
    fn read(path: &Path, class: (usize, &str), bad_rows: BadRows) -> Result<Self, DatasetError> {
        let file = File::open(path).map_err(|source| {
            DatasetError::File(IoError::File { action: "open", path: path.to_owned(), source })
        })?;
        let stem = path.file_stem().and_then(OsStr::to_str).unwrap_or_default();
        let object = stem.trim_end_matches(|c: char| c.is_ascii_digit());
        if object.is_empty() || object.len() == stem.len() {
            return Err(DatasetError::Name { path: path.to_owned(), found: name(path) });
        }
        let mut rows = Electrodes::new(BufReader::new(file), ElectrodeSettings::default());
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
            return Err(DatasetError::Empty { path: path.to_owned() });
        }
        let (name, object) = (format!("{}/{stem}", class.1), object.to_owned());
        Ok(Self { name, class: class.0, object, readings, refused, warnings: rows.warnings() })
    }
}

/// Whether one row is at fault, and not the header or the file.
fn is_of_a_row(problem: &IoError) -> bool {
    matches!(problem, IoError::Malformed { what: "row" | "field", .. })
}

/// What a folder holds, in natural order of names, without what starts with a dot.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let list = || -> std::io::Result<Vec<PathBuf>> {
        std::fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path())).collect()
    };
    let mut paths = list().map_err(|source| DatasetError::List { path: folder.to_owned(), source })?;
    paths.retain(|path| !name(path).starts_with('.'));
    paths.sort_by(|a, b| natural::compare(name(a).as_bytes(), name(b).as_bytes()));
    Ok(paths)
}

fn name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}
