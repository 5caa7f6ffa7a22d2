//! Reading and writing of recordings in any format: from and to files and bytes.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Cursor, Read, Seek, Write};
use std::path::Path;

use meissner_engine::{Event, Sensor};

use crate::csv;
use crate::detect::format_of;
use crate::error::{IoError, Place};
use crate::files::write_file;
use crate::format::{Format, Kind};
#[cfg(feature = "hdf5")]
use crate::hdf5;
use crate::options::{ReadOptions, no_stream};
use crate::packed;
use crate::recording::{Capacity, Recording, Salvage};
use crate::seek::records::whole;
use crate::seek::{self, TimeRange};
use crate::text::text_start;
use crate::{aedat2, aedat3, aedat4, dat, es, evt2, evt3, mcap, nmnist, npy};

/// Reads the recording in the file at `path`, in any format; the file name has no influence.
///
/// # Errors
/// As [`read_with`].
pub fn read(path: &Path) -> Result<Recording, IoError> {
    read_with(path, ReadOptions::default())
}

/// Reads the recording in the file at `path` with these options, which may be a [`Format`].
///
/// The unpacked content of the file is held in memory; [`crate::limits`] bounds the other memory.
///
/// # Errors
/// [`IoError::File`] if the file cannot be read, [`IoError::OtherKind`] if it is a folder;
/// otherwise those of [`decode_with`].
pub fn read_with(path: &Path, options: impl Into<ReadOptions>) -> Result<Recording, IoError> {
    let options = options.into();
    if path.is_dir() {
        return Err(IoError::OtherKind { expected: Kind::EVENTS, found: Kind::Folder });
    }
    // A pipe can be read only once.
    if let Some(range) = options.range.filter(|_| path.is_file())
        && let Some(part) = read_range(path, options, range)?
    {
        return Ok(part);
    }
    decode_content(packed::content_of_file(path, options.salvage)?, options)
}

/// Reads the events of `range` in the file at `path` without the other events; `None` if the format
/// does not permit that, so that [`read_with`] would read the whole file.
///
/// # Errors
/// As [`read_with`].
pub fn read_range(
    path: &Path,
    options: impl Into<ReadOptions>,
    range: TimeRange,
) -> Result<Option<Recording>, IoError> {
    let file = File::open(path).map_err(IoError::file("read", path))?;
    let options = options.into();
    let Some((found, input)) = located(file, options)? else { return Ok(None) };
    match found {
        #[cfg(feature = "hdf5")]
        Format::Hdf5 => hdf5::read_range(input.into_inner(), options, range).map(Some),
        _ => read_part(found, input, range, options),
    }
}

/// The recording in the file at `path` block by block; `None` if the format does not permit that.
/// The ranges of `options` are ignored. If a clock wraps, the time between two events of one block
/// or of two adjacent blocks must be less than half of its period (DAT and AEDAT2: 36 minutes).
///
/// Formats with records, packets or chunks that can be read separately have blocks: DAT, AEDAT2,
/// EVT2, npy, HDF5, AEDAT3 and AEDAT4, if the file is not packed and not cut short.
///
/// # Errors
/// [`IoError::File`] if the file cannot be read; those of its header.
pub fn blocks(path: &Path, options: impl Into<ReadOptions>) -> Result<Option<seek::Blocks>, IoError> {
    let file = File::open(path).map_err(IoError::file("read", path))?;
    let options = options.into();
    let Some((found, input)) = located(file, options)? else { return Ok(None) };
    match found {
        Format::Dat => seek::blocks::of_records::<dat::Layout>(input, options),
        Format::Aedat2 => seek::blocks::of_records::<aedat2::Header>(input, options),
        Format::Evt2 | Format::Evt21 => seek::blocks::of_records::<evt2::Layout>(input, options),
        Format::Npy => seek::blocks::of_records::<npy::Layout>(input, options),
        Format::Aedat3 => seek::blocks::of_packets::<aedat3::Container>(input, options),
        Format::Aedat4 => seek::blocks::of_packets::<aedat4::Container>(input, options),
        #[cfg(feature = "hdf5")]
        Format::Hdf5 => hdf5::blocks(input.into_inner(), options).map(Some),
        _ => Ok(None),
    }
}

/// The content of the file at `path`, unpacked from gzip or a zip archive with one recording.
///
/// # Errors
/// [`IoError::File`] if the file cannot be read; [`IoError::Truncated`], [`IoError::Malformed`],
/// [`IoError::TooLarge`] or [`IoError::Unsupported`] if it cannot be unpacked.
pub fn read_content(path: &Path) -> Result<Vec<u8>, IoError> {
    Ok(packed::content_of_file(path, false)?.0.into_owned())
}

/// The unpacked content of a pipe or similar input, held to be decoded more than once.
#[derive(Debug)]
pub struct HeldContent {
    bytes: Vec<u8>,
    salvaged: Option<Salvage>,
}

