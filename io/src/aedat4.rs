//! AEDAT4, iniVation's container: the bytes of a file to the events of its first event stream; the other streams are counted.
//!
//! ```text
//! #!AER-DAT4.0\r\n
//! header    FlatBuffer IOHE after its size: compression, position of the packet table, XML of the streams
//! packets   { stream: i32, size: i32 } and `size` bytes: one compressed FlatBuffer after its size
//! table     compressed FlatBuffer FTAB: position of each packet; missing if the recording was not closed (position -1)
//! ```
//!
//! A packet's buffer has a name of four letters: EVTS holds a vector of events of 16 bytes (time i64 in microseconds, x and y
//! i16, polarity one byte), FRME one frame, IMUS a vector of samples, TRIG a vector of triggers. A packet is not compressed,
//! or an LZ4 frame, or a Zstandard frame. Source: iniVation's pages on the AEDAT file formats and the schemas of its
//! `dv-processing`.
//!
//! Invariants: packets fill the space between header and table exactly. Every offset in a buffer is checked against its
//! packet. A packet's content is as long as its size prefix (this also finds an LZ4 frame that was cut at the end of a
//! block, which its decoder accepts). Frames are counted and not decompressed.

pub(crate) mod header;
mod packet;

use std::collections::BTreeMap;

use meissner_engine::{Event, Sensor};

use crate::bytes::{Bytes, array};
use crate::error::IoError;
use crate::format::Format;
use crate::limits::most;
use crate::recording::{Recording, StreamKind, StreamSummary};
use crate::seek::{PacketHeader, Packets};
use header::Header;
use packet::{Inflater, Table, check_name};

/// Bytes of a packet's header.
const PACKET_HEADER: usize = 8;
/// First bytes of the packet table, which have its name.
const TABLE_START: u64 = 12;
/// Bytes of an event: time, x, y, polarity and three of padding.
const STRIDE: usize = 16;

/// Packets of events: what they are called, the name in their buffer, and the bytes of an event.
const EVENTS: (&str, [u8; 4], usize) = ("packet of events", *b"EVTS", STRIDE);

/// The events of the file `bytes`; with `salvage`, those of the complete packets.
pub(crate) fn decode(bytes: &[u8], salvage: bool) -> Result<Recording, IoError> {
    let file = Bytes::file(Format::Aedat4.name(), bytes);
    let header = Header::parse(file, file.len() as u64, salvage)?;
    // Without the table, the packets end with the file.
    let mut salvaged = header.is_cut.then(|| file.salvage("the packets before their table", bytes.len()));
    if let Some(table) = header.table {
        let mut inflater = Inflater::new(header.compression, file);
        let start = inflater.prefix(&bytes[table..], table, TABLE_START);
        match start.and_then(|start| check_name(file.packet(table, start), "packet table", *b"FTAB")) {
            // The table holds no events.
            Err(_) if salvage => salvaged = Some(file.salvage("the packet table", table)),
            checked => checked?,
        }
    }
    let packets = Bytes { data: &bytes[..header.table.unwrap_or(bytes.len())], ..file }.after(header.packets);
    let recording = Container::new(header, bytes.len() as u64).events(packets, salvage)?;
    Ok(Recording { salvaged: recording.salvaged.or(salvaged), ..recording })
}

/// What is known of a file before its packets are read.
pub(crate) struct Container {
    header: Header,
    /// The first event stream, whose events are read.
    main: Option<usize>,
    /// The place of each stream by its number. A header may declare a thousand streams, and a packet takes 8 bytes.
    index_of: BTreeMap<i32, usize>,
    /// Bytes that the packets may still decompress to while a part is searched.
    budget: u64,
}

impl Container {
    fn new(header: Header, length: u64) -> Self {
        let main = header.streams.iter().position(|stream| stream.summary.kind == StreamKind::Events);
        let index_of = header.streams.iter().map(|stream| stream.id).zip(0..).collect();
        Self { header, main, index_of, budget: most(length) }
    }

