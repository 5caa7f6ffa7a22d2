//! AEDAT4, iniVation's container: bytes to the events of the first event stream.
//!
//! ```text
//! #!AER-DAT4.0\r\n
//! header    FlatBuffer IOHE after its size: compression, position of the table, XML of the streams
//! packets   { stream: i32, size: i32 } and `size` bytes: one compressed FlatBuffer after its size
//! table     compressed FlatBuffer FTAB: positions of the packets; none if not closed (-1)
//! ```
//!
//! A packet's buffer has a name of four letters: EVTS holds a vector of events of 16 bytes (time
//! i64 in microseconds, x and y i16, polarity one byte), FRME one frame, IMUS a vector of samples,
//! TRIG a vector of triggers. A packet is not compressed, or an LZ4 frame, or a Zstandard frame.
//! Source: iniVation's pages on the AEDAT file formats and the schemas of its `dv-processing`.
//!
//! Invariants: packets fill the space between header and table exactly. Every offset in a buffer is
//! checked against its packet. If the header declares no streams (aestream), they are found from
//! the packets' names or content. Odd events are left out and counted unless the reader is strict.
//! A packet's content is as long as its size prefix (an LZ4 decoder accepts a frame that was cut
//! after a block). Frames are not decompressed.

pub(crate) mod header;
pub(crate) mod packet;
pub(crate) mod stream;
pub(crate) mod write;

use std::collections::{BTreeMap, BTreeSet};

use meissner_engine::{Event, Sensor};

use crate::bytes::{Bytes, array};
use crate::error::IoError;
use crate::format::Format;
use crate::left_out::{LeftOutKind, PassedOver};
use crate::limits::most;
use crate::options::{ReadOptions, no_stream};
use crate::recording::{Recording, StreamKind, StreamSummary};
use crate::seek::{PacketHeader, Packets};
use header::{Header, kind_of};
use packet::{Inflater, Table, check_name, name_of};

/// Bytes of a packet's header.
const PACKET_HEADER: usize = 8;
/// Number of first bytes of the packet table, which contain its name.
const TABLE_START: u64 = 12;
/// Name of a packet's size in errors.
const SIZE: &str = "size of a packet";
/// Bytes of an event: time, x, y, polarity and three of padding.
const STRIDE: usize = 16;

/// Packets of events: their name in errors, the name in their buffer, and the bytes of an event.
const EVENTS: (&str, [u8; 4], usize) = ("packet of events", *b"EVTS", STRIDE);

/// The events of the file `bytes`; with `salvage`, those of the complete packets.
pub(crate) fn decode(bytes: &[u8], options: ReadOptions) -> Result<Recording, IoError> {
    let file = Bytes::file(Format::Aedat4.name(), bytes);
    let salvage = options.salvage;
    let header = Header::parse(file, file.len() as u64, salvage)?;
    // Without the table, the packets end with the file.
    let mut salvaged = header.is_cut.then(|| file.salvage("the packets before their table", bytes.len()));
    if let Some(table) = header.table.filter(|_| !header.is_unnamed) {
        let mut inflater = Inflater::new(header.compression, file);
        let start = inflater.prefix(&bytes[table..], table, TABLE_START);
        match start.and_then(|start| check_name(file.packet(table, start), "packet table", *b"FTAB")) {
            // The table holds no events.
            Err(_) if salvage => salvaged = Some(file.salvage("the packet table", table)),
            checked => checked?,
        }
    }
    let packets = Bytes { data: &bytes[..header.table.unwrap_or(bytes.len())], ..file }.after(header.packets);
    let recording = Container::new(header, bytes.len() as u64, options)?.events(packets, salvage)?;
    Ok(Recording { salvaged: recording.salvaged.or(salvaged), ..recording })
}

/// The assumption about a file whose header declares no stream.
const ASSUMED: &str = "the program that wrote this file left out of its header which streams it has: their packets tell, and no sensor is named";
/// Maximum number of streams that only packets declare. Without it, memory could grow without
/// bound.
const MAX_STREAMS: usize = 1024;
/// Bytes of a packet's content up to the end of its name.
const NAMED: u64 = 12;

/// Whether the buffer `content` without a name can only be a vector of events.
fn holds_events(content: Bytes<'_>) -> bool {
    let vector = Table::of_any_name(content, EVENTS.0).and_then(|root| root.vector(0, STRIDE));
    let is_event =
        |event: &[u8]| event[9] < 0x80 && event[11] < 0x80 && event[12] <= 1 && event[13..] == [0; 3];
    vector.is_ok_and(|(start, elements)| {
        !elements.is_empty()
            && content.len() - start - elements.len() < STRIDE
            && elements.chunks_exact(STRIDE).all(is_event)
    })
}

/// The indices of the streams of events.
fn of_events(streams: &[StreamSummary]) -> impl Iterator<Item = usize> {
    streams.iter().zip(0..).filter(|(stream, _)| stream.kind == StreamKind::Events).map(|(_, index)| index)
}

