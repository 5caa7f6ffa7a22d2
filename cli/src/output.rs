//! Files that the program writes.

use std::fs::{self, OpenOptions};
use std::io;
use std::path::Path;

use serde::Serialize;

use crate::error::CliError;

/// Finds out before minutes of work, not after them, and leaves what is there as it is: a file, or none.
pub(crate) fn check_writable(path: &Path) -> Result<(), CliError> {
    let failed = |source| CliError::Write { path: path.to_owned(), source };
    match OpenOptions::new().create_new(true).append(true).open(path) {
        Ok(_) => fs::remove_file(path).map_err(failed),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            OpenOptions::new().append(true).open(path).map(drop).map_err(failed)
        }
        Err(error) => Err(failed(error)),
    }
}

/// `report` as one line of JSON.
pub(crate) fn json(report: &impl Serialize) -> Result<Vec<u8>, io::Error> {
    let mut text = serde_json::to_vec(report)?;
    text.push(b'\n');
    Ok(text)
}

/// Writes `content` to the file at `path`, which is replaced where it exists.
pub(crate) fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<(), CliError> {
    fs::write(path, content).map_err(|source| CliError::Write { path: path.to_owned(), source })
}
