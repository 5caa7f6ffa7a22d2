//! A sequence of images of one size: a folder, a list of paths, or one file.

use std::fs;
use std::path::{Path, PathBuf};
use std::vec;

use super::error::ImageError;
use super::format::ImageFormat;
use super::image::{Image, read_bounded, read_image};
use crate::error::Place;
use crate::kind::Kind;
use crate::natural;

/// The images of a sequence with their paths, one at a time, each read when it is asked for.
///
/// The first image that can be read gives the size. An image that is at fault or has another size gives an error, and
/// the next call goes on with the file after it; a caller who wants all or nothing stops at the first error.
#[derive(Clone, Debug)]
pub struct ImageSequence {
    paths: vec::IntoIter<PathBuf>,
    size: Option<(usize, usize)>,
}

impl ImageSequence {
    /// The sequence that `path` stands for:
    ///
    /// - a folder: its files with the extension of an image format, by name in natural order (`img2` before
    ///   `img10`); others and folders inside it are passed over;
    /// - an image (by its content): this one;
    /// - a text: a list of paths, one a line, relative to the list's folder, in the list's order. Blank lines and
    ///   lines that start with `#` are passed over, spaces around a path are not part of it.
    ///
    /// # Errors
    /// [`ImageError::File`] where `path` cannot be read, [`ImageError::NoImages`] where it names none,
    /// [`ImageError::OtherKind`] where it is known and no image, [`ImageError::List`] where a file is neither an image nor a text, [`ImageError::Content`] where it is longer
    /// than [`crate::limits::IMAGE_BYTES`].
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        if path.is_dir() {
            return Self::new(
                folder(path)?,
                path,
                "a file with the extension png, jpg, jpeg, ppm, pgm or pnm",
            );
        }
        let content = match read_bounded(path) {
            // A long recording is refused for what it is.
            Err(ImageError::Content { .. }) if let Ok(Some(found)) = Kind::of_file(path) => {
                return Err(ImageError::OtherKind { path: path.to_owned(), found });
            }
            content => content?,
        };
        if ImageFormat::detect(&content).is_some() {
            return Self::new(vec![path.to_owned()], path, "this one");
        }
        match Kind::of(&content) {
            None => Self::new(list(path, &content)?, path, "a line with a path"),
            Some(found) => Err(ImageError::OtherKind { path: path.to_owned(), found }),
        }
    }

    fn new(paths: Vec<PathBuf>, path: &Path, expected: &'static str) -> Result<Self, ImageError> {
        if paths.is_empty() {
            return Err(ImageError::NoImages { path: path.to_owned(), expected });
        }
        Ok(Self { paths: paths.into_iter(), size: None })
    }

    /// The paths that have not been read yet.
    pub fn paths(&self) -> &[PathBuf] {
        self.paths.as_slice()
    }
}

impl Iterator for ImageSequence {
    type Item = Result<(PathBuf, Image), ImageError>;

    fn next(&mut self) -> Option<Self::Item> {
        let path = self.paths.next()?;
        Some(read_image(&path).and_then(|image| {
            let (expected, found) = (*self.size.get_or_insert(image.size()), image.size());
            if found == expected {
                Ok((path, image))
            } else {
                Err(ImageError::Size { path, expected, found })
            }
        }))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.paths.size_hint()
    }
}

impl ExactSizeIterator for ImageSequence {}

/// The image files of a folder in natural order of their names.
fn folder(path: &Path) -> Result<Vec<PathBuf>, ImageError> {
    let refused = |source| ImageError::File { action: "list", path: path.to_owned(), source };
    let mut files = Vec::new();
    for entry in fs::read_dir(path).map_err(refused)? {
        let file = entry.map_err(refused)?.path();
        if ImageFormat::from_path(&file).is_some() && file.is_file() {
            files.push(file);
        }
    }
    let name = |file: &PathBuf| file.file_name().map(|n| n.as_encoded_bytes().to_vec()).unwrap_or_default();
    files.sort_by(|a, b| natural::compare(&name(a), &name(b)));
    Ok(files)
}

/// The paths of a list.
fn list(path: &Path, content: &[u8]) -> Result<Vec<PathBuf>, ImageError> {
    let beside = path.parent().unwrap_or(Path::new(""));
    let content = content.strip_prefix(b"\xef\xbb\xbf").unwrap_or(content);
    let mut paths = Vec::new();
    for (index, line) in content.split(|&b| b == b'\n').enumerate() {
        let line = line.trim_ascii();
        if line.is_empty() || line.starts_with(b"#") {
            continue;
        }
        match str::from_utf8(line) {
            Ok(text) if !text.contains(char::is_control) => paths.push(beside.join(text)),
            _ => {
                let actual = format!("`{}`", line[..line.len().min(40)].escape_ascii());
                return Err(ImageError::List {
                    path: path.to_owned(),
                    place: Place::Line(index as u64 + 1),
                    actual,
                });
            }
        }
    }
    Ok(paths)
}