/// Information about a file before its packets are read, and information from the packets.
#[derive(Clone, Debug)]
pub(crate) struct Container {
    header: Header,
    /// The streams that the header declares, or those of the packets so far.
    streams: Vec<StreamSummary>,
    /// Streams without a name.
    unnamed: BTreeSet<usize>,
    /// Index of the stream whose events are read: the first stream of events, or the chosen one.
    main: Option<usize>,
    /// Its number among the streams of events, from 1.
    asked: usize,
    strict: bool,
    /// The index of each stream by its number: a header may declare a thousand streams.
    index_of: BTreeMap<i32, usize>,
    /// Bytes that the packets may still expand to during the search of a part.
    budget: u64,
}

impl Container {
    fn new(header: Header, length: u64, options: ReadOptions) -> Result<Self, IoError> {
        let asked = options.stream_number();
        let streams: Vec<_> = header.streams.iter().map(|stream| stream.summary.clone()).collect();
        let main = of_events(&streams).nth(asked - 1);
        if main.is_none() && asked > 1 && !streams.is_empty() {
            return Err(no_stream(asked, of_events(&streams).count()));
        }
        let index_of = header.streams.iter().map(|stream| stream.id).zip(0..).collect();
        let (unnamed, strict, budget) = (BTreeSet::new(), options.strict, most(length));
        Ok(Self { header, streams, unnamed, main, asked, strict, index_of, budget })
    }

    /// The events of `packets`, which are all packets of the file.
    fn events(&self, packets: Bytes<'_>, salvage: bool) -> Result<Recording, IoError> {
        let mut container = self.clone();
        let recording = container.read(packets, salvage)?;
        container.end()?;
        Ok(recording)
    }

    /// The events of `packets`, after those that were read before.
    fn read(&mut self, packets: Bytes<'_>, salvage: bool) -> Result<Recording, IoError> {
        let mut inflater = Inflater::new(self.header.compression, packets);
        let sensor = self.main.and_then(|main| self.header.streams.get(main)?.sensor);
        let mut passed = PassedOver::new(self.strict);
        let (mut events, mut at, mut salvaged) = (Vec::new(), 0, None);
        while at < packets.len() {
            if salvage && !is_whole(packets, at) {
                salvaged = Some(packets.salvage("the last packet", at));
                break;
            }
            let id = packets.i32("header of a packet", at)?;
            let size = packets.i32("header of a packet", at + 4)?;
            let Ok(size) = usize::try_from(size) else {
                return Err(packets.malformed(SIZE, at + 4, "0 and above", size));
            };
            let packet = packets.get("packet", at + PACKET_HEADER, size)?;
            let index = match self.index_of.get(&id) {
                Some(&index) => index,
                None if self.header.streams.is_empty() => {
                    self.begin(id, (at, packet), packets, &mut inflater)?
                }
                None => {
                    let expected = format!("one of the {} that the header declares", self.streams.len());
                    return Err(packets.malformed("stream of a packet", at, expected, id));
                }
            };
            let stream = &mut self.streams[index];
            let layout = match stream.kind {
                StreamKind::Events => Some(EVENTS),
                // Samples and triggers are tables; a vector holds their offsets of four bytes.
                StreamKind::Imu => Some(("packet", *b"IMUS", 4)),
                StreamKind::Triggers => Some(("packet", *b"TRIG", 4)),
                // These packets are not decompressed.
                StreamKind::Frames | StreamKind::Unplaced | StreamKind::Other => None,
            };
            if let Some((what, name, stride)) = layout {
                let content = packets.packet(at, inflater.inflate(packet, at)?);
                let name = (!self.unnamed.contains(&index)).then_some(name);
                let (start, elements) = Table::parse(content, what, name)?.vector(0, stride)?;
                if Some(index) == self.main {
                    append_events(content, (start, elements), sensor, &mut events, &mut passed)?;
                } else {
                    stream.add((elements.len() / stride) as u64);
                }
            } else {
                stream.add(1);
            }
            at += PACKET_HEADER + size;
        }
        let assumed = if self.header.streams.is_empty() { vec![ASSUMED] } else { Vec::new() };
        let (other_streams, left_out) = (StreamSummary::present(self.streams.clone()), passed.end());
        let plain = Recording::of_events(Format::Aedat4, sensor, events);
        Ok(Recording { other_streams, left_out, assumed, salvaged, ..plain })
    }

