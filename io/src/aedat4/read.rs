//! The whole file in, its recording out: the walk over the packets.

use std::collections::BTreeMap;

use super::events;
use super::header::Header;
use super::inflate::Inflater;
use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::format::Format;
use crate::recording::{Recording, Salvage, StreamKind, Tally};

/// Bytes of a packet's header.
const PACKET_HEADER: usize = 8;
/// Bytes of the packet table that show what it is.
const TABLE_START: u64 = 12;

/// The events of the file `bytes`; to be salvaged are the packets that are whole.
pub(crate) fn decode(bytes: &[u8], salvage: bool) -> Result<Recording, IoError> {
    let format = Format::Aedat4;
    let header = Header::parse(Bytes::new(format, bytes, Place::Byte(0)), salvage)?;
    let mut inflater = Inflater::new(header.compression, bytes.len() as u64);
    let rest = |what, at: usize| {
        let bytes_not_read = (bytes.len() - at) as u64;
        Some(Salvage { what, place: Place::Byte(at as u64), bytes_not_read })
    };
    // Where the table should be and is not, the packets end with the file.
    let mut salvaged = if header.is_cut { rest("the packets before their table", bytes.len()) } else { None };
    if let Some(table) = header.table {
        let checked = inflater
            .prefix(&bytes[table..], table, TABLE_START)
            .and_then(|start| events::check_table(Bytes::new(format, start, packet_place(table))));
        match checked {
            // No event is in it.
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
            // The streams that say nothing about events are not worth decompressing.
            StreamKind::Frames | StreamKind::Unplaced | StreamKind::Other => tallies[index].add(1),
            kind => {
                let content = Bytes::new(format, inflater.inflate(packet, at)?, packet_place(at));
                if Some(index) == main {
                    events::append(content, sensor, &mut events)?;
                } else {
                    tallies[index].add(events::count(content, kind)?);
                }
            }
        }
        at += PACKET_HEADER + size;
    }
    let other_streams =
        tallies.iter().zip(streams).filter_map(|(tally, stream)| tally.summary(&stream.name, stream.kind));
    Ok(Recording { format, sensor, events, other_streams: other_streams.collect(), salvaged })
}

/// Whether the packet at byte `at`, header and content, ends before `packets` do; true where its size makes no sense.
fn is_whole(packets: Bytes<'_>, at: usize) -> bool {
    let Ok(size) = packets.i32("header of a packet", at + 4) else { return false };
    usize::try_from(size).is_ok_and(|size| size <= packets.len() - at - PACKET_HEADER) || size < 0
}

/// The first byte of the content of the packet at byte `at`.
fn packet_place(at: usize) -> Place {
    Place::Packet { packet: at as u64, byte: 0 }
}
