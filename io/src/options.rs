//! Options for reading a recording.

use std::num::NonZeroU16;

use meissner_engine::Sensor;

use crate::aedat2::Chip;
use crate::csv::TextOptions;
use crate::error::IoError;
use crate::format::Format;
use crate::seek::TimeRange;

/// Options for reading a recording; by default everything is found from its content.
///
/// ```
/// use meissner_io::{Format, ReadOptions, decode_with};
///
/// // An event of five bytes, and the first byte of a second one.
/// let options = ReadOptions::from(Format::Nmnist).salvage(true);
/// let recording = decode_with(&[1, 2, 0x80, 0, 7, 3], options)?;
/// assert_eq!(recording.events.len(), 1);
/// # Ok::<(), meissner_io::IoError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// The format; `None`: the format is found from the content.
    pub format: Option<Format>,
    /// The layout of a text, as far as the caller knows it.
    pub text: TextOptions,
    /// Whether a file that was cut short is read up to the cut.
    ///
    /// The complete words of EVT2 and EVT3, events of AEDAT2, DAT, ES, N-MNIST and npy, packets of
    /// AEDAT3 and AEDAT4, records and chunks of MCAP, and lines of CSV are kept;
    /// [`Recording::salvaged`](crate::Recording::salvaged) describes the remaining part. Headers
    /// must be complete; a file with other damage is not salvaged.
    pub salvage: bool,
    /// Whether odd data are an error: a line of a text that is not an event, an event outside the
    /// sensor that the file names, a word of a type that holds no events, an event before the first
    /// time. Otherwise [`Recording::left_out`](crate::Recording::left_out) and
    /// [`Recording::other_streams`](crate::Recording::other_streams) count them.
    pub strict: bool,
    /// The chip of a recording of AEDAT2, instead of the one that it names.
    pub chip: Option<Chip>,
    /// The sensor of a recording that names none; for AEDAT2 it selects the chip.
    pub sensor: Option<Sensor>,
    /// Number of the stream of events of AEDAT3 and AEDAT4, or topic of MCAP, to read, counted from
    /// 1 in the order of the file; `None`: the first.
    pub stream: Option<NonZeroU16>,
    /// The range of times whose events are read; `None`: all events.
    ///
    /// If the format permits it, the other parts of the file are not read: damage there is not
    /// found, and [`Recording::other_streams`](crate::Recording::other_streams) counts only the
    /// part that is read. The events are those of the whole recording in the range, provided that
    /// no event is more than [`DISORDER_US`](crate::DISORDER_US) earlier than a previous one, and
    /// that the clock of DAT, AEDAT2 or EVT2 wraps at most once between neighbours of 1024
    /// positions in the file.
    pub range: Option<TimeRange>,
}

impl ReadOptions {
    /// Sets the format.
    #[must_use]
    pub fn format(mut self, format: impl Into<Option<Format>>) -> Self {
        self.format = format.into();
        self
    }

    /// Sets the layout of a text.
    #[must_use]
    pub fn text(mut self, text: TextOptions) -> Self {
        self.text = text;
        self
    }

    /// Sets whether a file that was cut short is read up to the cut.
    #[must_use]
    pub fn salvage(mut self, salvage: bool) -> Self {
        self.salvage = salvage;
        self
    }

    /// Sets whether odd data are an error.
    #[must_use]
    pub fn strict(mut self, strict: bool) -> Self {
        self.strict = strict;
        self
    }

    /// Sets the chip of a recording of AEDAT2.
    #[must_use]
    pub fn chip(mut self, chip: impl Into<Option<Chip>>) -> Self {
        self.chip = chip.into();
        self
    }

    /// Sets the sensor of a recording that names none.
    #[must_use]
    pub fn sensor(mut self, sensor: impl Into<Option<Sensor>>) -> Self {
        self.sensor = sensor.into();
        self
    }

    /// Sets the number of the stream of events to read, counted from 1.
    #[must_use]
    pub fn stream(mut self, stream: impl Into<Option<NonZeroU16>>) -> Self {
        self.stream = stream.into();
        self
    }

    /// Number of the stream of events to read, counted from 1.
    pub(crate) fn stream_number(self) -> usize {
        self.stream.map_or(1, |stream| stream.get().into())
    }

    /// Sets the range of times whose events are read.
    #[must_use]
    pub fn range(mut self, range: impl Into<Option<TimeRange>>) -> Self {
        self.range = range.into();
        self
    }
}

impl From<Format> for ReadOptions {
    /// A file of this format; the other options have their defaults.
    fn from(format: Format) -> Self {
        Self { format: Some(format), ..Self::default() }
    }
}

/// The error of a recording with `found` streams of events, if the stream number `asked` does not
/// exist.
pub(crate) fn no_stream(asked: usize, found: usize) -> IoError {
    let actual = match found {
        0 => format!("none, and stream {asked} asked for"),
        1 => format!("one, and stream {asked} asked for"),
        found => format!("{found}, and stream {asked} asked for"),
    };
    IoError::Unsupported { expected: "a recording with as many streams of events as are asked for", actual }
}