    /// Adds the stream `id`, which the header does not declare, and returns its index. The name or
    /// the content of its first packet, at byte `at`, shows its kind.
    fn begin(
        &mut self,
        id: i32,
        (at, packet): (usize, &[u8]),
        packets: Bytes<'_>,
        inflater: &mut Inflater<'_>,
    ) -> Result<usize, IoError> {
        let index = self.streams.len();
        if index == MAX_STREAMS {
            let expected = format!("at most {MAX_STREAMS} streams");
            return Err(packets.malformed("stream of a packet", at, expected, id));
        }
        let start = inflater.prefix(packet, at, NAMED)?;
        let name = name_of(packets.packet(at, start), "packet")?;
        self.streams.push(if name.iter().all(u8::is_ascii_alphanumeric) {
            StreamSummary::new(&String::from_utf8_lossy(&name), kind_of(&name))
        } else {
            self.unnamed.insert(index);
            let content = packets.packet(at, inflater.inflate(packet, at)?);
            let kind = if holds_events(content) { StreamKind::Events } else { StreamKind::Other };
            StreamSummary::new("packets without a name", kind)
        });
        self.index_of.insert(id, index);
        self.main = of_events(&self.streams).nth(self.asked - 1);
        Ok(index)
    }

    /// Checks after all packets whether the requested stream of events was found.
    fn end(&self) -> Result<(), IoError> {
        if self.main.is_some() {
            return Ok(());
        }
        if self.asked > 1 {
            return Err(no_stream(self.asked, of_events(&self.streams).count()));
        }
        if self.unnamed.is_empty() {
            return Ok(());
        }
        Err(IoError::Unsupported {
            expected: "AEDAT4 whose header or packets say what they hold",
            actual: "neither: the program that wrote this file left it out".to_owned(),
        })
    }
}

impl Packets for Container {
    const HEADER: usize = PACKET_HEADER;

    fn open(file: Bytes<'_>, length: u64, options: ReadOptions) -> Result<Self, IoError> {
        Self::new(Header::parse(file, length, true)?, length, options)
    }

    fn start(&self) -> usize {
        self.header.packets
    }

    fn end(&self, length: u64) -> Option<u64> {
        // Without declared streams, only the content of the packets shows which streams exist.
        let is_known = !self.header.is_cut && !self.header.streams.is_empty();
        is_known.then(|| self.header.table.map_or(length, |table| table as u64))
    }

    fn header(&mut self, header: &[u8]) -> Option<PacketHeader> {
        let (id, size) = (header.first_chunk()?, header.get(4..)?.first_chunk()?);
        let &index = self.index_of.get(&i32::from_le_bytes(*id))?;
        let length = u64::try_from(i32::from_le_bytes(*size)).ok()?;
        Some(PacketHeader { length, is_main: Some(index) == self.main })
    }

    fn first_us(&mut self, packet: Bytes<'_>) -> Result<Option<i64>, IoError> {
        let mut inflater = Inflater::new(self.header.compression, packet);
        inflater.budget = self.budget;
        let inflated = inflater.inflate(&packet.data[PACKET_HEADER..], 0)?;
        self.budget = self.budget.saturating_sub(inflated.len() as u64);
        let content = packet.packet(0, inflated);
        let (what, name, stride) = EVENTS;
        let (_, events) = Table::root(content, what, name)?.vector(0, stride)?;
        Ok(events.first_chunk().map(|time| i64::from_le_bytes(*time)))
    }

    fn decode(&self, packets: Bytes<'_>) -> Result<Recording, IoError> {
        self.events(packets, false)
    }
}

/// Whether the packet at byte `at` is complete; true if its size is negative.
fn is_whole(packets: Bytes<'_>, at: usize) -> bool {
    let Ok(size) = packets.i32("header of a packet", at + 4) else { return false };
    usize::try_from(size).is_ok_and(|size| size <= packets.len() - at - PACKET_HEADER) || size < 0
}

/// Appends the events in `elements`, which start at byte `start` of a packet.
fn append_events(
    content: Bytes<'_>,
    (start, elements): (usize, &[u8]),
    sensor: Option<Sensor>,
    events: &mut Vec<Event>,
    passed: &mut PassedOver,
) -> Result<(), IoError> {
    events.reserve(elements.len() / STRIDE);
    for (index, element) in elements.chunks_exact(STRIDE).enumerate() {
        let t_us = i64::from_le_bytes(array(element));
        let (x, y) = (i16::from_le_bytes(array(&element[8..])), i16::from_le_bytes(array(&element[10..])));
        let at = start + index * STRIDE;
        let (Ok(x), Ok(y)) = (u16::try_from(x), u16::try_from(y)) else {
            let actual = format!("x = {x}, y = {y}");
            let error = content.malformed("pixel", at + 8, "x and y of 0 and above", actual);
            passed.pass(LeftOutKind::Malformed, 1, error)?;
            continue;
        };
        match element[12] {
            on @ (0 | 1) => {
                if content.is_inside(sensor, x, y, at + 8, passed)? {
                    events.push(Event { t_us, x, y, on: on == 1 });
                }
            }
            other => {
                let error = content.malformed("polarity", at + 12, "0 or 1", other);
                passed.pass(LeftOutKind::Malformed, 1, error)?;
            }
        }
    }
    Ok(())
}
