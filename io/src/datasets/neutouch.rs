//! `NeuTouch`: spikes of a tactile skin with 39 taxels, from arrays in a zip archive to labelled
//! recordings of events.
//!
//! Input: a folder with the archive of a set. Output: its recordings. A spike of a taxel in a bin
//! is an event at the position of the taxel and at the beginning of the bin. All events of a bin
//! have the same time; they are ordered by taxel, and for one taxel rising pressure precedes
//! falling pressure. Source: Taunyazov et al., "Event-driven visual-tactile sensing and learning
//! for robots", 2020, for the sensor; Gu et al., "`TactileSGNet`", 2020, for the arrays.

use std::path::{Path, PathBuf};

use meissner_engine::Event;

use super::{Dataset, EventDataset, EventRecording, Split};
use crate::bytes::Bytes;
use crate::error::IoError;
use crate::format::Format;
use crate::{npy, zip};

/// Length of a bin in microseconds.
const BIN_US: i64 = 20_000;

/// Positions of the taxels, in steps of 0.05 mm from the smallest x and the smallest y.
#[rustfmt::skip]
const PLACES: [(u16, u16); 39] = [
    (0, 178), (14, 118), (14, 238), (28, 22), (28, 334), (50, 178), (59, 74), (59, 282), (58, 143), (58, 213),
    (88, 0), (85, 118), (88, 356), (85, 238), (90, 178), (106, 152), (106, 204), (120, 58), (120, 298), (120, 108),
    (120, 178), (120, 248), (136, 152), (136, 204), (152, 0), (152, 356), (150, 178), (155, 238), (155, 118), (181, 74),
    (182, 213), (181, 282), (182, 143), (192, 178), (212, 22), (212, 334), (226, 118), (226, 238), (240, 178),
];

/// A set of recordings of `NeuTouch`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum NeutouchSet {
    /// 36 objects, grasped and held: 720 recordings of 250 bins.
    Objects,
    /// 4 containers with 5 fillings each, grasped and lifted: 300 recordings of 325 bins.
    Containers,
}

impl NeutouchSet {
    /// The file with its recordings.
    fn archive(self) -> &'static str {
        match self {
            Self::Objects => "Ev-Objects.zip",
            Self::Containers => "Ev-Containers.zip",
        }
    }

    /// Number of its classes.
    pub fn classes(self) -> usize {
        match self {
            Self::Objects => 36,
            Self::Containers => 20,
        }
    }

    /// The index of rising pressure along the second axis of an array.
    ///
    /// The data do not state it. A contact begins with this index: it occurs in 82 % of the
    /// objects' first bins and 65 % of the containers', the other index in 23 % and 43 %.
    fn rising(self) -> usize {
        match self {
            Self::Objects => 0,
            Self::Containers => 1,
        }
    }
}

impl EventDataset {
    /// Reads the recordings of `set` from its archive in `folder`, `Ev-Objects.zip` or
    /// `Ev-Containers.zip`; `folder` may also be the path of the archive itself, with or without
    /// `.zip`. Their pixels are steps of 0.05 mm, on 241 x 357. O(bytes) of the arrays; all events
    /// are held in memory.
    ///
    /// The archive has arrays `<train|test>/sample_<number>_label_<class>.npy` of f32, taxel by
    /// polarity by bin, 1 for a spike, else 0. Other files and hidden files are skipped.
    ///
    /// # Errors
    /// [`IoError`], with the path, if the archive is missing or cannot be read, or has no
    /// recording, two of one name, one of another class or shape, or one without spikes. Contents
    /// beyond [`limits`](crate::limits) are refused.
    pub fn neutouch(folder: impl AsRef<Path>, set: NeutouchSet) -> Result<Self, IoError> {
        let path = archive(folder.as_ref(), set);
        let bytes = std::fs::read(&path).map_err(IoError::file("read", &path))?;
        let mut found = Self::new();
        let mut numbers = Vec::new();
        zip::for_each(&bytes, |name, content| {
            let path = path.join(name);
            let hidden = |part: &str| part.starts_with('.') || part == "__MACOSX";
            if name.split('/').any(hidden) {
                return Ok(());
            }
            if path.extension().is_none_or(|extension| extension != "npy") {
                found.passed_over.push(path);
                return Ok(());
            }
            let Some((split, number, class)) = parts(name).filter(|&(_, _, class)| class < set.classes())
            else {
                let last = set.classes() - 1;
                let expected = format!("<train|test>/sample_<number>_label_<0 to {last}>.npy");
                return Err(IoError::unfit(&path, expected, "another name"));
            };
            let events = events(content, set.rising()).map_err(IoError::content(&path))?;
            if events.is_empty() {
                return Err(IoError::unfit(&path, "an array with spikes", "none"));
            }
            let name = format!("{split}/{}", path.file_stem().unwrap_or_default().display());
            numbers.push(number);
            found.recordings.push(EventRecording { name, split, class, events, contact: None });
            Ok(())
        })
        .map_err(IoError::content(&path))?;
        found.sorted(&numbers, &path)
    }