impl HeldContent {
    /// Reads the input at `path` up to its end; with `salvage`, also a gzip file that was cut
    /// short.
    ///
    /// # Errors
    /// As [`read_content`].
    pub fn read(path: &Path, salvage: bool) -> Result<Self, IoError> {
        let (bytes, salvaged) = packed::content_of_file(path, salvage)?;
        Ok(Self { bytes: bytes.into_owned(), salvaged })
    }

    /// Decodes the content.
    ///
    /// # Errors
    /// Those of [`decode_with`].
    pub fn decode(&self, options: impl Into<ReadOptions>) -> Result<Recording, IoError> {
        decode_content((Cow::Borrowed(&self.bytes), self.salvaged), options.into())
    }
}

/// Decodes `bytes`, the whole content of a file in any format.
///
/// # Errors
/// Those of [`decode_with`].
pub fn decode(bytes: &[u8]) -> Result<Recording, IoError> {
    decode_with(bytes, ReadOptions::default())
}

/// Decodes `bytes`, the whole content of a file, with these options, which may be a [`Format`].
///
/// A gzip file or a zip archive with one recording is unpacked first. Format, and places of errors
/// and salvage, refer to the content.
///
/// # Errors
/// - Without a format: [`IoError::OtherKind`] if the content is known but not a recording,
///   [`IoError::UnknownFormat`] or [`IoError::Unsupported`] if it has none of the formats.
/// - [`IoError::Truncated`] if it is cut short (with [`ReadOptions::salvage`]: in its header).
/// - [`IoError::Malformed`] if it contradicts the format, [`IoError::Lines`] if most of the first
///   lines of a text are not events, [`IoError::Undecided`] if a text can be read in several ways,
///   [`IoError::TooLarge`] beyond a bound of [`crate::limits`], [`IoError::Unsupported`] for a
///   related format or a zip archive without one recording.
///
/// With [`ReadOptions::strict`] also [`IoError::OutsideSensor`], and [`IoError::Malformed`] for
/// each word, event and line that is otherwise left out.
///
/// After an error there is no recording: the events before the fault are not returned.
pub fn decode_with(bytes: &[u8], options: impl Into<ReadOptions>) -> Result<Recording, IoError> {
    let options = options.into();
    if let Some(range) = options.range
        && let Some((found, input)) = located(Cursor::new(bytes), options)?
        && let Some(part) = read_part(found, input, range, options)?
    {
        return Ok(part);
    }
    decode_content(packed::content(bytes, options.salvage)?, options)
}

/// Decodes a content that may have been unpacked and salvaged.
fn decode_content(
    (content, salvaged): packed::Content<'_>,
    options: ReadOptions,
) -> Result<Recording, IoError> {
    let mut recording = decode_bytes(content, options)?;
    if let Some(range) = options.range {
        range.cut(&mut recording);
    }
    Ok(Recording { salvaged: recording.salvaged.or(salvaged), ..recording })
}

/// Decodes the content of a file that is not packed.
fn decode_bytes(content: Cow<'_, [u8]>, options: ReadOptions) -> Result<Recording, IoError> {
    let ReadOptions { format, text, .. } = options;
    let bytes = &*content;
    let is_text = || !bytes.is_empty() && text_start(bytes).is_some();
    let found = match format {
        Some(format) => format,
        None => format_of(bytes).or_else(|error| match error {
            // If the caller gives the order of the columns, the content is a text of events.
            IoError::UnknownFormat { .. } if text.columns.is_some() && is_text() => Ok(Format::Csv),
            error => Err(error),
        })?,
    };
    if !matches!(found, Format::Aedat4 | Format::Aedat3 | Format::Mcap) && options.stream_number() > 1 {
        return Err(no_stream(options.stream_number(), 1));
    }
    match found {
        Format::Aedat4 => aedat4::decode(bytes, options),
        Format::Aedat3 => aedat3::decode(bytes, options),
        Format::Aedat2 => whole::<aedat2::Header>(found, bytes, options),
        Format::Evt2 | Format::Evt21 => whole::<evt2::Layout>(found, bytes, options),
        Format::Evt3 => evt3::decode(bytes, options),
        Format::Dat => whole::<dat::Layout>(found, bytes, options),
        Format::Es => es::decode(bytes, options),
        Format::Nmnist => nmnist::decode(bytes, options),
        Format::Csv => csv::decode(bytes, options),
        Format::Npy => npy::decode(bytes, options),
        Format::Mcap => mcap::decode(bytes, options),
        #[cfg(feature = "hdf5")]
        Format::Hdf5 => hdf5::decode(content.into_owned(), options),
        #[cfg(not(feature = "hdf5"))]
        Format::Hdf5 => {
            let expected = "a build with the feature `hdf5` for this format";
            Err(IoError::Unsupported { expected, actual: "one without it".to_owned() })
        }
    }
}

