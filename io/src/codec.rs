//! One door for all formats: files and bytes to recordings, and events to files and bytes.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;

use meissner_engine::{Event, Sensor};

use crate::check::check;
use crate::csv::TextOptions;
use crate::error::{IoError, Place};
use crate::format::Format;
use crate::kind::{EVENTS, Kind};
use crate::recording::Recording;
use crate::{aedat4, csv, dat, detect, evt2, evt3, nmnist, npy};

/// What a caller says about a recording that is to be read; the default says nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// The format, in place of what the content shows.
    pub format: Option<Format>,
    /// How a text is laid out, where it does not say so.
    pub text: TextOptions,
    /// Whether a file that was cut short is read as far as it is whole.
    ///
    /// Kept are the whole words of EVT2 and EVT3, events of DAT, N-MNIST and npy, packets of AEDAT4, and lines with a line
    /// feed of CSV; what is left out stands in [`Recording::salvaged`]. Headers have to be whole, and what is there and
    /// not as the format says is refused as ever: a damaged file is not salvaged.
    pub salvage: bool,
}

/// Reads the recording in the file at `path`, whatever its format; the name plays no part.
///
/// The file is held in memory while it is decoded; [`crate::limits`] bounds the rest.
///
/// # Errors
/// [`IoError::File`] where the file cannot be read, [`IoError::OtherKind`] where it is a folder; otherwise those of [`decode`].
pub fn read(path: &Path) -> Result<Recording, IoError> {
    read_with(path, &ReadOptions::default())
}

/// Reads the recording in the file at `path`, which is of `format`.
///
/// # Errors
/// Those of [`read`] and [`decode_as`].
pub fn read_as(format: Format, path: &Path) -> Result<Recording, IoError> {
    read_with(path, &ReadOptions { format: Some(format), ..ReadOptions::default() })
}

/// Reads the recording in the file at `path` as `options` say.
///
/// # Errors
/// Those of [`read`] and [`decode_with`].
pub fn read_with(path: &Path, options: &ReadOptions) -> Result<Recording, IoError> {
    if path.is_dir() {
        return Err(IoError::OtherKind { expected: EVENTS, found: Kind::Folder });
    }
    let bytes =
        fs::read(path).map_err(|source| IoError::File { action: "read", path: path.to_owned(), source })?;
    decode_with(&bytes, options)
}

/// Decodes `bytes`, the whole content of a file, whatever its format.
///
/// # Errors
/// [`IoError::OtherKind`] where the content is known and no recording that can be read, [`IoError::UnknownFormat`] or
/// [`IoError::Unsupported`] where it is not one of the formats, and those of [`decode_as`].
pub fn decode(bytes: &[u8]) -> Result<Recording, IoError> {
    decode_with(bytes, &ReadOptions::default())
}

/// Decodes `bytes`, the whole content of a file of `format`.
///
/// # Errors
/// [`IoError::Truncated`] where the bytes end before something does, [`IoError::Malformed`] where something
/// is not what the format says, [`IoError::OutsideSensor`] where an event lies beside the sensor that the
/// file names, [`IoError::TooLarge`] where a bound of [`crate::limits`] is exceeded, [`IoError::Unsupported`]
/// where the content is a relative of the format, [`IoError::Undecided`] where a text can be read in several ways. Then
/// there is no recording: events before the fault are not returned as if they were all.
pub fn decode_as(format: Format, bytes: &[u8]) -> Result<Recording, IoError> {
    decode_with(bytes, &ReadOptions { format: Some(format), ..ReadOptions::default() })
}

/// Decodes `bytes`, the whole content of a file, as `options` say.
///
/// # Errors
/// Those of [`decode`] and [`decode_as`]; with [`ReadOptions::salvage`] a file that is merely cut short behind its header
/// gives none.
pub fn decode_with(bytes: &[u8], options: &ReadOptions) -> Result<Recording, IoError> {
    let ReadOptions { format, text, salvage } = *options;
    let found = match format {
        Some(format) => format,
        None => detect::format_of(bytes).or_else(|error| match error {
            // Who says the order of the columns says that it is a text of events.
            IoError::UnknownFormat { .. } if text.columns.is_some() && csv::is_text(bytes) => Ok(Format::Csv),
            error => Err(error),
        })?,
    };
    match found {
        Format::Aedat4 => aedat4::decode(bytes, salvage),
        Format::Evt2 => evt2::decode(bytes, salvage),
        Format::Evt3 => evt3::decode(bytes, salvage),
        Format::Dat => dat::decode(bytes, salvage),
        Format::Nmnist => nmnist::decode(bytes, salvage),
        Format::Csv => csv::decode(bytes, text, salvage),
        Format::Npy => npy::decode(bytes, salvage),
    }
}

/// Writes `events` to the file at `path`, which is created or replaced.
///
/// The events are checked first: where the format cannot hold them, the file is left as it was.
///
/// # Errors
/// [`IoError::File`] where the file cannot be created or written; otherwise those of [`encode`].
pub fn write(path: &Path, format: Format, sensor: Option<Sensor>, events: &[Event]) -> Result<(), IoError> {
    check(format, sensor, events)?;
    let fail = |action| move |source| IoError::File { action, path: path.to_owned(), source };
    let mut out = BufWriter::with_capacity(1 << 16, File::create(path).map_err(fail("create"))?);
    put(format, sensor, events, &mut out).and_then(|()| out.flush()).map_err(fail("write"))
}

/// Writes `events` to `out`, with the geometry in the header (`.npy` has no place for it).
///
/// CSV and npy hold every event. DAT holds times from 0 to 2^32 - 1 microseconds and coordinates below 16384,
/// EVT3 times from 0 to 2^40 - 1 and coordinates below 2048; both hold steps back in time that their readers
/// cannot mistake for a wrap. `out` is written in small pieces: give it a buffer.
///
/// # Errors
/// Before anything is written: [`IoError::CannotHold`] names the first event that the format cannot hold or
/// that lies beside `sensor`; [`IoError::Unsupported`] where the format is only read, or cannot hold the
/// sensor. Then [`IoError::Stream`] where `out` fails.
pub fn encode(
    format: Format,
    sensor: Option<Sensor>,
    events: &[Event],
    out: &mut impl Write,
) -> Result<(), IoError> {
    check(format, sensor, events)?;
    let mut counted = Counted { out, written: 0 };
    put(format, sensor, events, &mut counted).map_err(|source| IoError::Stream {
        format,
        action: "write",
        place: Place::Byte(counted.written),
        source,
    })
}

/// Writes events that [`check`] has passed.
fn put(
    format: Format,
    sensor: Option<Sensor>,
    events: &[Event],
    out: &mut impl Write,
) -> std::io::Result<()> {
    match format {
        Format::Csv => csv::encode(sensor, events, out),
        Format::Npy => npy::encode(events, out),
        Format::Dat => dat::encode(sensor, events, out),
        Format::Evt3 => evt3::encode(sensor, events, out),
        Format::Aedat4 | Format::Evt2 | Format::Nmnist => unreachable!("refused by check"),
    }
}

/// Knows how far the writing came, for the error.
struct Counted<'a, W> {
    out: &'a mut W,
    written: u64,
}

impl<W: Write> Write for Counted<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.written += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}
