//! HDF5 files of DSEC and Prophesee's Metavision; the crate `hdf5-reader` reads the container.
//!
//! | writer | events | time | sensor | compression |
//! |---|---|---|---|---|
//! | DSEC | arrays `events/t`, `x`, `y`, `p` | `t` + `t_offset` | not named | Blosc ([`blosc`]) |
//! | Metavision | records `CD/events` of `t`, `x`, `y`, `p` | `t` | `geometry` | ECF ([`ecf`]) |
//!
//! Arrays without compression, and with deflate, shuffle, Fletcher-32, SZIP, n-bit or scale-offset,
//! are read too. Integers may have any size and byte order; a polarity above 0 is on. Source:
//! <https://dsec.ifi.uzh.ch/data-format/> and the vendor's page on the HDF5 event file format.
//! Invariant: a file gives at most as many bytes of events as [`crate::limits`] allows, and only
//! the chunks of a range are read for it.

mod blosc;
pub(crate) mod ecf;
mod integer;

use std::fs::File;
use std::ops::Range;
use std::sync::Arc;

use hdf5_reader::error::Error;
use hdf5_reader::group::Group;
use hdf5_reader::storage::{BytesStorage, DynStorage, FileStorage};
use hdf5_reader::{Dataset, FilterRegistry, H5Type, Hdf5File, OpenOptions, SliceInfo, SliceInfoElem};
use meissner_engine::{Event, Sensor};

use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::format::{Format, beginning};
use crate::left_out::{LeftOutKind, PassedOver};
use crate::limits::{PACKET_BYTES, most};
use crate::options::ReadOptions;
use crate::prophesee;
use crate::recording::Recording;
use crate::seek::blocks::RECORDS;
use crate::seek::{Blocks, DISORDER_US, Probe, TimeRange, step};
use integer::{Integer, Record};

/// A part of the container at an unknown place.
const NOWHERE: Bytes<'static> = Bytes { format: Format::Hdf5.name(), data: &[], origin: Place::Byte(0) };
/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"\x89HDF";
/// Events that are decoded at once.
const BLOCK: u64 = 1 << 14;
/// Maximum bytes of a record in an array: Prophesee's records have 16.
const MAX_RECORD_BYTES: usize = 64;
/// Minimum bytes of an event: that of the arrays of DSEC.
const EVENT_BYTES: u64 = 9;
/// Decoded chunks that are kept for the next range, in bytes.
const CACHE_BYTES: usize = 32 << 20;

/// The events of the file `bytes`.
pub(crate) fn decode(bytes: Vec<u8>, options: ReadOptions) -> Result<Recording, IoError> {
    let events = Events::open(Arc::new(BytesStorage::new(bytes)), options)?;
    events.recording(0..events.count)
}

/// The events of `range` in `file`.
pub(crate) fn read_range(file: File, options: ReadOptions, range: TimeRange) -> Result<Recording, IoError> {
    let events = Events::open(Arc::new(FileStorage::from_file(file).map_err(unreadable)?), options)?;
    let mut part = events.recording(events.near(range)?)?;
    if events.count > 0 {
        let first_us = events.time(0)?;
        part.events.retain(|event| range.contains(event.t_us, first_us));
    }
    Ok(part)
}

/// The blocks of `file`.
pub(crate) fn blocks(file: File, options: ReadOptions) -> Result<Blocks, IoError> {
    let events = Events::open(Arc::new(FileStorage::from_file(file).map_err(unreadable)?), options)?;
    let mut begin = 0;
    Ok(Blocks::new(move || {
        let range = begin..events.count.min(begin + RECORDS);
        begin = range.end;
        if range.is_empty() { Ok(None) } else { events.recording(range).map(Some) }
    }))
}

/// The events of an open file.
struct Events {
    /// One array of records, or one array each for t, x, y and p.
    arrays: Vec<Dataset>,
    /// Number of events.
    count: u64,
    /// Offset that is added to the times, in microseconds.
    origin_us: i64,
    sensor: Option<Sensor>,
    strict: bool,
}

