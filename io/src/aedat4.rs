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
use crate::error::{IoError, Place, check_pixel};
use crate::format::Format;
use crate::recording::{Recording, Salvage, StreamKind, Tally};
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
    let header = Header::parse(Bytes::new(format, bytes, Place::Byte(0)), salvage)?;
    let mut inflater = Inflater::new(header.compression, bytes.len() as u64);
    let rest = |what, at: usize| {
        let bytes_not_read = (bytes.len() - at) as u64;
        Some(Salvage { what, place: Place::Byte(at as u64), bytes_not_read })
    };
    // Without the table, the packets end with the file.
    let mut salvaged = if header.is_cut { rest("the packets before their table", bytes.len()) } else { None };
    if let Some(table) = header.table {
        let checked = inflater.prefix(&bytes[table..], table, TABLE_START).and_then(|start| {
            check_name(Bytes::new(format, start, packet_place(table)), "packet table", *b"FTAB")
        });
        match checked {
            // The table holds no events.
            Err(_) if salvage => salvaged = rest("the packet table", table),
            checked => checked?,
        }
    }

    let streams = &header.streams;
    let main = streams.iter().position(|stream| stream.kind == StreamKind::Events);
    let sensor = main.and_then(|main| streams[main].sensor);
    let mut tallies: Vec<Tally> = streams.iter().map(|_| Tally::default()).collect();
    let mut events = Vec::new();
    // A header may declare a thousand streams, and a packet takes 8 bytes.
    let index_of: BTreeMap<i32, usize> = streams.iter().map(|stream| stream.id).zip(0..).collect();

    let packets = Bytes::new(format, &bytes[..header.table.unwrap_or(bytes.len())], Place::Byte(0));
    let mut at = header.packets;
    while at < packets.len() {
        if salvage && !is_whole(packets, at) {
            salvaged = rest("the last packet", at);
            break;
        }
        let id = packets.i32("header of a packet", at)?;
        let size = packets.i32("header of a packet", at + 4)?;
        let Ok(size) = usize::try_from(size) else {
            return Err(packets.malformed("size of a packet", at + 4, "0 and above", size.to_string()));
        };
        let Some(&index) = index_of.get(&id) else {
            let expected = format!("one of the {} that the header declares", streams.len());
            return Err(packets.malformed("stream of a packet", at, expected, id.to_string()));
        };
        let packet = packets.get("packet", at + PACKET_HEADER, size)?;
        match streams[index].kind {
            // Streams without events are not decompressed.
            StreamKind::Frames | StreamKind::Unplaced | StreamKind::Other => tallies[index].add(1),
            kind => {
                let content = Bytes::new(format, inflater.inflate(packet, at)?, packet_place(at));
                if Some(index) == main {
                    append_events(content, sensor, &mut events)?;
                } else {
                    tallies[index].add(count_elements(content, kind)?);
                }
            }
        }
        at += PACKET_HEADER + size;
    }
    let other_streams =
        tallies.iter().zip(streams).filter_map(|(tally, stream)| tally.summary(&stream.name, stream.kind));
    Ok(Recording { format, sensor, events, other_streams: other_streams.collect(), salvaged })
}

/// Whether the packet at byte `at` is complete, header and content; true where its size is negative.
fn is_whole(packets: Bytes<'_>, at: usize) -> bool {
    let Ok(size) = packets.i32("header of a packet", at + 4) else { return false };
    usize::try_from(size).is_ok_and(|size| size <= packets.len() - at - PACKET_HEADER) || size < 0
}

/// The first byte of the content of the packet at byte `at`.
fn packet_place(at: usize) -> Place {
    Place::Packet { packet: at as u64, byte: 0 }
}

/// Appends the events of a packet EVTS to `events`.
fn append_events(content: Bytes<'_>, sensor: Option<Sensor>, events: &mut Vec<Event>) -> Result<(), IoError> {
    let (start, elements) = Table::root(content, "packet of events", *b"EVTS")?.vector(0, STRIDE)?;
    events.reserve(elements.len() / STRIDE);
    for (index, element) in elements.chunks_exact(STRIDE).enumerate() {
        let t_us = i64::from_le_bytes(array(element));
        let (x, y) = (i16::from_le_bytes(array(&element[8..])), i16::from_le_bytes(array(&element[10..])));
        let at = start + index * STRIDE;
        let (Ok(x), Ok(y)) = (u16::try_from(x), u16::try_from(y)) else {
            let actual = format!("x = {x}, y = {y}");
            return Err(content.malformed("pixel", at + 8, "x and y of 0 and above", actual));
        };
        check_pixel(content.format, sensor, (x, y), || content.place(at + 8))?;
        let on = match element[12] {
            0 => false,
            1 => true,
            other => return Err(content.malformed("polarity", at + 12, "0 or 1", other.to_string())),
        };
        events.push(Event { t_us, x, y, on });
    }
    Ok(())
}

/// The number of elements of a packet of `kind`.
fn count_elements(content: Bytes<'_>, kind: StreamKind) -> Result<u64, IoError> {
    // Samples and triggers are tables; a vector holds their offsets of four bytes.
    let (name, stride) = match kind {
        StreamKind::Events => (*b"EVTS", STRIDE),
        StreamKind::Imu => (*b"IMUS", 4),
        StreamKind::Triggers => (*b"TRIG", 4),
        StreamKind::Frames | StreamKind::Unplaced | StreamKind::Other => return Ok(1),
    };
    let (_, elements) = Table::root(content, "packet", name)?.vector(0, stride)?;
    Ok((elements.len() / stride) as u64)
}
