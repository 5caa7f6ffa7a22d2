//! Labelled sets of recordings: a folder to labelled recordings, in the same order on every
//! machine.
//!
//! Recordings are ordered by class and then by file name in natural order (`pen2` before `pen10`).
//! Entries whose names start with a dot are ignored. Files next to the class folders, and files in
//! them with another extension, are skipped and listed.

mod braille;
mod gelsight;
mod neutouch;
mod presses;

pub use gelsight::{Ball, BallPictures, SlopeColours};
pub use neutouch::NeutouchSet;
pub use presses::PressFile;

use std::ffi::OsStr;
use std::fmt;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use meissner_engine::Event;

use crate::codec::read_with;
use crate::electrodes::{ElectrodeSettings, ElectrodeWarnings, Electrodes, Reading};
use crate::error::IoError;
use crate::files::entries;
use crate::format::Format;
use crate::options::ReadOptions;

/// A labelled set of recordings.
#[derive(Debug)]
pub struct Dataset<R> {
    /// The recordings: by split (training first), by class, and by file name in natural order.
    pub recordings: Vec<R>,
    /// Files that are not recordings, in the order of reading.
    pub passed_over: Vec<PathBuf>,
}

impl<R> Dataset<R> {
    /// A set without recordings.
    fn new() -> Self {
        Self { recordings: Vec::new(), passed_over: Vec::new() }
    }

    /// The subfolders of `folder` with their indices in `names`, ascending; others are refused.
    fn subfolders(&mut self, folder: &Path, names: &[&str]) -> Result<Vec<(usize, PathBuf)>, IoError> {
        let refuse = |found: String| {
            Err(IoError::unfit(folder, format!("a folder with folders {}", names.join(", ")), found))
        };
        if !folder.is_dir() {
            return refuse(if folder.exists() { "a file" } else { "nothing" }.to_owned());
        }
        let (folders, files): (Vec<_>, Vec<_>) =
            visible_entries(folder)?.into_iter().partition(|path| path.is_dir());
        self.passed_over.extend(files);
        let index = |path: &Path| names.iter().position(|sought| name(path) == *sought);
        let unknown: Vec<_> =
            folders.iter().filter(|path| index(path).is_none()).map(|path| name(path)).collect();
        if !unknown.is_empty() {
            return refuse(format!("also {}", unknown.join(", ")));
        }
        let mut known: Vec<_> = folders.into_iter().filter_map(|path| Some((index(&path)?, path))).collect();
        known.sort_unstable();
        Ok(known)
    }

    /// Reads the recordings of `folder`: its files with this extension in upper or lower case.
    fn extend(
        &mut self,
        folder: &Path,
        extension: &str,
        read: impl Fn(&Path) -> Result<R, IoError>,
    ) -> Result<(), IoError> {
        for path in visible_entries(folder)? {
            if path.is_file() && path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension)) {
                self.recordings.push(read(&path)?);
            } else {
                self.passed_over.push(path);
            }
        }
        Ok(())
    }

    /// The set, which must contain a recording.
    fn not_empty(self, folder: &Path, layout: &str, classes: &[&str]) -> Result<Self, IoError> {
        if self.recordings.is_empty() {
            let expected = format!("recordings {layout} of the classes {}", classes.join(", "));
            return Err(IoError::unfit(folder, expected, "none"));
        }
        Ok(self)
    }
}

/// Names of the classes of N-MNIST, which are the folders of a split.
const DIGITS: [&str; 10] = ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"];

/// The purpose of a recording.
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

/// A recording of events with its class.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EventRecording {
    /// Its path in the data set, without an extension: "train/3/00123".
    pub name: String,
    /// Its purpose.
    pub split: Split,
    /// Index of its class.
    pub class: usize,
    /// Its events, in the file's order; at least one, except for a press that the sensor did not
    /// detect.
    pub events: Vec<Event>,
    /// The times of the press, if they are known.
    pub contact: Option<Contact>,
}

impl EventRecording {
    /// The time from which its age counts: the time of contact if known, otherwise of its first
    /// event.
    pub fn begin_us(&self) -> i64 {
        let first = || self.events.first().map_or(0, |event| event.t_us);
        self.contact.map_or_else(first, |contact| contact.begin_us)
    }
}

