//! AEDAT 3.1, the format of cAER and of DVS Gesture: bytes to the events of the first source.
//!
//! ```text
//! #!AER-DAT3.1\r\n            text header: lines that start with `#`
//! #Format: RAW\r\n            how packets are coded; only RAW is read
//! #Source 1: DVS128\r\n       the chip of each source of events
//! #!END-HEADER\r\n
//! packets                     28 bytes of header and the events, least significant byte first
//! ```
//!
//! The header of a packet contains the type (i16; 1: changes of brightness), the source (i16), and
//! as i32 the bytes of an event, the offset of the time in it, the number of overflows of the
//! 31-bit clock, the capacity, the number of events, and the number of valid ones. A change of
//! brightness has 8 bytes: bits 31-17 x, 16-2 y, 1 polarity, 0 whether it is valid, then the time
//! in microseconds (i32, 0 and above). Source: iniVation's page on AEDAT 3.1 and the headers of
//! `libcaer`.
//!
//! Invariants: packets fill the file exactly. A time is the packet's overflows times 2^31 plus the
//! event's own time, so nothing wraps. Events that are not marked as valid are counted and left
//! out; so are packets of other types and other sources, and, unless the reader is strict, events
//! outside the chip or with a time below 0.

use std::collections::BTreeMap;

use meissner_engine::{Event, Sensor};

use crate::aedat2;
use crate::bytes::{Bytes, array};
use crate::error::{IoError, shown};
use crate::format::{Format, beginning};
use crate::left_out::{LeftOutKind, PassedOver};
use crate::limits::HEADER_BYTES;
use crate::options::{ReadOptions, no_stream};
use crate::recording::{Recording, StreamKind, StreamSummary};
use crate::seek::{PacketHeader, Packets};

/// Bytes of a packet's header.
const PACKET_HEADER: usize = 28;
/// The type of packets of changes of brightness.
const POLARITY: i16 = 1;
/// Bytes of a change of brightness.
const STRIDE: usize = 8;

/// The events of the file `bytes`; with `salvage`, those of the complete packets.
pub(crate) fn decode(bytes: &[u8], options: ReadOptions) -> Result<Recording, IoError> {
    let file = Bytes::file(Format::Aedat3.name(), bytes);
    let container = Container::open(file, file.len() as u64, options)?;
    container.events(file.after(container.header.end), options.salvage)
}

/// Information about a file before its packets are read.
pub(crate) struct Container {
    header: Header,
    /// The source whose events are read, once it is found.
    main: Main,
    strict: bool,
}

/// The source whose events are read: the first with changes of brightness, or of this number.
#[derive(Clone)]
struct Main {
    /// Number of the source, counted from 1 in the order of their first packets.
    asked: usize,
    /// The sources that were found so far.
    found: Vec<i16>,
}

impl Main {
    /// Whether `source`, which has a packet of changes of brightness, is the source to read.
    fn is(&mut self, source: i16) -> bool {
        if self.found.len() < self.asked && !self.found.contains(&source) {
            self.found.push(source);
        }
        self.source() == Some(source)
    }

    /// The source, once it is found.
    fn source(&self) -> Option<i16> {
        self.found.get(self.asked - 1).copied()
    }
}

impl Container {
    /// The events of `packets`.
    fn events(&self, packets: Bytes<'_>, salvage: bool) -> Result<Recording, IoError> {
        let (mut decoder, mut at, mut salvaged) = (Decoder::new(packets, self), 0, None);
        while at < packets.len() {
            let packet = match Head::at(packets, at).and_then(|head| Ok((head.content(packets, at)?, head))) {
                Err(IoError::Truncated { .. }) if salvage => {
                    salvaged = Some(packets.salvage("the last packet", at));
                    break;
                }
                packet => packet?,
            };
            decoder.push(at, &packet.1, packet.0)?;
            at += PACKET_HEADER + packet.0.len();
        }
        let Decoder { sensor, events, others, passed, main, .. } = decoder;
        if main.source().is_none() && main.asked > 1 {
            return Err(no_stream(main.asked, main.found.len()));
        }
        let (other_streams, left_out) = (StreamSummary::present(others.into_values()), passed.end());
        let plain = Recording::of_events(Format::Aedat3, sensor, events);
        Ok(Recording { other_streams, left_out, salvaged, ..plain })
    }
}