    /// The events of `packets`.
    fn events(&self, packets: Bytes<'_>, salvage: bool) -> Result<Recording, IoError> {
        let Header { compression, streams, .. } = &self.header;
        let mut inflater = Inflater::new(*compression, packets);
        let sensor = self.main.and_then(|main| streams[main].sensor);
        let mut others: Vec<StreamSummary> = streams.iter().map(|stream| stream.summary.clone()).collect();
        let (mut events, mut at, mut salvaged) = (Vec::new(), 0, None);
        while at < packets.len() {
            if salvage && !is_whole(packets, at) {
                salvaged = Some(packets.salvage("the last packet", at));
                break;
            }
            let id = packets.i32("header of a packet", at)?;
            let size = packets.i32("header of a packet", at + 4)?;
            let Ok(size) = usize::try_from(size) else {
                return Err(packets.malformed("size of a packet", at + 4, "0 and above", size));
            };
            let Some(&index) = self.index_of.get(&id) else {
                let expected = format!("one of the {} that the header declares", streams.len());
                return Err(packets.malformed("stream of a packet", at, expected, id));
            };
            let packet = packets.get("packet", at + PACKET_HEADER, size)?;
            let stream = &mut others[index];
            let layout = match stream.kind {
                StreamKind::Events => Some(EVENTS),
                // Samples and triggers are tables; a vector holds their offsets of four bytes.
                StreamKind::Imu => Some(("packet", *b"IMUS", 4)),
                StreamKind::Triggers => Some(("packet", *b"TRIG", 4)),
                // They are not decompressed.
                StreamKind::Frames | StreamKind::Unplaced | StreamKind::Other => None,
            };
            if let Some((what, name, stride)) = layout {
                let content = packets.packet(at, inflater.inflate(packet, at)?);
                let (start, elements) = Table::root(content, what, name)?.vector(0, stride)?;
                if Some(index) == self.main {
                    append_events(content, start, elements, sensor, &mut events)?;
                } else {
                    stream.add((elements.len() / stride) as u64);
                }
            } else {
                stream.add(1);
            }
            at += PACKET_HEADER + size;
        }
        let other_streams = StreamSummary::present(others);
        Ok(Recording { format: Format::Aedat4, sensor, events, other_streams, salvaged })
    }
}

impl Packets for Container {
    const HEADER: usize = PACKET_HEADER;

    fn open(file: Bytes<'_>, length: u64) -> Result<Self, IoError> {
        Ok(Self::new(Header::parse(file, length, true)?, length))
    }

    fn start(&self) -> usize {
        self.header.packets
    }

    fn end(&self, length: u64) -> Option<u64> {
        (!self.header.is_cut).then(|| self.header.table.map_or(length, |table| table as u64))
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

/// Whether the packet at byte `at` is complete, header and content; true where its size is negative.
fn is_whole(packets: Bytes<'_>, at: usize) -> bool {
    let Ok(size) = packets.i32("header of a packet", at + 4) else { return false };
    usize::try_from(size).is_ok_and(|size| size <= packets.len() - at - PACKET_HEADER) || size < 0
}

/// Appends the events in `elements`, which start at byte `start` of a packet.
fn append_events(
    content: Bytes<'_>,
    start: usize,
    elements: &[u8],
    sensor: Option<Sensor>,
    events: &mut Vec<Event>,
) -> Result<(), IoError> {
    events.reserve(elements.len() / STRIDE);
    for (index, element) in elements.chunks_exact(STRIDE).enumerate() {
        let t_us = i64::from_le_bytes(array(element));
        let (x, y) = (i16::from_le_bytes(array(&element[8..])), i16::from_le_bytes(array(&element[10..])));
        let at = start + index * STRIDE;
        let (Ok(x), Ok(y)) = (u16::try_from(x), u16::try_from(y)) else {
            let actual = format!("x = {x}, y = {y}");
            return Err(content.malformed("pixel", at + 8, "x and y of 0 and above", actual));
        };
        content.check_pixel(sensor, x, y, at + 8)?;
        let on = match element[12] {
            0 => false,
            1 => true,
            other => return Err(content.malformed("polarity", at + 12, "0 or 1", other)),
        };
        events.push(Event { t_us, x, y, on });
    }
    Ok(())
}
