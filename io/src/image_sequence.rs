//! Sequences of images: a folder, a list, the pictures of an MCAP file.

use std::path::{Path, PathBuf};
use std::vec;

use crate::bytes::Bytes;
use crate::error::{IoError, Place, shown};
use crate::files::entries;
use crate::format::{Format, ImageFormat, Kind};
use crate::images::{Image, read_bounded, read_image};
use crate::mcap::images::McapImages;
use crate::text::BYTE_ORDER_MARK;

/// The images of a sequence with their paths, one at a time, each read when it is requested.
///
/// The first image that can be read determines the size. A malformed image or one of another size
/// gives an error, and the next call takes the next file.
#[derive(Clone, Debug)]
pub struct ImageSequence {
    paths: vec::IntoIter<PathBuf>,
    /// The pictures of an MCAP file. Their paths are made from their numbers.
    within: Option<McapImages>,
    size: Option<(usize, usize)>,
}

impl ImageSequence {
    /// The sequence at `path`, which is one of:
    ///
    /// - a folder: its files with the extension of an image format, in natural order (`img2` before
    ///   `img10`);
    /// - an image (by its content): this image;
    /// - a file of MCAP: the pictures of its first topic that has any (`sensor_msgs/msg/Image` and
    ///   `CompressedImage` in CDR, `foxglove.RawImage` and `CompressedImage` in JSON or protobuf),
    ///   with the paths `FILE/000001.png` and so on, which are not files;
    /// - a text: a list of paths, one per line, relative to its folder. Blank lines, lines that
    ///   start with `#`, and spaces around a path are skipped.
    ///
    /// # Errors
    /// [`IoError::File`] if `path` cannot be read, [`IoError::Unfit`] if it has no image,
    /// [`IoError::Content`] if it has another known kind, is neither an image nor a text, or is
    /// longer than [`crate::limits::IMAGE_BYTES`].
    pub fn open(path: &Path) -> Result<Self, IoError> {
        if path.is_dir() {
            let mut files = entries(path)?;
            files.retain(|file| ImageFormat::from_path(file).is_some() && file.is_file());
            return Self::new(files, path, "a file with the extension png, jpg, jpeg, ppm, pgm or pnm");
        }
        let content = read_bounded(path);
        let kind = match &content {
            Ok(content) => Kind::of(content),
            // A long recording is refused by its kind, not by its length.
            Err(IoError::Content { .. }) => Kind::of_file(path).unwrap_or(None),
            Err(_) => None,
        };
        match kind {
            Some(Kind::Picture(_)) => {
                content.and_then(|_| Self::new(vec![path.to_owned()], path, "this one"))
            }
            Some(Kind::Events(Format::Mcap)) => {
                let within = McapImages::open(path).map_err(IoError::content(path))?;
                let paths = (1..=within.len()).map(|number| path.join(format!("{number:06}.png"))).collect();
                Ok(Self { within: Some(within), ..Self::new(paths, path, "one in a topic")? })
            }
            Some(found) => {
                let expected = "a picture, a folder or a list of them";
                Err(IoError::content(path)(IoError::OtherKind { expected, found }))
            }
            None => Self::new(list(path, &content?)?, path, "a line with a path"),
        }
    }

    fn new(paths: Vec<PathBuf>, path: &Path, expected: &str) -> Result<Self, IoError> {
        if paths.is_empty() {
            return Err(IoError::unfit(path, format!("at least one image ({expected})"), "none"));
        }
        Ok(Self { paths: paths.into_iter(), within: None, size: None })
    }

    /// The paths that were not read yet.
    pub fn paths(&self) -> &[PathBuf] {
        self.paths.as_slice()
    }
}

impl Iterator for ImageSequence {
    type Item = Result<(PathBuf, Image), IoError>;

    fn next(&mut self) -> Option<Self::Item> {
        let path = self.paths.next()?;
        let read = match self.within.as_mut().and_then(McapImages::next) {
            Some(image) => image.map_err(IoError::content(&path)),
            None => read_image(&path),
        };
        Some(read.and_then(|image| {
            let (expected, found) = (*self.size.get_or_insert(image.size()), image.size());
            if found == expected {
                return Ok((path, image));
            }
            let expected = format!("{}x{} pixels as in the first image", expected.0, expected.1);
            Err(IoError::unfit(&path, expected, format!("{}x{}", found.0, found.1)))
        }))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.paths.size_hint()
    }
}

impl ExactSizeIterator for ImageSequence {}

/// The paths of a list.
fn list(path: &Path, content: &[u8]) -> Result<Vec<PathBuf>, IoError> {
    let beside = path.parent().unwrap_or(Path::new(""));
    let content = content.strip_prefix(BYTE_ORDER_MARK).unwrap_or(content);
    let mut paths = Vec::new();
    for (line, number) in content.split(|&b| b == b'\n').map(<[u8]>::trim_ascii).zip(1..) {
        if line.is_empty() || line.starts_with(b"#") {
            continue;
        }
        match str::from_utf8(line) {
            Ok(text) if !text.contains(char::is_control) => paths.push(beside.join(text)),
            _ => {
                let line = Bytes { format: "list of images", data: line, origin: Place::Line(number) };
                let error = line.malformed("path", 0, "a path in UTF-8", shown(line.data));
                return Err(IoError::content(path)(error));
            }
        }
    }
    Ok(paths)
}
