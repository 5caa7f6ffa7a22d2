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
use super::folder::{self, Classes};
use crate::electrodes::{ElectrodeSettings, ElectrodeWarnings, Electrodes, Reading};
use crate::error::IoError;

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
    ///
    /// # Panics
    /// Where [`Self::refused`] has been changed so that places do not ascend, or lie beyond the readings.
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
        let Classes { folders, files: beside } = folder::classes(folder, classes)?;
        let mut set = Self { recordings: Vec::new(), passed_over: beside };
        for (class, folder) in folders {
            let (recordings, others) = folder::files(&folder, "csv")?;
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
        let file = File::open(path).map_err(|source| {
            DatasetError::File(IoError::File { action: "open", path: path.to_owned(), source })
        })?;
        let stem = path.file_stem().and_then(OsStr::to_str).unwrap_or_default();
        let object = stem.trim_end_matches(|c: char| c.is_ascii_digit());
        if object.is_empty() || object.len() == stem.len() {
            return Err(DatasetError::Name { path: path.to_owned(), found: folder::name(path) });
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
            return Err(DatasetError::Empty {
                path: path.to_owned(),
                expected: "rows of readings below a header",
            });
        }
        let (name, object) = (format!("{}/{stem}", class.1), object.to_owned());
        Ok(Self { name, class: class.0, object, readings, refused, warnings: rows.warnings() })
    }
}

/// Whether one row is at fault, and not the header or the file.
fn is_of_a_row(problem: &IoError) -> bool {
    matches!(problem, IoError::Malformed { what: "row" | "field", .. })
}
