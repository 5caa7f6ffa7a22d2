//! Writing of AEDAT4: one stream of events in packets, each an LZ4 frame.
//!
//! The buffers are those of [`super`], as words of four bytes. Values of eight bytes have offsets
//! that are multiples of eight from the start of a buffer.

use std::io::{self, Seek, SeekFrom, Write};
use std::ops::RangeInclusive;

use lz4_flex::frame::{BlockSize, FrameEncoder, FrameInfo};
use meissner_engine::{Event, Sensor};

use super::header::MAGIC;
use super::{EVENTS, PACKET_HEADER, STRIDE};
use crate::format::Format;
use crate::recording::Capacity;

/// Maximum number of events of a packet: 128 KiB before compression.
const PACKET_EVENTS: usize = 1 << 13;
/// Byte of the header's buffer with the position of the packet table.
const POSITION_AT: usize = 32;
/// The number of the only stream.
const STREAM: u32 = 0;

/// The events that the format can hold: coordinates are i16.
pub(crate) const CAPACITY: Capacity =
    Capacity { side: 1 << 15, sensor: "a sensor of 1 to 32768 pixels a side", ..Capacity::UNLIMITED };

/// The buffer of the header: LZ4, no packet table yet, and the XML of the only stream.
fn header(sensor: Sensor) -> Vec<u8> {
    let Sensor { width, height } = sensor;
    let xml = format!(
        r#"<dv version="2.0">
    <node name="outInfo" path="/outInfo/">
        <node name="{STREAM}" path="/outInfo/{STREAM}/">
            <attr key="compression" type="string">LZ4</attr>
            <attr key="originalModuleName" type="string">meissner</attr>
            <attr key="originalOutputName" type="string">events</attr>
            <attr key="typeDescription" type="string">Array of events (polarity ON/OFF).</attr>
            <attr key="typeIdentifier" type="string">EVTS</attr>
            <node name="info" path="/outInfo/{STREAM}/info/">
                <attr key="sizeX" type="int">{width}</attr>
                <attr key="sizeY" type="int">{height}</attr>
                <attr key="source" type="string">meissner</attr>
            </node>
        </node>
    </node>
</dv>
"#
    );
    let (lz4, not_closed) = (1, u32::MAX);
    let mut words = vec![0, 20, name(*b"IOHE"), two(10, 20), two(4, 8), two(16, 0), 12];
    words.extend([lz4, not_closed, not_closed, 4, xml.len() as u32]);
    let mut buffer = bytes(&words);
    buffer.extend(xml.into_bytes());
    buffer.push(0);
    sized(buffer)
}

/// A packet that was written.
#[derive(Clone, Debug)]
struct Written {
    /// Byte of the file at which its content starts.
    at: u64,
    size: u32,
    events: u64,
    times_us: RangeInclusive<i64>,
}

/// The buffer of the packet table.
fn table(packets: &[Written]) -> Vec<u8> {
    // The vtables of the root and of an entry, the root, and the vector's length.
    let mut words = vec![0, 28, name(*b"FTAB"), two(6, 8), two(4, 14), two(44, 12), two(4, 20), two(28, 36)];
    let (entry_vtable, entry_words) = (18, 12);
    words.extend([20, 4, packets.len() as u32]);
    let vector = words.len();
    let entries = (vector + packets.len()) | 1;
    words.extend((0..packets.len()).map(|i| 4 * (entries + entry_words * i - vector - i) as u32));
    words.resize(entries, 0);
    for Written { at, size, events, times_us } in packets {
        words.extend([4 * words.len() as u32 - entry_vtable, STREAM, *size]);
        for value in [*at as i64, *events as i64, *times_us.start(), *times_us.end()] {
            words.extend([value as u32, (value >> 32) as u32]);
        }
        words.push(0);
    }
    sized(bytes(&words))
}

/// A name of four letters as a word.
fn name(letters: [u8; 4]) -> u32 {
    u32::from_le_bytes(letters)
}

/// Two values of two bytes as a word.
fn two(first: u16, second: u16) -> u32 {
    u32::from(first) | u32::from(second) << 16
}

fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// The buffer with its size in its first word.
fn sized(mut buffer: Vec<u8>) -> Vec<u8> {
    let size = buffer.len() as u32 - 4;
    buffer[..4].copy_from_slice(&size.to_le_bytes());
    buffer
}

/// An LZ4 frame of independent blocks of 64 KiB, as iniVation's programs can read it.
fn compressed(content: &[u8], out: Vec<u8>) -> io::Result<Vec<u8>> {
    let info = FrameInfo::new().block_size(BlockSize::Max64KB);
    let mut encoder = FrameEncoder::with_frame_info(info, out);
    encoder.write_all(content)?;
    encoder.finish().map_err(io::Error::from)
}

