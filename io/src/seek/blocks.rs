//! Reads a recording block by block, without holding the other blocks.
//!
//! Input: a file whose parts can be read separately. Output: its events in the file's order, equal
//! to those of the whole recording. Invariant: a block of records begins at a record with a clock,
//! and with the clock at the end of the previous block; a block of packets has complete packets.

use std::io::{Read, Seek};

use super::records::{Part, fresh, resumed};
use super::{Input, PacketHeader, Packets, Probe, Records};
use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::options::ReadOptions;
use crate::recording::Recording;

/// Number of records of a block.
pub(crate) const RECORDS: u64 = 1 << 16;
/// Bytes of a block of packets.
const BYTES: u64 = 1 << 20;

/// The next block; `None` at the end.
type Next = dyn FnMut() -> Result<Option<Recording>, IoError> + Send;

/// The blocks of about 65,536 events of a recording, in order ([`blocks`](crate::blocks)).
///
/// After an error there are no more.
pub struct Blocks {
    next: Box<Next>,
    ended: bool,
}

impl Blocks {
    pub(crate) fn new(next: impl FnMut() -> Result<Option<Recording>, IoError> + Send + 'static) -> Self {
        Self { next: Box::new(next), ended: false }
    }
}

impl Iterator for Blocks {
    type Item = Result<Recording, IoError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let next = (self.next)().transpose();
        self.ended = !matches!(next, Some(Ok(_)));
        next
    }
}

/// The blocks of a format with records; `None`: the whole file must be read.
pub(crate) fn of_records<T: Records + Send + 'static>(
    mut input: Input<impl Read + Seek + Send + 'static>,
    options: ReadOptions,
) -> Result<Option<Blocks>, IoError> {
    let layout: T = input.open(|file, _| T::open(file, options), T::start)?;
    if layout.stride() == 0 || !layout.is_whole(input.length) {
        return Ok(None);
    }
    let count = (input.length - layout.start() as u64) / layout.stride() as u64;
    // The first record of the next block, with its clock.
    let (mut begin, mut clock): (u64, Option<Probe>) = (0, None);
    Ok(Some(Blocks::new(move || {
        if begin >= count {
            return Ok(None);
        }
        let mut part = Part { layout: &layout, input: &mut input, count };
        let next = part.probe(clock, count.min(begin + RECORDS)..count)?;
        let end = next.map_or(count, |next| next.at);
        let recording = part.decode(begin..end, clock.map_or_else(fresh::<T>, resumed::<T>))?;
        // The clock may have wrapped more than once within the block: the time of its last event
        // shows it.
        let last = recording.events.last().map(|event| {
            let value = T::PERIOD.map_or(event.t_us, |period| event.t_us.rem_euclid(period));
            Probe { at: end, value, t_us: event.t_us }
        });
        clock = next.map(|next| match (T::PERIOD, last.or(clock)) {
            (Some(_), Some(last)) => Probe { t_us: resumed::<T>(last).advance(next.value), ..next },
            _ => next,
        });
        begin = end;
        Ok(Some(recording))
    })))
}

/// The blocks of a format with packets; `None`: the whole file must be read.
pub(crate) fn of_packets<T: Packets + Send + 'static>(
    mut input: Input<impl Read + Seek + Send + 'static>,
    options: ReadOptions,
) -> Result<Option<Blocks>, IoError> {
    let mut container: T = input.open(|file, length| T::open(file, length, options), T::start)?;
    let Some(end) = container.end(input.length) else { return Ok(None) };
    let mut at = container.start() as u64;
    Ok(Some(Blocks::new(move || {
        if at >= end {
            return Ok(None);
        }
        let begin = at;
        while at < end && at - begin < BYTES {
            let header = input.read(at, T::HEADER as u64)?;
            let length = container.header(&header).map(|PacketHeader { length, .. }| length);
            // An incomplete packet is decoded with the remaining bytes, to get its error.
            let whole = length.map_or(u64::MAX, |length| length.saturating_add(T::HEADER as u64));
            at = at.saturating_add(whole).min(end);
        }
        let data = input.read(begin, at - begin)?;
        container.decode(Bytes { format: input.format, data: &data, origin: Place::Byte(begin) }).map(Some)
    })))
}