impl Events {
    fn open(storage: DynStorage, ReadOptions { strict, .. }: ReadOptions) -> Result<Self, IoError> {
        let mut filters = FilterRegistry::new();
        let decoded =
            |result: Result<_, IoError>| result.map_err(|error| Error::FilterError(error.to_string()));
        let unblosc = blosc::Decoder::default();
        filters.register(blosc::FILTER, Box::new(move |_, chunk, _| decoded(unblosc.decode(chunk))));
        filters.register(ecf::FILTER, Box::new(move |_, chunk, _| decoded(ecf::decode(chunk))));
        let length = storage.len();
        let options = OpenOptions::default()
            .with_filter_registry(filters)
            .with_chunk_cache_bytes(CACHE_BYTES)
            .with_max_chunk_bytes(PACKET_BYTES as usize)
            .with_max_read_bytes(BLOCK as usize * MAX_RECORD_BYTES);
        let file = Hdf5File::from_storage_with_options(storage, options).map_err(unreadable)?;
        let root = file.root_group().map_err(unreadable)?;

        let named = |name: &str| present(file.dataset(name));
        let (arrays, origin_us) = if let Some(records) = named("CD/events")? {
            (vec![records], 0)
        } else if let [Some(t), Some(x), Some(y), Some(p)] =
            [named("events/t")?, named("events/x")?, named("events/y")?, named("events/p")?]
        {
            let origin_us = named("t_offset")?.map_or(Ok(0), |offset| scalar(&offset))?;
            (vec![t, x, y, p], origin_us)
        } else {
            return Err(IoError::Unsupported {
                expected: "HDF5 with events/t, x, y and p (DSEC) or CD/events (Prophesee)",
                actual: format!("HDF5 with {}", members(&root)),
            });
        };
        let sensor = match present(root.attribute("geometry"))? {
            Some(geometry) => {
                let value = geometry.read_string().map_err(unreadable)?;
                prophesee::geometry(&value, NOWHERE)?
            }
            None => None,
        };

        let mut lengths = Vec::new();
        for dataset in &arrays {
            let &[length] = dataset.shape() else {
                let shape = format!("{:?}", dataset.shape());
                return Err(malformed("shape of an array", "one dimension", shape));
            };
            lengths.push(length);
        }
        let count = lengths[0];
        if lengths.iter().any(|&length| length != count) {
            return Err(malformed("lengths of t, x, y and p", "one length", format!("{lengths:?}")));
        }
        let limit = most(length);
        if count.saturating_mul(EVENT_BYTES) > limit {
            let actual = count.saturating_mul(EVENT_BYTES);
            return Err(NOWHERE.too_large("array of events", 0, limit, actual, false));
        }
        Ok(Self { arrays, count, origin_us, sensor, strict })
    }

    /// The recording of the events of a range.
    fn recording(&self, Range { start, end }: Range<u64>) -> Result<Recording, IoError> {
        let (mut events, mut passed) =
            (Vec::with_capacity((end - start) as usize), PassedOver::new(self.strict));
        let mut begin = start;
        while begin < end {
            let range = begin..end.min(begin + BLOCK);
            begin = range.end;
            self.decode(range, &mut events, &mut passed)?;
        }
        Ok(Recording { left_out: passed.end(), ..Recording::of_events(Format::Hdf5, self.sensor, events) })
    }

    /// Appends the events of `range` to `events`.
    fn decode(
        &self,
        range: Range<u64>,
        events: &mut Vec<Event>,
        passed: &mut PassedOver,
    ) -> Result<(), IoError> {
        for (index, Record([t_us, x, y, p])) in (range.start..).zip(self.records(&range)?) {
            let event = Bytes { origin: Place::Event(index), ..NOWHERE };
            let side = |what, value: i64| {
                u16::try_from(value).map_err(|_| event.malformed(what, 0, "0 to 65535", value))
            };
            let (x, y) = match (side("x", x), side("y", y)) {
                (Ok(x), Ok(y)) => (x, y),
                (Err(error), _) | (_, Err(error)) => {
                    passed.pass(LeftOutKind::Malformed, 1, error)?;
                    continue;
                }
            };
            if event.is_inside(self.sensor, x, y, 0, passed)? {
                events.push(Event::new(t_us.wrapping_add(self.origin_us), x, y, p > 0));
            }
        }
        Ok(())
    }

