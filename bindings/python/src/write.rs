//! Recordings: writes structured arrays to files.

use std::path::PathBuf;

use meissner::io::{self, Format};
use pyo3::prelude::*;

use crate::arrays::Pixels;
use crate::error::{Failure, Outcome};
use crate::events::Events;
use crate::recording::word;

/// Writes events to a file: "csv", "npy", "dat" or "evt3", by default by the extension.
///
/// Raises `RecordingError` if the format cannot represent an event, `InputError`, `DtypeError`,
/// `FileError`.
#[pyfunction]
#[pyo3(signature = (path, events, sensor=None, *, format=None))]
pub(crate) fn write(
    py: Python<'_>,
    path: PathBuf,
    events: &Bound<'_, PyAny>,
    sensor: Option<Pixels>,
    format: Option<&str>,
) -> Outcome<()> {
    let events = Events::new(events)?.to_vec()?;
    let format = match word::<Format>(format)? {
        Some(format) => format,
        None => Format::from_path(&path).map_err(|error| Failure::input(error.to_string()))?,
    };
    Ok(py.detach(|| io::write(&path, format, sensor.map(|sensor| sensor.0), &events))?)
}
