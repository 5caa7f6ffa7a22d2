//! Reads a part of a recording by time, without the other parts if the format permits it.
//!
//! Input: a seekable file and a [`TimeRange`]. Output: its events in the file's order.
//!
//! | format | how the part is found |
//! |---|---|
//! | DAT, AEDAT2, EVT2, npy | binary search (EVT2: words of time) after 1024 probes for wraps |
//! | HDF5 | binary search over the array of times, and then the chunks of the part |
//! | AEDAT3, AEDAT4 | the headers of all packets, then binary search over the packets of events |
//! | others, packed files, and those with a cut record or packet | the whole file is read |
//!
//! Invariant: the part that is read begins and ends [`DISORDER_US`] beyond the range, and is then
//! cut to it event by event. So the result equals that of cutting the whole recording, provided
//! that no event is earlier than a previous one by more than that, and that every wrap of the clock
//! is detected: less than half of its period passes between neighbours of 1024 probes (DAT and
//! AEDAT2: 36 minutes).

pub(crate) mod blocks;
pub(crate) mod packets;
pub(crate) mod records;

use std::io::{BufReader, Read, Seek, SeekFrom};
use std::ops::Range;

use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::recording::Recording;
pub use blocks::Blocks;
pub(crate) use packets::{PacketHeader, Packets};
pub(crate) use records::Records;

/// Longest step back in time that a part of a recording allows for, in microseconds: 1 s.
pub const DISORDER_US: i64 = 1_000_000;

/// Bytes of a file that are read to find its header; the rest is read if the header is longer.
const HEAD: u64 = 1 << 18;
/// Minimum number of bytes that follow a header that is known to be complete: a line of a text
/// header.
const SLACK: u64 = 1 << 16;

/// A range of the times of a recording, in microseconds.
///
/// ```
/// use meissner_engine::Event;
/// use meissner_io::{Format, ReadOptions, TimeRange, decode_with, encode};
///
/// let events = [100, 150, 200, 250].map(|t_us| Event::new(t_us, 1, 2, true));
/// let mut bytes = Vec::new();
/// encode(Format::Dat, None, &events, &mut bytes)?;
///
/// let options = ReadOptions::default().range(TimeRange::since_first(50..150));
/// assert_eq!(decode_with(&bytes, options)?.events, events[1..3]);
/// let options = ReadOptions::default().range(TimeRange::of_file(200..i64::MAX));
/// assert_eq!(decode_with(&bytes, options)?.events, events[2..]);
/// # Ok::<(), meissner_io::IoError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeRange {
    from_us: i64,
    to_us: i64,
    since_first: bool,
}

impl TimeRange {
    /// The events with `times.start <= t < times.end`, in the file's times.
    pub fn of_file(times: Range<i64>) -> Self {
        Self { from_us: times.start, to_us: times.end, since_first: false }
    }

    /// The same, with times that count from the first event of the recording.
    pub fn since_first(times: Range<i64>) -> Self {
        Self { since_first: true, ..Self::of_file(times) }
    }

    /// The range in the file's times, for a recording that starts with an event at `first_us`.
    pub(crate) fn times(self, first_us: i64) -> Range<i64> {
        let origin = if self.since_first { first_us } else { 0 };
        origin.saturating_add(self.from_us)..origin.saturating_add(self.to_us)
    }

    /// Whether an event at `t_us` is in the range, for a recording that starts with an event at
    /// `first_us`. O(1).
    pub fn contains(self, t_us: i64, first_us: i64) -> bool {
        self.times(first_us).contains(&t_us)
    }

    /// Leaves out the events outside the range from a whole recording. O(events).
    pub fn cut(self, recording: &mut Recording) {
        if let Some(first_us) = recording.events.first().map(|event| event.t_us) {
            recording.events.retain(|event| self.contains(event.t_us, first_us));
        }
    }
}

/// A file that can be read at any position.
pub(crate) struct Input<R> {
    inner: BufReader<R>,
    at: u64,
    pub(crate) length: u64,
    /// Name of the format, for messages.
    pub(crate) format: &'static str,
}

impl<R: Read + Seek> Input<R> {
    pub(crate) fn new(mut inner: R) -> Result<Self, IoError> {
        let fail =
            |source| IoError::Stream { format: "recording", action: "read", place: Place::Byte(0), source };
        let length = inner.seek(SeekFrom::End(0)).map_err(fail)?;
        inner.rewind().map_err(fail)?;
        Ok(Self { inner: BufReader::new(inner), at: 0, length, format: "recording" })
    }

    /// The file itself.
    #[cfg(feature = "hdf5")]
    pub(crate) fn into_inner(self) -> R {
        self.inner.into_inner()
    }

    /// The first bytes of the file, which identify its format.
    pub(crate) fn head(&mut self) -> Result<Vec<u8>, IoError> {
        self.read(0, self.length.min(HEAD))
    }

    /// The `length` bytes at `at`, which the file must have.
    pub(crate) fn read(&mut self, at: u64, length: u64) -> Result<Vec<u8>, IoError> {
        // The length is checked before it is allocated.
        let length = length.min(self.length.saturating_sub(at));
        let mut bytes = vec![0; length as usize];
        let step = at as i64 - self.at as i64;
        let read = self.inner.seek_relative(step).and_then(|()| self.inner.read_exact(&mut bytes));
        read.map_err(|source| IoError::Stream {
            format: self.format,
            action: "read",
            place: Place::Byte(at),
            source,
        })?;
        self.at = at + length;
        Ok(bytes)
    }

    /// The header of the file, which `open` reads from the file's start and length.
    fn open<T>(
        &mut self,
        open: impl Fn(Bytes<'_>, u64) -> Result<T, IoError>,
        end: impl Fn(&T) -> usize,
    ) -> Result<T, IoError> {
        let mut length = HEAD;
        loop {
            let head = self.read(0, length)?;
            let is_all = head.len() as u64 == self.length;
            match open(Bytes::file(self.format, &head), self.length) {
                Ok(opened) if is_all || end(&opened) as u64 + SLACK <= length => return Ok(opened),
                Err(error) if is_all => return Err(error),
                _ => length = length.saturating_mul(8),
            }
        }
    }
}

/// A position in a recording with a known time.
#[derive(Clone, Copy)]
pub(crate) struct Probe {
    /// Index of the record or the packet, counted from 0.
    pub(crate) at: u64,
    /// Value of the clock, in microseconds.
    pub(crate) value: i64,
    /// Time in microseconds.
    pub(crate) t_us: i64,
}

/// A step from before `bound_us` to not before it, if any: the positions before and after it.
///
/// `low` is a position before the bound, and `high` ends the search. `probe` gives the first
/// position of a range with a known time; its first argument is a known position before the range.
/// O(log n) probes.
pub(crate) fn step(
    bound_us: i64,
    mut low: Option<Probe>,
    (mut end, mut high): (u64, Option<u64>),
    mut probe: impl FnMut(Option<Probe>, Range<u64>) -> Result<Option<Probe>, IoError>,
) -> Result<(Option<Probe>, Option<u64>), IoError> {
    loop {
        let begin = low.map_or(0, |low| low.at + 1);
        if begin >= end {
            return Ok((low, high));
        }
        let middle = begin + (end - begin) / 2;
        match probe(low, middle..end)? {
            None => end = middle,
            Some(found) if found.t_us < bound_us => low = Some(found),
            Some(found) => (end, high) = (middle, Some(found.at)),
        }
    }
}