impl Packets for Container {
    const HEADER: usize = PACKET_HEADER;

    fn open(file: Bytes<'_>, _: u64, options: ReadOptions) -> Result<Self, IoError> {
        let main = Main { asked: options.stream_number(), found: Vec::new() };
        Ok(Self { header: Header::parse(file)?, main, strict: options.strict })
    }

    fn start(&self) -> usize {
        self.header.end
    }

    fn end(&self, length: u64) -> Option<u64> {
        Some(length)
    }

    fn header(&mut self, header: &[u8]) -> Option<PacketHeader> {
        let head = Head::at(Bytes::file(Format::Aedat3.name(), header), 0).ok()?;
        let is_main = head.kind == POLARITY && self.main.is(head.source);
        Some(PacketHeader { length: head.length, is_main })
    }

    fn first_us(&mut self, packet: Bytes<'_>) -> Result<Option<i64>, IoError> {
        let head = Head::at(packet, 0)?;
        let events = head.content(packet, 0)?.as_chunks::<STRIDE>().0;
        let valid = events.iter().find(|event| event[0] & 1 == 1);
        Ok(valid.map(|event| head.base_us + i64::from(i32::from_le_bytes(array(&event[4..])))))
    }

    fn decode(&self, packets: Bytes<'_>) -> Result<Recording, IoError> {
        self.events(packets, false)
    }
}

/// The header of a packet.
struct Head {
    kind: i16,
    source: i16,
    /// The time at which the clock's period began, in microseconds.
    base_us: i64,
    /// Number of events.
    number: u64,
    /// Bytes of all events.
    length: u64,
}

impl Head {
    /// The header at byte `at` of `packets`.
    fn at(packets: Bytes<'_>, at: usize) -> Result<Self, IoError> {
        let header: [u8; PACKET_HEADER] = packets.array("header of a packet", at)?;
        let short = |place: usize| i16::from_le_bytes(array(&header[place..]));
        let natural = |name, place: usize| {
            let value = i32::from_le_bytes(array(&header[place..]));
            u32::try_from(value).map_err(|_| packets.malformed(name, at + place, "0 and above", value))
        };
        let (kind, source) = (short(0), short(2));
        if kind < 0 {
            let expected = "0 and above: packets that are not compressed";
            return Err(packets.malformed("type of a packet", at, expected, kind));
        }
        let (size, time_at) = (natural("size of an event", 4)?, natural("place of the time", 8)?);
        let overflows = natural("overflows of the clock", 12)?;
        let number = natural("number of events", 20)?;
        if kind == POLARITY && (size as usize, time_at) != (STRIDE, 4) {
            let actual = format!("{size} bytes with the time at {time_at}");
            let expected = "8 bytes with the time at 4";
            return Err(packets.malformed("layout of an event", at + 4, expected, actual));
        }
        let length = u64::from(size) * u64::from(number);
        Ok(Self { kind, source, base_us: i64::from(overflows) << 31, number: number.into(), length })
    }

    /// The events of the packet at byte `at` of `packets`.
    fn content<'a>(&self, packets: Bytes<'a>, at: usize) -> Result<&'a [u8], IoError> {
        packets.get("packet", at + PACKET_HEADER, self.length as usize)
    }
}

/// The state of a reader.
struct Decoder<'a> {
    packets: Bytes<'a>,
    header: &'a Header,
    main: Main,
    /// The sensor of the main source.
    sensor: Option<Sensor>,
    events: Vec<Event>,
    /// Counts by name.
    others: BTreeMap<&'static str, StreamSummary>,
    passed: PassedOver,
}

impl<'a> Decoder<'a> {
    fn new(packets: Bytes<'a>, Container { header, main, strict }: &'a Container) -> Self {
        let sensor = main.source().and_then(|main| header.sensor(main));
        let (main, passed) = (main.clone(), PassedOver::new(*strict));
        Self { packets, header, main, sensor, events: Vec::new(), others: BTreeMap::new(), passed }
    }

