//! Parts of formats with packets of any size.

use std::io::{Read, Seek};
use std::ops::Range;

use super::{DISORDER_US, Input, Probe, TimeRange, step};
use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::options::ReadOptions;
use crate::recording::Recording;

/// The header of a packet.
pub(crate) struct PacketHeader {
    /// Bytes of the packet after its header.
    pub(crate) length: u64,
    /// Whether it has events that are read.
    pub(crate) is_main: bool,
}

/// A format whose packets contain their length.
pub(crate) trait Packets: Sized {
    /// Bytes of a packet's header.
    const HEADER: usize;

    /// Reads the header at the start of `file`, which has `length` bytes.
    fn open(file: Bytes<'_>, length: u64, options: ReadOptions) -> Result<Self, IoError>;
    /// First byte of the first packet.
    fn start(&self) -> usize;
    /// First byte after the last packet of a file of `length` bytes; `None`: the file is cut short.
    fn end(&self, length: u64) -> Option<u64>;
    /// The content of the next packet's header; `None`: it is malformed.
    fn header(&mut self, header: &[u8]) -> Option<PacketHeader>;
    /// The time of the first event in a packet of events, in microseconds; `None`: it has none.
    fn first_us(&mut self, packet: Bytes<'_>) -> Result<Option<i64>, IoError>;
    /// The events of complete packets.
    fn decode(&self, packets: Bytes<'_>) -> Result<Recording, IoError>;
}

/// The events of `range`; `None`: the whole file must be read.
pub(crate) fn read<T: Packets>(
    input: &mut Input<impl Read + Seek>,
    range: TimeRange,
    options: ReadOptions,
) -> Result<Option<Recording>, IoError> {
    let mut container: T = input.open(|file, length| T::open(file, length, options), T::start)?;
    let Some(end) = container.end(input.length) else { return Ok(None) };
    // The first byte and the number of bytes of each packet of events.
    let mut places = Vec::new();
    let mut at = container.start() as u64;
    while at < end {
        let header = input.read(at, T::HEADER as u64)?;
        let Some(PacketHeader { length, is_main }) = container.header(&header) else { return Ok(None) };
        let whole = length.saturating_add(T::HEADER as u64);
        if header.len() < T::HEADER || whole > end - at {
            return Ok(None);
        }
        if is_main {
            places.push((at, whole));
        }
        at += whole;
    }
    let format = input.format;
    let mut probe = |_: Option<Probe>, packets: Range<u64>| {
        for packet in packets {
            let (at, whole) = places[packet as usize];
            let data = input.read(at, whole)?;
            let bytes = Bytes { format, data: &data, origin: Place::Byte(at) };
            if let Some(t_us) = container.first_us(bytes)? {
                return Ok(Some(Probe { at: packet, value: t_us, t_us }));
            }
        }
        Ok(None)
    };
    let count = places.len() as u64;
    let Some(first_us) = probe(None, 0..count)?.map(|probe| probe.t_us) else { return Ok(None) };
    let times = range.times(first_us);
    let (begin, _) = step(times.start.saturating_sub(DISORDER_US), None, (count, None), &mut probe)?;
    let (_, after) = step(times.end.saturating_add(DISORDER_US), None, (count, None), &mut probe)?;
    let place = |packet: u64| places[packet as usize].0;
    let begin = begin.map_or(container.start() as u64, |probe| place(probe.at));
    let end = after.map_or(end, place).max(begin);
    let data = input.read(begin, end - begin)?;
    let mut recording = container.decode(Bytes { format, data: &data, origin: Place::Byte(begin) })?;
    recording.events.retain(|event| range.contains(event.t_us, first_us));
    Ok(Some(recording))
}
