//! Folders that stand for classes, and what lies in them.
//!
//! Enters: a folder and the names that its folders may have. Leaves: these folders in the order of the names, and the
//! files of a folder in natural order. Names that start with a dot are nothing.

use std::path::{Path, PathBuf};

use super::error::DatasetError;
use crate::natural;

/// A folder whose folders are some or all of a list of names.
pub(super) struct Classes {
    /// Index into the names, and the folder of that name, ascending.
    pub(super) folders: Vec<(usize, PathBuf)>,
    /// Files beside the folders, in natural order.
    pub(super) files: Vec<PathBuf>,
}

/// What `folder` holds, whose folders must be of `names`.
pub(super) fn classes(folder: &Path, names: &[&str]) -> Result<Classes, DatasetError> {
    let expected = || names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
    if !folder.is_dir() {
        let found = if folder.exists() { "a file" } else { "nothing" };
        return Err(DatasetError::NoFolder { path: folder.to_owned(), expected: expected(), found });
    }
    let (folders, files): (Vec<_>, Vec<_>) = entries(folder)?.into_iter().partition(|path| path.is_dir());
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

/// The files in `folder` with this extension in either case, and all else that it holds, both in natural order.
pub(super) fn files(folder: &Path, extension: &str) -> Result<(Vec<PathBuf>, Vec<PathBuf>), DatasetError> {
    let fits = |path: &PathBuf| {
        path.is_file() && path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
    };
    Ok(entries(folder)?.into_iter().partition(fits))
}

/// The last part of `path`.
pub(super) fn name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
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