/// The times of a robot's press on a sensor, in microseconds of the clock of its events; ascending.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Contact {
    /// Time at which the force reached 0.2 N.
    pub begin_us: i64,
    /// Time at which the force reached 2.5 N, at which it is then held.
    pub held_us: i64,
    /// Time at which the sensor was lifted.
    pub lifted_us: i64,
}

/// A recording of events with its class, which has not been read from its file yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EventFile {
    /// The file.
    pub path: PathBuf,
    /// Its path in the data set, as [`EventRecording::name`].
    pub name: String,
    /// Its purpose.
    pub split: Split,
    /// Index of its class.
    pub class: usize,
}

/// A set of recordings of events with a split and classes.
pub type EventDataset = Dataset<EventRecording>;

impl EventDataset {
    /// Reads digits seen by a moving event camera, in the layout of N-MNIST, with one or both
    /// splits. O(bytes); all events are held in memory.
    ///
    /// ```text
    /// DATA/<train|test>/<digit>/<number>.bin        DATA/train/3/00123.bin
    /// ```
    ///
    /// Every folder is a split or a digit, and every recording has an event. Every `.bin` file is
    /// read as [`Format::Nmnist`], on 34 x 34 pixels, whatever its content. Source: Orchard,
    /// Jayawant, Cohen and Thakor, "Converting static image datasets to spiking neuromorphic
    /// datasets using saccades", 2015.
    ///
    /// # Errors
    /// [`IoError`], with the path, if a folder or recording is missing or odd, or has no events.
    pub fn nmnist(folder: impl AsRef<Path>) -> Result<Self, IoError> {
        let Dataset { recordings, passed_over } = Dataset::nmnist_files(folder)?;
        Ok(Self {
            recordings: recordings.iter().map(EventFile::read).collect::<Result<_, _>>()?,
            passed_over,
        })
    }
}

impl Dataset<EventFile> {
    /// Lists the files that [`EventDataset::nmnist`] reads, in its order, without reading them.
    ///
    /// # Errors
    /// [`IoError`], with the path, if the folder is missing, has another layout, or has no
    /// recordings.
    pub fn nmnist_files(folder: impl AsRef<Path>) -> Result<Self, IoError> {
        let folder = folder.as_ref();
        let mut set = Self::new();
        for (split, folder) in set.subfolders(folder, &Split::ALL.map(Split::name))? {
            let split = Split::ALL[split];
            for (class, folder) in set.subfolders(&folder, &DIGITS)? {
                set.extend(&folder, "bin", |path| {
                    let name = format!("{split}/{class}/{}", stem(path));
                    Ok(EventFile { path: path.to_owned(), name, split, class })
                })?;
            }
        }
        set.not_empty(folder, "<train|test>/<digit>/<number>.bin", &DIGITS)
    }
}

