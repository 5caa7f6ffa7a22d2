//! Images and sequences of images: bytes to interleaved 8-bit RGB, and RGB to PNG.
//!
//! | format | reads | writes |
//! |---|---|---|
//! | PNG, any colour type and depth, interlaced or not | yes | 8-bit RGB |
//! | PPM and PGM, binary (`P6`, `P5`), 8 and 16 bits | yes | |
//! | JPEG, baseline and progressive | yes | |
//!
//! The format is found from the content. Grey is repeated in the three channels; alpha is dropped, not blended. A sample v of
//! the range 0..=m becomes round(255 v / m), so that a 16-bit sample that repeats 8 bits gives these 8 bits. Gamma, colour
//! profiles and the camera's orientation are ignored.
//!
//! Invariant: a file that is cut short or corrupt gives an [`ImageError`] with the place; an image of more than
//! [`crate::limits::IMAGE_PIXELS`] pixels is refused before memory of its size is allocated.

mod image;
mod jpeg;
mod png;
mod pnm;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::vec;

use crate::error::{Place, shown};
use crate::files::entries;
use crate::format::{ImageFormat, Kind};
use crate::limits::IMAGE_BYTES;
use crate::text::BYTE_ORDER_MARK;
pub use image::{Image, ImageError};
pub use png::{encode_png, write_png};

/// Reads the image of the file at `path`.
///
/// # Errors
/// [`ImageError::File`] where the file cannot be read, [`ImageError::Content`] with its path and the errors of
/// [`decode_image`] where its content is malformed or longer than [`IMAGE_BYTES`].
pub fn read_image(path: &Path) -> Result<Image, ImageError> {
    let bytes = read_bounded(path)?;
    decode_image(&bytes)
        .map_err(|source| ImageError::Content { path: path.to_owned(), source: Box::new(source) })
}

/// Decodes `bytes`, the whole content of an image file.
///
/// # Errors
/// [`ImageError::UnknownFormat`], or [`ImageError::Truncated`], [`ImageError::Malformed`] and
/// [`ImageError::TooLarge`] where the content is malformed.
pub fn decode_image(bytes: &[u8]) -> Result<Image, ImageError> {
    match ImageFormat::detect(bytes) {
        Some(ImageFormat::Png) => png::decode(bytes),
        Some(ImageFormat::Jpeg) => jpeg::decode(bytes),
        Some(ImageFormat::Pnm) => pnm::decode(bytes),
        None => Err(ImageError::UnknownFormat {
            length: bytes.len() as u64,
            start: shown(&bytes[..bytes.len().min(8)]),
        }),
    }
}

/// The bytes of a file, at most [`IMAGE_BYTES`].
fn read_bounded(path: &Path) -> Result<Vec<u8>, ImageError> {
    let refused = |action| move |source| ImageError::File { action, path: path.to_owned(), source };
    let file = File::open(path).map_err(refused("open"))?;
    let mut bytes = Vec::new();
    // The length that the file system reports may be wrong: the bytes read are counted.
    file.take(IMAGE_BYTES + 1).read_to_end(&mut bytes).map_err(refused("read"))?;
    let actual = bytes.len() as u64;
    if actual > IMAGE_BYTES {
        let source = Box::new(ImageError::TooLarge { what: "bytes of a file", limit: IMAGE_BYTES, actual });
        return Err(ImageError::Content { path: path.to_owned(), source });
    }
    Ok(bytes)
}

/// The images of a sequence with their paths, one at a time, each read when it is asked for.
///
/// The first image that can be read determines the size. A malformed image or one of another size gives an error, and the
/// next call continues with the next file. A caller who needs every image stops at the first error.
#[derive(Clone, Debug)]
pub struct ImageSequence {
    paths: vec::IntoIter<PathBuf>,
    size: Option<(usize, usize)>,
}

impl ImageSequence {
    /// The sequence at `path`, which is one of:
    ///
    /// - a folder: its files with the extension of an image format, by name in natural order (`img2` before
    ///   `img10`); other files and subfolders are skipped;
    /// - an image (by its content): this image;
    /// - a text: a list of paths, one a line, relative to the list's folder, in the list's order. Blank lines and
    ///   lines that start with `#` are skipped; spaces around a path are not part of it.
    ///
    /// # Errors
    /// [`ImageError::File`] where `path` cannot be read, [`ImageError::NoImages`] where it has no image,
    /// [`ImageError::OtherKind`] where it has another known kind, [`ImageError::List`] where it is neither an image nor a
    /// text, [`ImageError::Content`] where it is longer than [`crate::limits::IMAGE_BYTES`].
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        if path.is_dir() {
            let expected = "a file with the extension png, jpg, jpeg, ppm, pgm or pnm";
            return Self::new(folder(path)?, path, expected);
        }
        let content = match read_bounded(path) {
            // A long recording is refused by its kind, not by its length.
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

    /// The paths that were not read yet.
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
    let mut files = entries(path).map_err(refused)?;
    files.retain(|file| ImageFormat::from_path(file).is_some() && file.is_file());
    Ok(files)
}

/// The paths of a list.
fn list(path: &Path, content: &[u8]) -> Result<Vec<PathBuf>, ImageError> {
    let beside = path.parent().unwrap_or(Path::new(""));
    let content = content.strip_prefix(BYTE_ORDER_MARK).unwrap_or(content);
    let mut paths = Vec::new();
    for (index, line) in content.split(|&b| b == b'\n').enumerate() {
        let line = line.trim_ascii();
        if line.is_empty() || line.starts_with(b"#") {
            continue;
        }
        match str::from_utf8(line) {
            Ok(text) if !text.contains(char::is_control) => paths.push(beside.join(text)),
            _ => {
                let (place, actual) = (Place::Line(index as u64 + 1), shown(line));
                return Err(ImageError::List { path: path.to_owned(), place, actual });
            }
        }
    }
    Ok(paths)
}