    /// The set, sorted by split, class and number; every recording must have a different name.
    fn sorted(self, numbers: &[u64], path: &Path) -> Result<Self, IoError> {
        let Dataset { recordings, passed_over } = self;
        let mut recordings: Vec<_> = recordings.into_iter().zip(numbers).collect();
        recordings
            .sort_by(|(a, i), (b, j)| (a.split, a.class, i, &a.name).cmp(&(b.split, b.class, j, &b.name)));
        if let Some([(twice, _), _]) = recordings.array_windows().find(|[(a, _), (b, _)]| a.name == b.name) {
            return Err(IoError::unfit(path, "one recording of a name", format!("two of {}", twice.name)));
        }
        if recordings.is_empty() {
            let expected = "arrays <train|test>/sample_<number>_label_<class>.npy";
            return Err(IoError::unfit(path, expected, "none"));
        }
        let recordings = recordings.into_iter().map(|(recording, _)| recording).collect();
        Ok(Self { recordings, passed_over })
    }
}

/// The path of the archive of `set`: in `folder`, or `folder` itself, with `.zip` or without.
fn archive(folder: &Path, set: NeutouchSet) -> PathBuf {
    let inside = folder.join(set.archive());
    let itself = folder.with_extension("zip");
    if inside.is_file() {
        inside
    } else if folder.is_file() || folder.file_name().is_some_and(|name| name == set.archive()) {
        folder.to_owned()
    } else if itself.file_name().is_some_and(|name| name == set.archive()) {
        itself
    } else {
        inside
    }
}

/// Split, number and class of the array `name`.
fn parts(name: &str) -> Option<(Split, u64, usize)> {
    let mut parts = name.rsplit('/');
    let number = parts.next()?.strip_suffix(".npy")?.strip_prefix("sample_")?;
    let split = parts.next()?;
    let (number, class) = number.split_once("_label_")?;
    let split = Split::ALL.into_iter().find(|known| known.name() == split)?;
    Some((split, number.parse().ok()?, class.parse().ok()?))
}

/// The events of an array, bin by bin; spikes of the index `rising` along its second axis are on.
fn events(content: &[u8], rising: usize) -> Result<Vec<Event>, IoError> {
    let npy::Array { shape: [taxels, polarities, bins], values, start } = npy::array_of(content, "<f4")?;
    let file = Bytes::file(Format::Npy.name(), content);
    if (taxels, polarities) != (PLACES.len() as u64, 2) {
        let found = format!("({taxels}, {polarities}, {bins})");
        return Err(file.malformed("array", start, format!("the shape ({}, 2, bins)", PLACES.len()), found));
    }
    let bins = bins as usize;
    let mut events = Vec::new();
    for bin in 0..bins {
        for (taxel, &(x, y)) in PLACES.iter().enumerate() {
            for index in [rising, 1 - rising] {
                let at = (taxel * 2 + index) * bins + bin;
                match f32::from_le_bytes(values[at]) {
                    0.0 => {}
                    1.0 => events.push(Event::new(bin as i64 * BIN_US, x, y, index == rising)),
                    other => return Err(file.malformed("value", start + 4 * at, "0 or 1", other)),
                }
            }
        }
    }
    Ok(events)
}