    /// The records of `range`, assembled if each field has its own array.
    fn records(&self, range: &Range<u64>) -> Result<Vec<Record>, IoError> {
        let [t, x, y, p] = &self.arrays[..] else { return slice(&self.arrays[0], range) };
        let times = slice::<Integer>(t, range)?.into_iter();
        let mut records: Vec<_> = times.map(|t_us| Record([t_us.0, 0, 0, 0])).collect();
        for (array, field) in [x, y, p].into_iter().zip(1..) {
            for (record, value) in records.iter_mut().zip(slice::<Integer>(array, range)?) {
                record.0[field] = value.0;
            }
        }
        Ok(records)
    }

    /// The time in microseconds of the event at `index`, which must exist.
    fn time(&self, index: u64) -> Result<i64, IoError> {
        let range = index..index + 1;
        let t_us = match &self.arrays[..] {
            [t, _, ..] => slice::<Integer>(t, &range)?[0].0,
            _ => self.records(&range)?[0].0[0],
        };
        Ok(t_us.wrapping_add(self.origin_us))
    }

    /// The events at most [`DISORDER_US`] beyond `range`. O(log n) chunks.
    fn near(&self, range: TimeRange) -> Result<Range<u64>, IoError> {
        if self.count == 0 {
            return Ok(0..0);
        }
        let times = range.times(self.time(0)?);
        let probe = |_, places: Range<u64>| {
            let (at, t_us) = (places.start, self.time(places.start)?);
            Ok(Some(Probe { at, value: t_us, t_us }))
        };
        let (_, begin) = step(times.start.saturating_sub(DISORDER_US), None, (self.count, None), probe)?;
        let (_, end) = step(times.end.saturating_add(DISORDER_US), None, (self.count, None), probe)?;
        let begin = begin.unwrap_or(self.count);
        Ok(begin..end.unwrap_or(self.count).max(begin))
    }
}

/// The elements of `range`.
fn slice<T: H5Type>(dataset: &Dataset, range: &Range<u64>) -> Result<Vec<T>, IoError> {
    let selection = SliceInfoElem::Slice { start: range.start, end: range.end, step: 1 };
    let elements = dataset.read_slice::<T>(&SliceInfo { selections: vec![selection] });
    let (elements, _) = elements.map_err(unreadable)?.into_raw_vec_and_offset();
    let expected = range.end - range.start;
    if elements.len() as u64 != expected {
        return Err(malformed("part of an array", format!("{expected} elements"), elements.len()));
    }
    Ok(elements)
}

/// The integer of an array with one element.
fn scalar(dataset: &Dataset) -> Result<i64, IoError> {
    let value = dataset.read_array::<Integer>().map_err(unreadable)?;
    match value.as_slice() {
        Some(&[Integer(value)]) => Ok(value),
        _ => Err(malformed("t_offset", "one integer", format!("{} elements", value.len()))),
    }
}

/// An item of a file, if it exists.
fn present<T>(found: Result<T, Error>) -> Result<Option<T>, IoError> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(Error::DatasetNotFound(_) | Error::GroupNotFound(_) | Error::AttributeNotFound(_)) => Ok(None),
        Err(Error::Context { source, .. }) => present(Err(*source)),
        Err(error) => Err(unreadable(error)),
    }
}

/// The names of a group's members, for a message.
fn members(group: &Group) -> String {
    match group.member_names() {
        Ok((groups, datasets)) => beginning(&[groups, datasets].concat().join(", "), 80),
        Err(error) => error.to_string(),
    }
}

/// The error of a container that cannot be read.
fn unreadable(error: Error) -> IoError {
    malformed("content", "readable HDF5 with integers", error.to_string())
}

/// The error of a part of the container at an unknown place.
fn malformed(what: &'static str, expected: impl Into<String>, actual: impl ToString) -> IoError {
    NOWHERE.malformed(what, 0, expected, actual)
}