/// A packet of `events`: its header, and the compressed buffer.
fn packet(events: &[Event]) -> io::Result<Vec<u8>> {
    let (_, letters, _) = EVENTS;
    let mut buffer = bytes(&[0, 16, name(letters), two(0, 6), two(8, 4), 6, 4, events.len() as u32]);
    buffer.reserve(STRIDE * events.len());
    for &Event { t_us, x, y, on } in events {
        let mut element = [0; STRIDE];
        element[..8].copy_from_slice(&t_us.to_le_bytes());
        element[8..10].copy_from_slice(&x.to_le_bytes());
        element[10..12].copy_from_slice(&y.to_le_bytes());
        element[12] = on.into();
        buffer.extend(element);
    }
    let mut packet = compressed(&sized(buffer), bytes(&[STREAM, 0]))?;
    let size = (packet.len() - PACKET_HEADER) as u32;
    packet[4..PACKET_HEADER].copy_from_slice(&size.to_le_bytes());
    Ok(packet)
}

/// Writes AEDAT4 packet by packet: a file, as a recorder does, or a stream over a network.
///
/// Each packet is one write. A file that was not [finished](Self::finish) has no packet table, and
/// readers read it up to its end. A process that is killed in a write leaves a part of the packet,
/// which [`ReadOptions::salvage`](crate::ReadOptions::salvage) leaves out.
///
/// ```
/// use std::io::Cursor;
/// use meissner_engine::{Event, Sensor};
/// use meissner_io::{Aedat4Writer, decode};
///
/// let events = [Event::new(10, 3, 4, true), Event::new(12, 3, 5, false)];
/// let mut file = Cursor::new(Vec::new());
/// let mut writer = Aedat4Writer::new(&mut file, Sensor::new(34, 34))?;
/// writer.write(&events)?;
/// writer.finish()?;
/// assert_eq!(decode(file.get_ref())?.events, events);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Aedat4Writer<W> {
    out: W,
    /// Bytes written.
    length: u64,
    /// The packets of a file, for its table.
    packets: Option<Vec<Written>>,
}

impl<W: Write> Aedat4Writer<W> {
    /// Starts a file: writes the magic number and the header.
    ///
    /// # Errors
    /// `out` fails, or a side of `sensor` is 0 or above 32768 pixels.
    pub fn new(out: W, sensor: Sensor) -> io::Result<Self> {
        Self { out, length: 0, packets: Some(Vec::new()) }.begin(MAGIC, sensor)
    }

    /// Starts a stream as `dv-processing` sends it: without the magic number, and without an end.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn stream(out: W, sensor: Sensor) -> io::Result<Self> {
        Self { out, length: 0, packets: None }.begin(b"", sensor)
    }

    fn begin(mut self, magic: &[u8], sensor: Sensor) -> io::Result<Self> {
        CAPACITY.check(Format::Aedat4, Some(sensor), &[]).map_err(io::Error::other)?;
        let start = [magic, &header(sensor)].concat();
        self.out.write_all(&start)?;
        self.length = start.len() as u64;
        Ok(self)
    }

    /// Appends `events`, whose columns and rows are below 32768, in packets of at most 8192.
    ///
    /// # Errors
    /// `out` fails; an incomplete packet may then follow the bytes of [`Self::length`].
    pub fn write(&mut self, events: &[Event]) -> io::Result<()> {
        for events in events.chunks(PACKET_EVENTS) {
            let packet = packet(events)?;
            self.out.write_all(&packet)?;
            if let Some(packets) = &mut self.packets {
                let times = || events.iter().map(|event| event.t_us);
                let times_us = times().min().unwrap_or(0)..=times().max().unwrap_or(0);
                let (at, size) = (self.length + PACKET_HEADER as u64, (packet.len() - PACKET_HEADER) as u32);
                packets.push(Written { at, size, events: events.len() as u64, times_us });
            }
            self.length += packet.len() as u64;
        }
        self.out.flush()
    }

    /// The bytes of the header and of the complete packets so far.
    pub fn length(&self) -> u64 {
        self.length
    }
}

impl<W: Write + Seek> Aedat4Writer<W> {
    /// Ends a file: writes the packet table and its position. Writes nothing for a
    /// [stream](Self::stream).
    ///
    /// # Errors
    /// `out` fails.
    pub fn finish(mut self) -> io::Result<W> {
        let Some(packets) = &self.packets else { return Ok(self.out) };
        self.out.write_all(&compressed(&table(packets), Vec::new())?)?;
        self.out.flush()?;
        self.out.seek(SeekFrom::Start((MAGIC.len() + POSITION_AT) as u64))?;
        self.out.write_all(&self.length.to_le_bytes())?;
        self.out.flush()?;
        Ok(self.out)
    }
}

/// Writes a file of `events`, which [`CAPACITY`] allows.
pub(crate) fn encode(sensor: Sensor, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    let mut file = Aedat4Writer::new(io::Cursor::new(Vec::new()), sensor)?;
    file.write(events)?;
    out.write_all(file.finish()?.get_ref())
}
