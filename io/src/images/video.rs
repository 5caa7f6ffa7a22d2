//! Raw video: pictures of one size, one after the other, without any header.
//!
//! `ffmpeg -f rawvideo -pix_fmt rgb24 -` writes this format; an array of `OpenCV` as bytes has it
//! too (`bgr24`). A picture is row-major from the top left, without padding between rows.
//!
//! Nothing in the bytes separates pictures: with a wrong size or pixel format, the result is
//! different pictures. Only remaining bytes at the end show the mistake.

use std::fmt;
use std::io::{self, Read};
use std::str::FromStr;

use super::{Image, pixels};
use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::format::UnknownName;

/// The name in messages.
const NAME: &str = "raw video";

/// The bytes of a pixel, by the names of ffmpeg's `-pix_fmt`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PixelFormat {
    /// Red, green, blue.
    #[default]
    Rgb24,
    /// Blue, green, red, as in `OpenCV`.
    Bgr24,
    /// One byte of grey.
    Gray8,
}

impl PixelFormat {
    const fn name(self) -> &'static str {
        match self {
            Self::Rgb24 => "rgb24",
            Self::Bgr24 => "bgr24",
            Self::Gray8 => "gray8",
        }
    }

    const fn bytes(self) -> usize {
        match self {
            Self::Rgb24 | Self::Bgr24 => 3,
            Self::Gray8 => 1,
        }
    }
}

impl fmt::Display for PixelFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for PixelFormat {
    type Err = UnknownName;

    /// `rgb24`, `bgr24`, and `gray8` or `gray`.
    fn from_str(name: &str) -> Result<Self, UnknownName> {
        match name {
            "rgb24" => Ok(Self::Rgb24),
            "bgr24" => Ok(Self::Bgr24),
            "gray8" | "gray" => Ok(Self::Gray8),
            _ => Err(UnknownName::new("pixel format", "rgb24, bgr24 or gray8", name)),
        }
    }
}

/// Size and pixels of the pictures of a raw video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VideoFormat {
    width: usize,
    height: usize,
    pixels: PixelFormat,
}

impl VideoFormat {
    /// Pictures of `width` x `height` pixels.
    ///
    /// # Errors
    /// [`IoError::Unsupported`] for a picture without pixels, [`IoError::TooLarge`] for one of more
    /// than [`IMAGE_PIXELS`](crate::limits::IMAGE_PIXELS).
    pub fn new(width: u64, height: u64, pixels: PixelFormat) -> Result<Self, IoError> {
        if width == 0 || height == 0 {
            let (expected, actual) = ("raw video of at least 1x1 pixels", format!("{width}x{height}"));
            return Err(IoError::Unsupported { expected, actual });
        }
        self::pixels(Bytes::file(NAME, &[]), width, height)?;
        Ok(Self { width: width as usize, height: height as usize, pixels })
    }

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Bytes of a picture.
    pub fn bytes(&self) -> usize {
        self.width * self.height * self.pixels.bytes()
    }
}

impl fmt::Display for VideoFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{NAME}, {}, {}x{} pixels", self.pixels, self.width, self.height)
    }
}

/// The pictures of a raw video, each as soon as its last byte has arrived.
///
/// No call reads beyond its picture, except for the content of the reader's own buffer. A picture
/// takes O(its bytes), and is allocated once. There are no further items after an error:
/// [`IoError::Truncated`] for an input that ends inside a picture or has none, and
/// [`IoError::Stream`] for a reader's failure.
///
/// ```
/// use meissner_io::{PixelFormat, RawVideo, VideoFormat};
///
/// let format = VideoFormat::new(2, 1, PixelFormat::Gray8)?;
/// let pictures = RawVideo::new(&[0, 255, 7, 8][..], format).collect::<Result<Vec<_>, _>>()?;
/// assert_eq!(pictures[0].data, [0, 0, 0, 255, 255, 255]);
/// assert_eq!(pictures.len(), 2);
/// # Ok::<(), meissner_io::IoError>(())
/// ```
#[derive(Debug)]
pub struct RawVideo<R> {
    input: R,
    format: VideoFormat,
    /// Bytes of all pictures so far.
    read: u64,
    ended: bool,
}

impl<R: Read> RawVideo<R> {
    /// The pictures of `input`.
    pub fn new(input: R, format: VideoFormat) -> Self {
        Self { input, format, read: 0, ended: false }
    }

    /// Size and pixels of the pictures.
    pub fn format(&self) -> VideoFormat {
        self.format
    }

    /// The bytes of the next picture; `None` at the end.
    fn bytes(&mut self) -> Result<Option<Vec<u8>>, IoError> {
        let mut bytes = vec![0; self.format.bytes()];
        let mut filled = 0;
        while filled < bytes.len() {
            match self.input.read(&mut bytes[filled..]) {
                Ok(0) if filled == 0 && self.read > 0 => return Ok(None),
                Ok(0) => {
                    let (what, place) = ("picture", Place::Byte(self.read));
                    let (expected, actual) = (bytes.len() as u64, filled as u64);
                    return Err(IoError::Truncated {
                        format: NAME,
                        what,
                        place,
                        expected,
                        actual,
                        at_least: false,
                    });
                }
                Ok(count) => filled += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(source) => {
                    let (action, place) = ("read", Place::Byte(self.read + filled as u64));
                    return Err(IoError::Stream { format: NAME, action, place, source });
                }
            }
        }
        self.read += bytes.len() as u64;
        Ok(Some(bytes))
    }

    /// The picture of these bytes.
    fn image(&self, mut bytes: Vec<u8>) -> Image {
        let VideoFormat { width, height, pixels } = self.format;
        let data = match pixels {
            PixelFormat::Rgb24 => bytes,
            PixelFormat::Bgr24 => {
                bytes.as_chunks_mut::<3>().0.iter_mut().for_each(|pixel| pixel.swap(0, 2));
                bytes
            }
            PixelFormat::Gray8 => bytes.iter().flat_map(|&grey| [grey; Image::CHANNELS]).collect(),
        };
        Image { width, height, data }
    }
}

impl<R: Read> Iterator for RawVideo<R> {
    type Item = Result<Image, IoError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let bytes = self.bytes();
        self.ended = !matches!(bytes, Ok(Some(_)));
        bytes.map(|bytes| bytes.map(|bytes| self.image(bytes))).transpose()
    }
}
