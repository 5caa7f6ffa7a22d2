//! Pictures in MCAP: each is read from the file when it is requested.
//!
//! | type of a message | written in | picture |
//! |---|---|---|
//! | `sensor_msgs/msg/Image` | CDR | pixels |
//! | `sensor_msgs/msg/CompressedImage` | CDR | PNG or JPEG |
//! | `foxglove.RawImage` | JSON, protobuf | pixels |
//! | `foxglove.CompressedImage` | JSON, protobuf | PNG or JPEG |
//!
//! Pixels are `rgb8`, `bgr8`, `rgba8`, `bgra8`, `mono8`, or `8UC1` and `8UC3` of `OpenCV` (blue
//! first). The pictures are those of the first topic that has any.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::vec;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde::Deserialize;

use super::cdr::Cdr;
use super::records::{Chunk, Container, Content, Encoding, MAGIC, Picture, RECORD_HEADER, op};
use crate::aedat4::packet::{Compression, Inflater};
use crate::bytes::{Bytes, array};
use crate::error::{IoError, Place, shown};
use crate::format::{Format, Kind};
use crate::images::{Image, decode_image, pixels};
use crate::limits::PACKET_BYTES;
use crate::seek::Input;

/// The pictures of a topic, in the order of the file.
#[derive(Clone, Debug)]
pub(crate) struct McapImages {
    path: PathBuf,
    form: Picture,
    /// For each picture: the position of the record that contains it, and the first byte and the
    /// length of its message in the record.
    places: vec::IntoIter<(u64, usize, usize)>,
    /// The newest record, unpacked.
    newest: Option<(u64, Vec<u8>)>,
}

impl McapImages {
    /// The pictures of the file at `path`. O(bytes of the file).
    ///
    /// # Errors
    /// [`IoError::File`], and those of the container; [`IoError::OtherKind`] for a file without
    /// pictures.
    pub(crate) fn open(path: &Path) -> Result<Self, IoError> {
        let mut input = input(path)?;
        let mut container = Container::default();
        let (mut places, mut topic) = (Vec::new(), None);
        Bytes::file(Format::Mcap.name(), &input.read(0, MAGIC.len() as u64)?).magic(MAGIC)?;
        let mut at = MAGIC.len() as u64;
        loop {
            let (op, length) = header(&mut input, at)?;
            if matches!(op, op::DATA_END | op::FOOTER) {
                break;
            }
            if matches!(op, op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK) {
                let content = unpacked(&mut input, at)?;
                container.records(records(at, &content), &mut |container, message| {
                    let (_, content) = container.topic(message.topic);
                    let is_picture = matches!(content, Content::Image(_));
                    let this = (message.topic, *content);
                    if is_picture
                        && *topic.get_or_insert(this) == this
                        && let Place::Packet { packet, byte } = message.data.origin
                    {
                        places.push((packet, byte as usize, message.data.len()));
                    }
                    Ok(())
                })?;
            }
            at += RECORD_HEADER as u64 + length;
        }
        let Some((_, Content::Image(form))) = topic else {
            let expected = "MCAP with a topic of pictures (sensor_msgs/msg/Image or CompressedImage, foxglove.RawImage or CompressedImage)";
            return Err(IoError::OtherKind { expected, found: Kind::Events(Format::Mcap) });
        };
        Ok(Self { path: path.to_owned(), form, places: places.into_iter(), newest: None })
    }

    /// The number of pictures that have not been read yet.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// The next picture, if there is one.
    pub(crate) fn next(&mut self) -> Option<Result<Image, IoError>> {
        let (record, start, length) = self.places.next()?;
        Some(self.read(record, start, length))
    }

    fn read(&mut self, record: u64, start: usize, length: usize) -> Result<Image, IoError> {
        let held = self.newest.take().filter(|(at, _)| *at == record);
        let (_, content) = match held {
            Some(held) => held,
            None => (record, unpacked(&mut input(&self.path)?, record)?),
        };
        let message = records(record, &content);
        let data = message.get("message", start, length);
        let image = data.and_then(|data| picture(self.form, Bytes { data, ..message.after(start) }));
        self.newest = Some((record, content));
        image
    }
}

