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
use crate::error::{IoError, Place};
use crate::format::Format;
use crate::recording::{Recording, StreamKind, StreamSummary};
use header::Header;
use packet::{Inflater, Table, check_name};

/// Bytes of a packet's header.
const PACKET_HEADER: usize = 8;
/// First bytes of the packet table, which have its name.
const TABLE_START: u64 = 12;
/// Bytes of an event: time, x, y, polarity and three of padding.
const STRIDE: usize = 16;

/// The events of the file `bytes`; with `salvage`, those of the complete packets.
pub(crate) fn decode(bytes: &[u8], salvage: bool) -> Result<Recording, IoError> {
    let format = Format::Aedat4;
    let file = Bytes::file(format.name(), bytes);
    let Header { compression, mut streams, packets: mut at, table, is_cut } = Header::parse(file, salvage)?;
    let mut inflater = Inflater::new(compression, file);
    // Without the table, the packets end with the file.
    let mut salvaged = is_cut.then(|| file.salvage("the packets before their table", bytes.len()));
    if let Some(table) = table {
        let start = inflater.prefix(&bytes[table..], table, TABLE_START);
        match start.and_then(|start| check_name(of_packet(file, start, table), "packet table", *b"FTAB")) {
            // The table holds no events.
            Err(_) if salvage => salvaged = Some(file.salvage("the packet table", table)),
            checked => checked?,
        }
    }

    let main = streams.iter().position(|stream| stream.summary.kind == StreamKind::Events);
    let sensor = main.and_then(|main| streams[main].sensor);
    let mut events = Vec::new();
    // A header may declare a thousand streams, and a packet takes 8 bytes.
    let index_of: BTreeMap<i32, usize> = streams.iter().map(|stream| stream.id).zip(0..).collect();

    let packets = Bytes { data: &bytes[..table.unwrap_or(bytes.len())], ..file };
    while at < packets.len() {
        if salvage && !is_whole(packets, at) {
            salvaged = Some(file.salvage("the last packet", at));
            break;
        }
        let id = packets.i32("header of a packet", at)?;
        let size = packets.i32("header of a packet", at + 4)?;
        let Ok(size) = usize::try_from(size) else {
            return Err(packets.malformed("size of a packet", at + 4, "0 and above", size));
        };
        let Some(&index) = index_of.get(&id) else {
            let expected = format!("one of the {} that the header declares", streams.len());
            return Err(packets.malformed("stream of a packet", at, expected, id));
        };
        let packet = packets.get("packet", at + PACKET_HEADER, size)?;
        let stream = &mut streams[index].summary;
        let layout = match stream.kind {
            StreamKind::Events => Some(("packet of events", *b"EVTS", STRIDE)),
            // Samples and triggers are tables; a vector holds their offsets of four bytes.
            StreamKind::Imu => Some(("packet", *b"IMUS", 4)),
            StreamKind::Triggers => Some(("packet", *b"TRIG", 4)),
            // They are not decompressed.
            StreamKind::Frames | StreamKind::Unplaced | StreamKind::Other => None,
        };
        if let Some((what, name, stride)) = layout {
            let content = of_packet(file, inflater.inflate(packet, at)?, at);
            let (start, elements) = Table::root(content, what, name)?.vector(0, stride)?;
            if Some(index) == main {
                append_events(content, start, elements, sensor, &mut events)?;
            } else {
                stream.add((elements.len() / stride) as u64);
            }
        } else {
            stream.add(1);
        }
        at += PACKET_HEADER + size;
    }
    let other_streams = StreamSummary::present(streams.into_iter().map(|stream| stream.summary));
    Ok(Recording { format, sensor, events, other_streams, salvaged })
}

/// Whether the packet at byte `at` is complete, header and content; true where its size is negative.
fn is_whole(packets: Bytes<'_>, at: usize) -> bool {
    let Ok(size) = packets.i32("header of a packet", at + 4) else { return false };
    usize::try_from(size).is_ok_and(|size| size <= packets.len() - at - PACKET_HEADER) || size < 0
}

/// The decompressed content of the packet at byte `at` of `file`.
fn of_packet<'a>(file: Bytes<'_>, content: &'a [u8], at: usize) -> Bytes<'a> {
    Bytes { format: file.format, data: content, origin: Place::Packet { packet: at as u64, byte: 0 } }
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