/// The events of `range` in the file `input` of format `found`; `None`: read the whole file.
fn read_part(
    found: Format,
    mut input: seek::Input<impl Read + Seek>,
    range: TimeRange,
    options: ReadOptions,
) -> Result<Option<Recording>, IoError> {
    match found {
        Format::Dat => seek::records::read::<dat::Layout>(&mut input, range, options),
        Format::Aedat2 => seek::records::read::<aedat2::Header>(&mut input, range, options),
        Format::Evt2 | Format::Evt21 => seek::records::read::<evt2::Layout>(&mut input, range, options),
        Format::Npy => seek::records::read::<npy::Layout>(&mut input, range, options),
        Format::Aedat3 => seek::packets::read::<aedat3::Container>(&mut input, range, options),
        Format::Aedat4 => seek::packets::read::<aedat4::Container>(&mut input, range, options),
        _ => Ok(None),
    }
}

/// The format of a file that is not packed, and the file.
fn located<R: Read + Seek>(
    input: R,
    options: ReadOptions,
) -> Result<Option<(Format, seek::Input<R>)>, IoError> {
    let mut input = seek::Input::new(input)?;
    let head = input.head()?;
    if packed::is_packed(&head) {
        return Ok(None);
    }
    let ((Some(found), _) | (None, Some(Kind::Events(found)))) = (options.format, Kind::of(&head)) else {
        return Ok(None);
    };
    input.format = found.name();
    Ok(Some((found, input)))
}

/// Writes `events` to the file at `path`, which is created or replaced as a whole ([`write_file`]).
///
/// The events are checked first; after an error, a former file is unchanged.
///
/// # Errors
/// Those of [`write_file`]; otherwise those of [`encode`].
pub fn write(path: &Path, format: Format, sensor: Option<Sensor>, events: &[Event]) -> Result<(), IoError> {
    check(format, sensor, events)?;
    write_file(path, |out| put(format, sensor, events, out))
}

/// Writes `events` to `out`, with the sensor in the header (`.npy` has no place for it).
///
/// CSV and npy hold every event. AEDAT4 needs a sensor and holds coordinates below 32768. DAT holds
/// times from 0 to 2^32 - 1 microseconds and coordinates below 16384; EVT3 holds times from 0 to
/// 2^40 - 1 and coordinates below 2048. Both can hold steps back in time unless they look like a
/// wrap of the clock. ES needs a sensor and holds ascending times from 0 to 2^33 - 1 (2.4 hours).
/// MCAP needs a sensor and holds times from 0 to 2^64 - 1 nanoseconds and coordinates below 32768.
/// `out` is written in small pieces, so it should be buffered.
///
/// # Errors
/// Before anything is written: [`IoError::CannotHold`] names the first event that the format cannot
/// hold or that lies outside `sensor`; [`IoError::Unsupported`] if the format is read only, or
/// cannot hold the sensor. Then [`IoError::Stream`] if `out` fails.
pub fn encode(
    format: Format,
    sensor: Option<Sensor>,
    events: &[Event],
    out: &mut impl Write,
) -> Result<(), IoError> {
    check(format, sensor, events)?;
    let mut counted = Counted { out, written: 0 };
    put(format, sensor, events, &mut counted).map_err(|source| IoError::Stream {
        format: format.name(),
        action: "write",
        place: Place::Byte(counted.written),
        source,
    })
}

/// Refuses events outside `sensor` or that `format` cannot hold, and formats that are read only.
fn check(format: Format, sensor: Option<Sensor>, events: &[Event]) -> Result<(), IoError> {
    let capacity = match format {
        Format::Csv | Format::Npy => Capacity::UNLIMITED,
        Format::Dat => dat::CAPACITY,
        Format::Evt3 => evt3::CAPACITY,
        Format::Aedat4 | Format::Es | Format::Mcap if sensor.is_none() => {
            let expected = "a sensor, which a file of AEDAT4, ES or MCAP must name";
            return Err(IoError::Unsupported { expected, actual: "none".to_owned() });
        }
        Format::Aedat4 => aedat4::write::CAPACITY,
        Format::Es => es::CAPACITY,
        Format::Mcap => mcap::write::CAPACITY,
        Format::Aedat3 | Format::Aedat2 | Format::Evt2 | Format::Evt21 | Format::Nmnist | Format::Hdf5 => {
            let expected = "AEDAT4, CSV, npy, DAT, EVT3, ES or MCAP to be written";
            return Err(IoError::Unsupported { expected, actual: format.to_string() });
        }
    };
    capacity.check(format, sensor, events)
}

/// Writes events that [`check`] accepted.
fn put(format: Format, sensor: Option<Sensor>, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    match (format, sensor) {
        (Format::Csv, _) => csv::encode(sensor, events, out),
        (Format::Npy, _) => npy::encode(events, out),
        (Format::Dat, _) => dat::encode(sensor, events, out),
        (Format::Evt3, _) => evt3::encode(sensor, events, out),
        (Format::Aedat4, Some(sensor)) => aedat4::write::encode(sensor, events, out),
        (Format::Es, Some(sensor)) => es::encode(sensor, events, out),
        (Format::Mcap, Some(sensor)) => mcap::write::encode(sensor, events, out),
        _ => unreachable!("refused by check"),
    }
}

/// Counts the bytes written, for the place of an error.
struct Counted<'a, W> {
    out: &'a mut W,
    written: u64,
}

impl<W: Write> Write for Counted<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.written += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