    /// Takes the packet at byte `at` of the packets.
    fn push(&mut self, at: usize, head: &Head, content: &[u8]) -> Result<(), IoError> {
        let &Head { kind, source, base_us, number, .. } = head;
        if kind != POLARITY || !self.main.is(source) {
            self.count(of_type(kind), number);
            return Ok(());
        }
        self.sensor = self.sensor.or_else(|| self.header.sensor(source));
        let mut invalid = 0;
        self.events.reserve(content.len() / STRIDE);
        let start = at + PACKET_HEADER;
        for (event, at) in content.as_chunks::<STRIDE>().0.iter().zip((start..).step_by(STRIDE)) {
            let (data, time) = (u32::from_le_bytes(array(event)), i32::from_le_bytes(array(&event[4..])));
            if data & 1 == 0 {
                invalid += 1;
                continue;
            }
            if time < 0 {
                let error = self.packets.malformed("time of an event", at + 4, "0 and above", time);
                self.passed.pass(LeftOutKind::Malformed, 1, error)?;
                continue;
            }
            let (x, y) = ((data >> 17) as u16, (data >> 2 & 0x7fff) as u16);
            if self.packets.is_inside(self.sensor, x, y, at, &mut self.passed)? {
                self.events.push(Event::new(base_us + i64::from(time), x, y, data & 2 != 0));
            }
        }
        if invalid > 0 {
            self.count(("events not marked as valid", StreamKind::Other), invalid);
        }
        Ok(())
    }

    /// Counts a packet with this number of elements.
    fn count(&mut self, (name, kind): (&'static str, StreamKind), elements: u64) {
        self.others.entry(name).or_insert_with(|| StreamSummary::new(name, kind)).add(elements);
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

/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"#!AER-DAT3.1\r\n";
/// The header's last line.
const END: &[u8] = b"#!END-HEADER";

/// The content and the end of a header.
#[derive(Debug)]
struct Header {
    /// First byte of the first packet.
    end: usize,
    /// The sources with a known chip, and its pixels.
    sources: Vec<(i16, Sensor)>,
}

impl Header {
    /// Reads the header at the start of `file`.
    fn parse(file: Bytes<'_>) -> Result<Self, IoError> {
        file.magic(MAGIC)?;
        let mut header = Self { end: MAGIC.len(), sources: Vec::new() };
        loop {
            let start = header.end;
            if start as u64 > HEADER_BYTES {
                return Err(file.too_large("header", 0, HEADER_BYTES, start as u64, true));
            }
            let tail = &file.data[start..];
            let Some(length) = tail.iter().position(|&b| b == b'\n') else {
                let what = "the header before its line #!END-HEADER";
                return Err(file.truncated(what, 0, file.len() as u64 + 1, true));
            };
            header.end += length + 1;
            let line = tail[..length].trim_ascii_end();
            if line == END {
                return Ok(header);
            }
            if !line.starts_with(b"#") {
                return Err(file.malformed("line of the header", start, "`#` at its start", shown(line)));
            }
            let text = String::from_utf8_lossy(&line[1..]);
            match text.split_once(':').map(|(key, value)| (key.trim(), value.trim())) {
                Some(("Format", "RAW")) | None => {}
                Some(("Format", other)) => {
                    let actual = format!("format `{}`", beginning(other, 40));
                    return Err(IoError::Unsupported { expected: "AEDAT 3.1 of format RAW", actual });
                }
                Some((key, chip)) => {
                    let source = key.strip_prefix("Source ").and_then(|number| number.trim().parse().ok());
                    header.sources.extend(source.zip(aedat2::sensor_of(chip)));
                }
            }
        }
    }

    /// The pixels of this source's chip, if it is known.
    fn sensor(&self, source: i16) -> Option<Sensor> {
        self.sources.iter().find(|(known, _)| *known == source).map(|&(_, sensor)| sensor)
    }
}
