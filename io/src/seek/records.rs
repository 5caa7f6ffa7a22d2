//! Parts of formats with records of a fixed size.

use std::io::{Read, Seek};
use std::ops::Range;

use super::{DISORDER_US, Input, Probe, TimeRange, step};
use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::format::Format;
use crate::options::ReadOptions;
use crate::prophesee::WrappingClock;
use crate::recording::Recording;

/// Number of positions at which the clock is read to count its wraps.
const PROBES: u64 = 1024;
/// Number of records that are read at once.
const BLOCK: u64 = 512;

/// A format whose records all have the same size, some of them with a clock.
pub(crate) trait Records: Sized {
    /// The period after which the clock starts again at 0, in microseconds; `None`: it never does.
    const PERIOD: Option<i64>;

    /// Reads the header at the start of `file`.
    fn open(file: Bytes<'_>, options: ReadOptions) -> Result<Self, IoError>;
    /// First byte of the first record.
    fn start(&self) -> usize;
    /// Bytes of a record.
    fn stride(&self) -> usize;
    /// Whether a file of `length` bytes has only complete records, as many as its header states.
    fn is_whole(&self, length: u64) -> bool {
        (length - self.start() as u64).is_multiple_of(self.stride() as u64)
    }
    /// The value of the clock in a record, in microseconds; `None`: the record has none.
    fn clock(&self, record: &[u8]) -> Option<i64>;
    /// The events of records, the first of which is read with `clock`; with `salvage`, the last one
    /// may be incomplete.
    fn decode(&self, records: Bytes<'_>, clock: WrappingClock, salvage: bool) -> Result<Recording, IoError>;
}

/// The events of the whole file `bytes`.
pub(crate) fn whole<T: Records>(
    format: Format,
    bytes: &[u8],
    options: ReadOptions,
) -> Result<Recording, IoError> {
    let file = Bytes::file(format.name(), bytes);
    let layout = T::open(file, options)?;
    layout.decode(file.after(layout.start()), fresh::<T>(), options.salvage)
}

/// The events of `range`; `None`: the whole file must be read.
pub(crate) fn read<T: Records>(
    input: &mut Input<impl Read + Seek>,
    range: TimeRange,
    options: ReadOptions,
) -> Result<Option<Recording>, IoError> {
    let layout: T = input.open(|file, _| T::open(file, options), T::start)?;
    if layout.stride() == 0 || !layout.is_whole(input.length) {
        return Ok(None);
    }
    let count = (input.length - layout.start() as u64) / layout.stride() as u64;
    let mut part = Part { layout: &layout, input, count };
    let Some(first_us) = part.first_us()? else { return Ok(None) };
    let times = range.times(first_us);
    let probes = part.probes()?;
    let (begin, _) = part.step(&probes, times.start.saturating_sub(DISORDER_US))?;
    let (_, end) = part.step(&probes, times.end.saturating_add(DISORDER_US))?;
    let clock = begin.map_or_else(fresh::<T>, |probe| resumed::<T>(probe));
    let begin = begin.map_or(0, |probe| probe.at);
    let mut recording = part.decode(begin..end.unwrap_or(count).max(begin), clock)?;
    recording.events.retain(|event| range.contains(event.t_us, first_us));
    Ok(Some(recording))
}

/// A clock at the start of a file.
pub(super) fn fresh<T: Records>() -> WrappingClock {
    WrappingClock::new(T::PERIOD.unwrap_or(i64::MAX))
}

/// A clock at this position.
pub(super) fn resumed<T: Records>(Probe { value, t_us, .. }: Probe) -> WrappingClock {
    WrappingClock::resumed(T::PERIOD.unwrap_or(i64::MAX), value, t_us)
}

/// A file with its layout.
pub(super) struct Part<'a, T, R> {
    pub(super) layout: &'a T,
    pub(super) input: &'a mut Input<R>,
    /// Number of records.
    pub(super) count: u64,
}

impl<T: Records, R: Read + Seek> Part<'_, T, R> {
    /// The bytes of these records, and the position of the first.
    fn bytes(&mut self, records: &Range<u64>) -> Result<(Vec<u8>, u64), IoError> {
        let stride = self.layout.stride() as u64;
        let at = self.layout.start() as u64 + records.start * stride;
        Ok((self.input.read(at, (records.end - records.start) * stride)?, at))
    }

    pub(super) fn decode(&mut self, records: Range<u64>, clock: WrappingClock) -> Result<Recording, IoError> {
        let (data, at) = self.bytes(&records)?;
        let bytes = Bytes { format: self.input.format, data: &data, origin: Place::Byte(at) };
        self.layout.decode(bytes, clock, false)
    }

    /// The time of the first event; `None`: there is none.
    fn first_us(&mut self) -> Result<Option<i64>, IoError> {
        let mut end = BLOCK;
        loop {
            let recording = self.decode(0..end.min(self.count), fresh::<T>())?;
            match recording.events.first() {
                Some(event) => return Ok(Some(event.t_us)),
                None if end >= self.count => return Ok(None),
                None => end = end.saturating_mul(8),
            }
        }
    }

    /// The first of these records that has a clock, unwrapped after `before`. O(records).
    pub(super) fn probe(
        &mut self,
        before: Option<Probe>,
        records: Range<u64>,
    ) -> Result<Option<Probe>, IoError> {
        let mut begin = records.start;
        while begin < records.end {
            // Most records have a clock: the first block is small.
            let length = if begin == records.start { 16 } else { BLOCK };
            let block = begin..records.end.min(begin + length);
            let (bytes, _) = self.bytes(&block)?;
            let mut clocks = bytes.chunks_exact(self.layout.stride()).map(|record| self.layout.clock(record));
            if let Some((index, value)) = clocks.by_ref().zip(0..).find_map(|(clock, i)| Some((i, clock?))) {
                let mut clock = before.map_or_else(fresh::<T>, resumed::<T>);
                let t_us = if T::PERIOD.is_some() { clock.advance(value) } else { value };
                return Ok(Some(Probe { at: begin + index, value, t_us }));
            }
            begin = block.end;
        }
        Ok(None)
    }

    /// Known positions throughout the recording, in order, with the wraps between them. O(1024)
    /// reads.
    fn probes(&mut self) -> Result<Vec<Probe>, IoError> {
        let mut probes: Vec<Probe> = Vec::new();
        if T::PERIOD.is_none() {
            return Ok(probes);
        }
        let spacing = self.count.div_ceil(PROBES).max(1);
        let mut at = 0;
        while at < self.count {
            let Some(probe) = self.probe(probes.last().copied(), at..self.count)? else { break };
            probes.push(probe);
            at = (probe.at / spacing + 1) * spacing;
        }
        Ok(probes)
    }

    /// A step from before `bound_us` to not before it.
    fn step(&mut self, probes: &[Probe], bound_us: i64) -> Result<(Option<Probe>, Option<u64>), IoError> {
        let known = |_, places: Range<u64>| {
            Ok(probes.get(places.start as usize).map(|probe| Probe { at: places.start, ..*probe }))
        };
        let (low, high) = step(bound_us, None, (probes.len() as u64, None), known)?;
        let low = low.map(|low| probes[low.at as usize]);
        let high = high.map(|high| probes[high as usize].at);
        let end = high.unwrap_or(self.count);
        step(bound_us, low, (end, high), |before, records| self.probe(before, records))
    }
}
