//! Images and sequences of images: bytes to interleaved 8-bit RGB, and RGB to PNG.
//!
//! | format | reads | writes |
//! |---|---|---|
//! | PNG, any colour type and depth, interlaced or not | yes | 8-bit RGB |
//! | PPM and PGM, binary (`P6`, `P5`), 8 and 16 bits | yes | |
//! | JPEG, baseline and progressive | yes | |
//!
//! The format is found from the content; a raw video ([`RawVideo`]) has none, and its caller knows
//! it. Grey is repeated in the three channels; alpha is dropped, not blended. A sample v of the
//! range 0..=m becomes round(255 v / m). Gamma, colour profiles and the camera's orientation are
//! ignored.
//!
//! Invariant: a file that is cut short or corrupt gives an [`IoError`] with the place; an image of
//! more than [`crate::limits::IMAGE_PIXELS`] is refused before it is allocated.

mod jpeg;
mod png;
mod pnm;
mod video;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::vec;

use crate::bytes::Bytes;
use crate::error::{IoError, Place, shown};
use crate::files::entries;
use crate::format::{Format, ImageFormat, Kind};
use crate::limits::{IMAGE_BYTES, IMAGE_PIXELS};
use crate::mcap::images::McapImages;
use crate::text::BYTE_ORDER_MARK;
pub use png::{encode_palette_png, encode_png, write_png};
pub use video::{PixelFormat, RawVideo, VideoFormat};

/// Reads the image of the file at `path`.
///
/// # Errors
/// [`IoError::File`] where the file cannot be read, [`IoError::Content`] with its path and the
/// errors of [`decode_image`] where its content is malformed or longer than [`IMAGE_BYTES`].
pub fn read_image(path: &Path) -> Result<Image, IoError> {
    decode_image(&read_bounded(path)?).map_err(IoError::content(path))
}

/// Decodes `bytes`, the whole content of an image file.
///
/// # Errors
/// [`IoError::UnknownFormat`], or [`IoError::Truncated`], [`IoError::Malformed`] and
/// [`IoError::TooLarge`] where the content is malformed.
pub fn decode_image(bytes: &[u8]) -> Result<Image, IoError> {
    let Some(format) = ImageFormat::detect(bytes) else {
        let (length, start) = (bytes.len() as u64, shown(&bytes[..bytes.len().min(8)]));
        let expected = "PNG, JPEG, binary PPM or PGM";
        return Err(IoError::UnknownFormat { what: "image format", expected, length, start });
    };
    let file = Bytes::file(format.name(), bytes);
    match format {
        ImageFormat::Png => png::decode(file),
        ImageFormat::Jpeg => jpeg::decode(file),
        ImageFormat::Pnm => pnm::decode(file),
    }
}

/// The bytes of a file, at most [`IMAGE_BYTES`].
fn read_bounded(path: &Path) -> Result<Vec<u8>, IoError> {
    let file = File::open(path).map_err(IoError::file("open", path))?;
    let mut bytes = Vec::new();
    // The length that the file system reports may be wrong: the bytes read are counted.
    file.take(IMAGE_BYTES + 1).read_to_end(&mut bytes).map_err(IoError::file("read", path))?;
    let actual = bytes.len() as u64;
    if actual > IMAGE_BYTES {
        let error = Bytes::file("image", &bytes).too_large("file", 0, IMAGE_BYTES, actual, true);
        return Err(IoError::content(path)(error));
    }
    Ok(bytes)
}

/// The images of a sequence with their paths, one at a time, each read when it is asked for.
///
/// The first image that can be read determines the size. A malformed image or one of another size
/// gives an error, and the next call takes the next file.
#[derive(Clone, Debug)]
pub struct ImageSequence {
    paths: vec::IntoIter<PathBuf>,
    /// The pictures of a file of MCAP, whose paths are made of their numbers.
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
    ///   with the paths `FILE/000001.png` and so on, which lead to no files;
    /// - a text: a list of paths, one a line, relative to its folder. Blank lines, lines that start
    ///   with `#`, and spaces around a path are skipped.
    ///
    /// # Errors
    /// [`IoError::File`] where `path` cannot be read, [`IoError::Unfit`] where it has no image,
    /// [`IoError::Content`] where it has another known kind, is neither an image nor a text, or is
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

/// An RGB image of 8 bits a channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels of a row; at least 1.
    pub width: usize,
    /// Rows; at least 1.
    pub height: usize,
    /// `height` x `width` x 3 bytes: row-major from the top left; red, green and blue of a pixel
    /// side by side.
    pub data: Vec<u8>,
}

impl Image {
    /// Channels of every image: red, green, blue.
    pub const CHANNELS: usize = 3;

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }
}

/// The number of pixels of the image in `file`; an error beyond [`IMAGE_PIXELS`].
pub(crate) fn pixels(file: Bytes<'_>, width: u64, height: u64) -> Result<usize, IoError> {
    let (limit, actual) = (IMAGE_PIXELS, width.saturating_mul(height));
    if actual > limit {
        let (format, what, place, unit) = (file.format, "image", file.origin, "pixels");
        return Err(IoError::TooLarge { format, what, place, unit, limit, actual, at_least: false });
    }
    Ok(actual as usize)
}

/// The big-endian sample in one or two bytes.
fn sample(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |value, &byte| value << 8 | u32::from(byte))
}

/// round(255 v / m), halves upwards, for v from 0 to m.
fn to_8_bits(v: u32, m: u32) -> u8 {
    ((v * 255 + m / 2) / m) as u8
}