/// The file at `path`.
fn input(path: &Path) -> Result<Input<File>, IoError> {
    let mut input = Input::new(File::open(path).map_err(IoError::file("open", path))?)?;
    input.format = Format::Mcap.name();
    Ok(input)
}

/// A part of the file at byte `at`.
fn part(at: u64, data: &[u8]) -> Bytes<'_> {
    Bytes { format: Format::Mcap.name(), data, origin: Place::Byte(at) }
}

/// Unpacked records of the record at byte `at` of the file.
fn records(at: u64, data: &[u8]) -> Bytes<'_> {
    Bytes { format: Format::Mcap.name(), data, origin: Place::Packet { packet: at, byte: 0 } }
}

/// Opcode and length of the record at byte `at`, which the file has.
fn header(input: &mut Input<File>, at: u64) -> Result<(u8, u64), IoError> {
    let header = input.read(at, RECORD_HEADER as u64)?;
    let header = part(at, &header).get("record before the end of the data", 0, RECORD_HEADER)?.to_vec();
    let length = u64::from_le_bytes(array(&header[1..]));
    let (place, actual) = (at + RECORD_HEADER as u64, input.length - at - RECORD_HEADER as u64);
    if length > actual {
        let (format, what, place, at_least) = (input.format, "record", Place::Byte(place), false);
        return Err(IoError::Truncated { format, what, place, expected: length, actual, at_least });
    }
    Ok((header[0], length))
}

/// The records of the chunk at byte `at`, or the other record there.
fn unpacked(input: &mut Input<File>, at: u64) -> Result<Vec<u8>, IoError> {
    let (op, length) = header(input, at)?;
    let start = at + RECORD_HEADER as u64;
    if length > PACKET_BYTES {
        return Err(part(start, &[]).too_large("record", 0, PACKET_BYTES, length, false));
    }
    let mut record = input.read(at, RECORD_HEADER as u64 + length)?;
    part(at, &record).get("record", RECORD_HEADER, length as usize)?;
    if op != op::CHUNK {
        return Ok(record);
    }
    let content = record.split_off(RECORD_HEADER);
    let mut inflater = Inflater::new(Compression::None, part(0, &[]));
    let chunk = Chunk::parse(part(start, &content))?;
    Ok(chunk.unpack(&mut inflater)?.data.to_vec())
}

/// Pixels of a message.
#[derive(Deserialize)]
struct Raw<'a, D> {
    width: u32,
    height: u32,
    encoding: &'a str,
    step: u32,
    data: D,
}

/// The image of a message of this form.
pub(crate) fn picture(form: Picture, message: Bytes<'_>) -> Result<Image, IoError> {
    let malformed = |expected: &str, found: String| message.malformed("message", 0, expected, found);
    match (form.encoding, form.is_file) {
        (Encoding::Cdr, true) => {
            let mut cdr = Cdr::new(message)?;
            cdr.header()?;
            cdr.text()?;
            decode_image(cdr.sequence("compressed image")?.data)
        }
        (Encoding::Cdr, false) => {
            let mut cdr = Cdr::new(message)?;
            cdr.header()?;
            let (height, width) = (cdr.u32()?, cdr.u32()?);
            let encoding = cdr.text()?;
            // Skips the byte order of samples of 16 bits, because these are refused.
            cdr.u8()?;
            let step = cdr.u32()?;
            let data = cdr.sequence("pixels")?.data;
            let encoding = &*String::from_utf8_lossy(&encoding[..encoding.len().min(40)]);
            raw(message, &Raw { width, height, encoding, step, data })
        }
        (Encoding::Json, true) => {
            #[derive(Deserialize)]
            struct File<'a> {
                data: &'a str,
            }
            let file: File<'_> = serde_json::from_slice(message.data)
                .map_err(|e| malformed("foxglove.CompressedImage", e.to_string()))?;
            decode_image(&from_base64(message, file.data)?)
        }
        (Encoding::Json, false) => {
            let raw_image: Raw<'_, &str> = serde_json::from_slice(message.data)
                .map_err(|e| malformed("foxglove.RawImage", e.to_string()))?;
            let data = from_base64(message, raw_image.data)?;
            let Raw { width, height, encoding, step, .. } = raw_image;
            raw(message, &Raw { width, height, encoding, step, data: &data })
        }
        (Encoding::Protobuf, true) => {
            let mut data = &message.data[..0];
            fields(message, |field, _, bytes| {
                if field == 2 {
                    data = bytes;
                }
            })?;
            decode_image(data)
        }
        (Encoding::Protobuf, false) => {
            let mut image = Raw { width: 0, height: 0, encoding: "", step: 0, data: &message.data[..0] };
            fields(message, |field, number, bytes| match field {
                2 => image.width = number as u32,
                3 => image.height = number as u32,
                4 => image.encoding = str::from_utf8(bytes).unwrap_or_default(),
                5 => image.step = number as u32,
                6 => image.data = bytes,
                _ => {}
            })?;
            raw(message, &image)
        }
    }
}