impl EventFile {
    /// The recording in the file.
    ///
    /// # Errors
    /// [`IoError`], with the path, if it cannot be read, or has no events or an odd event.
    pub fn read(&self) -> Result<EventRecording, IoError> {
        let Self { path, name, split, class } = self;
        let events = read_with(path, ReadOptions::from(Format::Nmnist).strict(true))
            .map_err(IoError::content(path))?
            .events;
        if events.is_empty() {
            return Err(IoError::unfit(path, "events of five bytes", "none"));
        }
        Ok(EventRecording { name: name.clone(), split: *split, class: *class, events, contact: None })
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
    /// Number of readings of the recording before this row.
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

/// A recording of a slip, which has not been read from its file yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SlipFile {
    /// The file.
    pub path: PathBuf,
    /// As [`SlipRecording::name`].
    pub name: String,
    /// As [`SlipRecording::class`].
    pub class: usize,
    /// As [`SlipRecording::object`].
    pub object: String,
}

/// Slips on 24 electrodes, one folder per class: the `BioTac` direction-of-slip data set.
///
/// ```text
/// DATA/<class>/<object><number>.csv        DATA/n/pen178.csv
/// ```
///
/// Every folder is a class. Every `.csv` file is read as [`Electrodes`] reads it.
pub type SlipDataset = Dataset<SlipRecording>;

impl SlipDataset {
    /// Reads the data set in `folder`, whose folders are some or all of `classes`, in that order; a
    /// class is an index. O(bytes); all readings are held in memory.
    ///
    /// # Errors
    /// [`IoError`], with the path, if the folder or a recording is missing, has another layout,
    /// cannot be read, or has no readings; also with the line for a row that is not a reading, if
    /// `bad_rows` refuses it.
    pub fn read(folder: impl AsRef<Path>, classes: &[&str], bad_rows: BadRows) -> Result<Self, IoError> {
        let Dataset { recordings, passed_over } = Dataset::slip_files(folder, classes)?;
        let read = recordings.iter().map(|file| file.read(bad_rows));
        Ok(Self { recordings: read.collect::<Result<_, _>>()?, passed_over })
    }
}

impl Dataset<SlipFile> {
    /// Lists the files that [`SlipDataset::read`] reads, in its order, without reading them.
    ///
    /// # Errors
    /// [`IoError`], with the path, if the folder is missing, has another layout, or has no
    /// recordings.
    pub fn slip_files(folder: impl AsRef<Path>, classes: &[&str]) -> Result<Self, IoError> {
        let folder = folder.as_ref();
        let mut set = Self::new();
        for (class, folder) in set.subfolders(folder, classes)? {
            set.extend(&folder, "csv", |path| SlipFile::new(path, (class, classes[class])))?;
        }
        set.not_empty(folder, "<class>/<object><number>.csv", classes)
    }
}

impl SlipRecording {
    /// The readings in stretches without a refused row between them.
    ///
    /// # Panics
    /// If [`Self::refused`] was changed so that it does not ascend or exceeds the readings.
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

impl SlipFile {
    fn new(path: &Path, class: (usize, &str)) -> Result<Self, IoError> {
        let stem = stem(path);
        let object = stem.trim_end_matches(|c: char| c.is_ascii_digit());
        if object.is_empty() || object.len() == stem.len() {
            let expected = "an object's name and a number, such as pen178.csv";
            return Err(IoError::unfit(path, expected, format!("{:?}", name(path))));
        }
        let (name, object) = (format!("{}/{stem}", class.1), object.to_owned());
        Ok(Self { path: path.to_owned(), name, class: class.0, object })
    }

    /// The recording in the file.
    ///
    /// # Errors
    /// [`IoError`], with the path, if it cannot be read or has no readings; also with the
    /// line for a row that is not a reading, if `bad_rows` refuses it.
    pub fn read(&self, bad_rows: BadRows) -> Result<SlipRecording, IoError> {
        let path = &self.path;
        let file = File::open(path).map_err(IoError::file("open", path))?;
        let mut rows = Electrodes::new(BufReader::new(file), ElectrodeSettings::default());
        let (mut readings, mut refused) = (Vec::new(), Vec::new());
        for row in rows.by_ref() {
            match row {
                Ok(reading) => readings.push(reading),
                // The error is about one row, not about the header or the file.
                Err(problem @ IoError::Malformed { what: "row" | "field", .. })
                    if bad_rows == BadRows::PassOver =>
                {
                    refused.push(RefusedRow { after: readings.len(), problem });
                }
                Err(problem) => return Err(IoError::content(path)(problem)),
            }
        }
        if readings.is_empty() {
            return Err(IoError::unfit(path, "rows of readings below a header", "none"));
        }
        let (name, object) = (self.name.clone(), self.object.clone());
        Ok(SlipRecording { name, class: self.class, object, readings, refused, warnings: rows.warnings() })
    }
}

/// The file name without its extension.
fn stem(path: &Path) -> &str {
    path.file_stem().and_then(OsStr::to_str).unwrap_or_default()
}

/// The last part of `path`.
fn name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The entries of a folder in natural order of their names, without hidden ones.
fn visible_entries(folder: &Path) -> Result<Vec<PathBuf>, IoError> {
    let mut paths = entries(folder)?;
    paths.retain(|path| !name(path).starts_with('.'));
    Ok(paths)
}
