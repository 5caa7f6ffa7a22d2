//! Recordings of a user's own sensor: a folder, and folders in it.

use std::io;
use std::path::{Path, PathBuf};

use super::{Dataset, name, visible_entries};
use crate::error::IoError;
use crate::format::{Format, Kind};

/// A recording of a press, which has not been read from its file yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PressFile {
    /// The file.
    pub path: PathBuf,
    /// Its path in the folder, with `/` between folder and file: "wood/press2.aedat4".
    pub name: String,
}

impl Dataset<PressFile> {
    /// Lists the recordings in `folder` and in its folders, in natural order, without reading them.
    ///
    /// A file is a recording if its content or its extension is that of a format of events, or if
    /// it is packed. Files in `except` and hidden files are left out; other files are skipped and
    /// listed.
    ///
    /// # Errors
    /// [`IoError`] with the path, if a folder cannot be listed or a file cannot be opened.
    pub fn press_files(folder: impl AsRef<Path>, except: &[&Path]) -> Result<Self, IoError> {
        let folder = folder.as_ref();
        let except: Vec<PathBuf> = except.iter().filter_map(|path| path.canonicalize().ok()).collect();
        let mut set = Self::new();
        let mut add = |path: PathBuf, place: &str| -> Result<(), IoError> {
            if path.canonicalize().is_ok_and(|path| except.contains(&path)) {
                return Ok(());
            }
            if is_recording(&path).map_err(IoError::file("open", &path))? {
                let name = format!("{place}{}", name(&path));
                set.recordings.push(PressFile { path, name });
            } else {
                set.passed_over.push(path);
            }
            Ok(())
        };
        for path in visible_entries(folder)? {
            if !path.is_dir() {
                add(path, "")?;
                continue;
            }
            let place = format!("{}/", name(&path));
            // Deeper folders are skipped.
            visible_entries(&path)?.into_iter().try_for_each(|inner| add(inner, &place))?;
        }
        Ok(set)
    }
}

/// Whether the content or the name of the file shows that it contains events.
fn is_recording(path: &Path) -> io::Result<bool> {
    // Opening a pipe waits for a writer.
    if !path.is_file() {
        return Ok(false);
    }
    let named = Format::from_path(path).is_ok();
    Ok(match Kind::of_file(path)? {
        // Any short binary file may look like N-MNIST; a damaged file has only its name.
        Some(Kind::Events(Format::Nmnist)) | None => named,
        Some(Kind::Events(_)) => true,
        Some(Kind::Foreign(foreign)) => named || matches!(foreign.name, "gzip" | "a zip archive"),
        Some(_) => false,
    })
}