fn from_base64(message: Bytes<'_>, text: &str) -> Result<Vec<u8>, IoError> {
    BASE64_STANDARD.decode(text).map_err(|error| message.malformed("data of a message", 0, "base64", error))
}

/// The image of these pixels.
fn raw(message: Bytes<'_>, image: &Raw<'_, &[u8]>) -> Result<Image, IoError> {
    let &Raw { width, height, encoding, step, data } = image;
    let (bytes, order) = match encoding {
        "rgb8" => (3, [0, 1, 2]),
        "bgr8" | "8UC3" => (3, [2, 1, 0]),
        "rgba8" => (4, [0, 1, 2]),
        "bgra8" => (4, [2, 1, 0]),
        "mono8" | "8UC1" => (1, [0, 0, 0]),
        other => {
            let expected = "an image in rgb8, bgr8, rgba8, bgra8 or mono8";
            return Err(IoError::Unsupported { expected, actual: shown(other.as_bytes()) });
        }
    };
    pixels(message, width.into(), height.into())?;
    let (width, height, step) = (width as usize, height as usize, step as usize);
    let row = width * bytes;
    if width == 0 || height == 0 || step < row {
        let found = format!("{width}x{height} pixels in rows of {step} bytes");
        let expected = format!("sides of at least 1, and rows of at least {row} bytes");
        return Err(message.malformed("size of an image", 0, expected, found));
    }
    let rows: Vec<_> = data.chunks(step).take(height).filter_map(|line| line.get(..row)).collect();
    if rows.len() < height {
        let expected = format!("{height} rows of {row} bytes");
        return Err(message.malformed("pixels", 0, expected, format!("{} whole ones", rows.len())));
    }
    let samples = rows.into_iter().flat_map(|row| row.chunks_exact(bytes));
    Ok(Image { width, height, data: samples.flat_map(|pixel| order.map(|channel| pixel[channel])).collect() })
}

/// Shows the fields of a message in protobuf: number, value of a number, bytes of anything else.
fn fields<'a>(message: Bytes<'a>, mut see: impl FnMut(u64, u64, &'a [u8])) -> Result<(), IoError> {
    let mut at = 0;
    while at < message.len() {
        let key = varint(message, &mut at)?;
        let length = match key & 7 {
            0 => {
                let value = varint(message, &mut at)?;
                see(key >> 3, value, &[]);
                continue;
            }
            1 => 8,
            2 => usize::try_from(varint(message, &mut at)?).unwrap_or(usize::MAX),
            5 => 4,
            other => {
                return Err(message.malformed(
                    "field of a message",
                    at,
                    "a wire type of 0, 1, 2 or 5",
                    other,
                ));
            }
        };
        let bytes = message.get("field of a message", at, length)?;
        let number = bytes.iter().take(8).rev().fold(0, |number, &byte| number << 8 | u64::from(byte));
        see(key >> 3, number, bytes);
        at += length;
    }
    Ok(())
}

/// A number in groups of seven bits, the lowest first.
fn varint(message: Bytes<'_>, at: &mut usize) -> Result<u64, IoError> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let [byte] = message.array("number of a message", *at)?;
        *at += 1;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Ok(value);
        }
    }
    Err(message.malformed("number of a message", *at, "at most ten bytes", "more"))
}
