//! AEDAT 3.1, the format of cAER and of DVS Gesture: the bytes of a file to the events of its first source.
//!
//! ```text
//! #!AER-DAT3.1\r\n            text header: lines that start with `#`
//! #Format: RAW\r\n            how packets are coded; only RAW is read
//! #Source 1: DVS128\r\n       the chip of each source of events
//! #!END-HEADER\r\n
//! packets                     28 bytes of header and the events, least significant byte first
//! ```
//!
//! The header of a packet has the type (i16; 1: changes of brightness), the source (i16), and as i32 the bytes of an event, the
//! place of the time in it, the number of times that the 31-bit clock has passed its end, the capacity, the number of events,
//! and the number of valid ones. A change of brightness has 8 bytes: bits 31-17 x, 16-2 y, 1 polarity, 0 whether it is valid,
//! then the time in microseconds (i32, 0 and above). Source: iniVation's page on AEDAT 3.1 and the headers of `libcaer`.
//!
//! Invariants: packets fill the file exactly. A time is the packet's overflows times 2^31 plus the event's own time, so nothing
//! wraps. Events that are not marked as valid are counted and left out; so are packets of other types and other sources.

mod header;

use std::collections::BTreeMap;

use meissner_engine::{Event, Sensor};

use crate::bytes::{Bytes, array};
use crate::error::IoError;
use crate::format::Format;
use crate::recording::{Recording, Salvage, StreamKind, StreamSummary};
pub(crate) use header::MAGIC;
use header::Header;

/// Bytes of a packet's header.
const PACKET_HEADER: usize = 28;
/// The type of packets of changes of brightness.
const POLARITY: i16 = 1;
/// Bytes of a change of brightness.
const STRIDE: usize = 8;

/// The events of the file `bytes`; with `salvage`, those of the complete packets.
pub(crate) fn decode(bytes: &[u8], salvage: bool) -> Result<Recording, IoError> {
    let file = Bytes::file(Format::Aedat3.name(), bytes);
    let header = Header::parse(file)?;
    let mut decoder = Decoder { header, main: None, sensor: None, events: Vec::new(), others: BTreeMap::new() };
    let mut at = decoder.header.end;
    while at < file.len() {
        let packet = match Packet::at(file, at) {
            Err(IoError::Truncated { .. }) if salvage => {
                return Ok(decoder.finish(Some(file.salvage("the last packet", at))));
            }
            packet => packet?,
        };
        decoder.push(file, at, &packet)?;
        at += PACKET_HEADER + packet.content.len();
    }
    Ok(decoder.finish(None))
}

/// A complete packet.
struct Packet<'a> {
    kind: i16,
    source: i16,
    /// The time of the packet's first clock period, in microseconds.
    base_us: i64,
    number: u64,
    content: &'a [u8],
}

impl<'a> Packet<'a> {
    /// The packet at byte `at` of `file`.
    fn at(file: Bytes<'a>, at: usize) -> Result<Self, IoError> {
        let what = "header of a packet";
        let header: [u8; PACKET_HEADER] = file.array(what, at)?;
        let short = |place: usize| i16::from_le_bytes(array(&header[place..]));
        let natural = |name, place: usize| {
            let value = i32::from_le_bytes(array(&header[place..]));
            u32::try_from(value).map_err(|_| file.malformed(name, at + place, "0 and above", value))
        };
        let (kind, source) = (short(0), short(2));
        if kind < 0 {
            let expected = "0 and above: packets that are not compressed";
            return Err(file.malformed("type of a packet", at, expected, kind));
        }
        let (size, time_at) = (natural("size of an event", 4)?, natural("place of the time", 8)?);
        let overflows = natural("overflows of the clock", 12)?;
        let number = natural("number of events", 20)?;
        if kind == POLARITY && (size as usize, time_at) != (STRIDE, 4) {
            let actual = format!("{size} bytes with the time at {time_at}");
            return Err(file.malformed("layout of an event", at + 4, "8 bytes with the time at 4", actual));
        }
        let length = u64::from(size) * u64::from(number);
        let content = file.get("packet", at + PACKET_HEADER, length as usize)?;
        Ok(Self { kind, source, base_us: i64::from(overflows) << 31, number: number.into(), content })
    }
}

/// The state of a reader.
struct Decoder {
    header: Header,
    /// The source whose events are read: that of the first packet of changes of brightness.
    main: Option<i16>,
    /// Its sensor.
    sensor: Option<Sensor>,
    events: Vec<Event>,
    /// What was counted, by name.
    others: BTreeMap<&'static str, StreamSummary>,
}

impl Decoder {
    /// Takes the packet at byte `at`.
    fn push(&mut self, file: Bytes<'_>, at: usize, packet: &Packet<'_>) -> Result<(), IoError> {
        let &Packet { kind, source, base_us, number, content } = packet;
        if kind == POLARITY && self.main.is_none() {
            self.main = Some(source);
            self.sensor = self.header.sensor(source);
        }
        if kind != POLARITY || self.main != Some(source) {
            self.count(of_type(kind), number);
            return Ok(());
        }
        let before = self.events.len();
        self.events.reserve(content.len() / STRIDE);
        let start = at + PACKET_HEADER;
        for (event, at) in content.as_chunks::<STRIDE>().0.iter().zip((start..).step_by(STRIDE)) {
            let (data, time) = (u32::from_le_bytes(array(event)), i32::from_le_bytes(array(&event[4..])));
            if data & 1 == 0 {
                continue;
            }
            if time < 0 {
                return Err(file.malformed("time of an event", at + 4, "0 and above", time));
            }
            let (x, y) = ((data >> 17) as u16, (data >> 2 & 0x7fff) as u16);
            file.check_pixel(self.sensor, x, y, at)?;
            self.events.push(Event::new(base_us + i64::from(time), x, y, data & 2 != 0));
        }
        let invalid = number - (self.events.len() - before) as u64;
        if invalid > 0 {
            self.count(("events not marked as valid", StreamKind::Other), invalid);
        }
        Ok(())
    }

    /// Counts a packet with so many elements.
    fn count(&mut self, (name, kind): (&'static str, StreamKind), elements: u64) {
        self.others.entry(name).or_insert_with(|| StreamSummary::new(name, kind)).add(elements);
    }

    fn finish(self, salvaged: Option<Salvage>) -> Recording {
        let other_streams = StreamSummary::present(self.others.into_values());
        Recording { format: Format::Aedat3, sensor: self.sensor, events: self.events, other_streams, salvaged }
    }
}

/// The name and kind of packets of this type that are not read.
fn of_type(kind: i16) -> (&'static str, StreamKind) {
    match kind {
        0 => ("special events", StreamKind::Triggers),
        POLARITY => ("events of another source", StreamKind::Events),
        2 => ("frames", StreamKind::Frames),
        3 | 4 => ("IMU", StreamKind::Imu),
        _ => ("packets of another type", StreamKind::Other),
    }
}
