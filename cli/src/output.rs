//! Standard output, and files that the program writes.

use std::fs::{self, OpenOptions};
use std::io::{self, BufWriter, StdoutLock, Write, stdout};
use std::path::{Path, PathBuf};

use meissner_pipeline::streams::is_stdin;
use serde::Serialize;

use crate::error::CliError;
use crate::text::Folded;

/// Standard output.
pub(crate) type Out = Folded<BufWriter<StdoutLock<'static>>>;

/// Standard output, with long lines folded for people.
pub(crate) fn out(json: bool) -> Out {
    Folded::new(BufWriter::new(stdout().lock()), !json)
}

/// Writes `report` to standard output: as one line of JSON, or as `text`.
pub(crate) fn print(
    as_json: bool,
    report: &impl Serialize,
    text: impl FnOnce(&mut Out) -> io::Result<()>,
) -> Result<(), CliError> {
    let mut out = out(as_json);
    if as_json {
        out.write_all(&json(report)?)?;
    } else {
        text(&mut out)?;
    }
    Ok(out.flush()?)
}

/// Checks before minutes of work that the file at `path` can be written. An existing file is left as it is, and none is
/// created.
pub(crate) fn check_writable(path: &Path) -> Result<(), CliError> {
    let failed = |source| CliError::write(path, source);
    match OpenOptions::new().create_new(true).append(true).open(path) {
        Ok(_) => fs::remove_file(path).map_err(failed),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            OpenOptions::new().append(true).open(path).map(drop).map_err(failed)
        }
        Err(error) => Err(failed(error)),
    }
}

/// [`check_writable`] for all of `paths` that are files.
pub(crate) fn check_all_writable<const N: usize>(paths: [&Option<PathBuf>; N]) -> Result<(), CliError> {
    paths.into_iter().flatten().filter(|path| !is_stdin(path)).try_for_each(|path| check_writable(path))
}

/// Writes `report` as JSON to the file at `json`, and `text` to standard output, where JSON takes its place for -.
pub(crate) fn report(
    json: Option<&Path>,
    report: &impl Serialize,
    text: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), CliError> {
    let prints_json = json.is_some_and(is_stdin);
    if let Some(path) = json.filter(|_| !prints_json) {
        write(path, self::json(report)?)?;
    }
    print(prints_json, report, |out| text(out))
}

/// `report` as one line of JSON.
pub(crate) fn json(report: &impl Serialize) -> Result<Vec<u8>, io::Error> {
    let mut text = serde_json::to_vec(report)?;
    text.push(b'\n');
    Ok(text)
}

/// Writes `content` to the file at `path`, which is replaced if it exists.
pub(crate) fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<(), CliError> {
    fs::write(path, content).map_err(|source| CliError::write(path, source))
}
