//! MCAP: messages to bytes, chunk by chunk.

use std::collections::BTreeMap;
use std::io::{self, Write};

use lz4_flex::frame::FrameEncoder;
use meissner_engine::{Event, Sensor};

use super::cdr;
use super::records::{MAGIC, op};
use crate::recording::Capacity;

/// Bytes after which a chunk is written.
const CHUNK: usize = 1 << 20;
/// Maximum number of events of a packet.
const PACKET: usize = 8192;
/// Maximum microseconds of a packet: its times are 32 bits of nanoseconds.
const PACKET_US: u64 = u32::MAX as u64 / 1000;
/// Latest time in microseconds: times are 64 bits of nanoseconds.
const LATEST_US: u64 = u64::MAX / 1000;

/// The type of packets of events, and the types that it uses, as ROS 2 writes them.
const EVENT_PACKET: &str = "\
std_msgs/Header header
uint32 height
uint32 width
uint64 seq
uint64 time_base
string encoding
bool is_bigendian
uint8[] events
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";

/// The events that the format can hold.
pub(crate) const CAPACITY: Capacity = Capacity {
    times: 0..=LATEST_US as i64,
    side: 1 << 15,
    sensor: "a sensor of 1 to 32768 pixels a side",
    steps: "",
    is_wrap: |_, _| false,
};

/// Writes an MCAP file, which is readable up to the newest [flush](Self::flush) at any time.
///
/// Chunks are compressed (LZ4), and have a checksum and an index. A summary ends the file.
///
/// ```
/// use meissner_engine::{Event, Sensor};
/// use meissner_io::{McapWriter, decode};
///
/// let mut writer = McapWriter::new(Vec::new())?;
/// let events = writer.event_channel("/events")?;
/// let found = writer.json_channel("/prediction", "Prediction", r#"{"type":"object"}"#)?;
/// writer.events(events, Sensor::new(346, 260), &[Event::new(10, 3, 4, true)])?;
/// writer.message(found, 10, br#"{"roll":0.1}"#)?;
/// let bytes = writer.finish()?;
///
/// let recording = decode(&bytes)?;
/// assert_eq!(recording.events, [Event::new(10, 3, 4, true)]);
/// assert_eq!(recording.other_streams[0].name, "/prediction");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct McapWriter<W> {
    out: W,
    /// Bytes written.
    at: u64,
    /// Records of the next chunk.
    chunk: Vec<u8>,
    /// First and last times of the next chunk and of the file, in nanoseconds.
    times: Option<(u64, u64)>,
    all_times: Option<(u64, u64)>,
    /// Time and place of each message of the next chunk, by channel.
    index: BTreeMap<u16, Vec<u8>>,
    /// Messages of each channel.
    counts: BTreeMap<u16, u64>,
    /// Records of the summary.
    schemas: Vec<u8>,
    channels: Vec<u8>,
    chunks: Vec<u8>,
    chunk_count: u32,
    schema_count: u16,
}

impl<W: Write> McapWriter<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// The errors of `out`, as for every method.
    pub fn new(mut out: W) -> io::Result<Self> {
        let library = concat!("meissner ", env!("CARGO_PKG_VERSION"));
        let mut start = MAGIC.to_vec();
        put_record(&mut start, op::HEADER, &[text(""), text(library)]);
        out.write_all(&start)?;
        Ok(Self {
            out,
            at: start.len() as u64,
            chunk: Vec::new(),
            times: None,
            all_times: None,
            index: BTreeMap::new(),
            counts: BTreeMap::new(),
            schemas: Vec::new(),
            channels: Vec::new(),
            chunks: Vec::new(),
            chunk_count: 0,
            schema_count: 0,
        })
    }

    /// A topic of events, for [`Self::events`].
    ///
    /// # Errors
    /// There are 65535 channels.
    pub fn event_channel(&mut self, topic: &str) -> io::Result<u16> {
        let schema = ["event_camera_msgs/msg/EventPacket", "ros2msg", EVENT_PACKET];
        self.channel(topic, schema, "cdr")
    }

    /// A topic of messages in JSON of the type `name`, which the JSON Schema `schema` describes.
    ///
    /// # Errors
    /// There are 65535 channels.
    pub fn json_channel(&mut self, topic: &str, name: &str, schema: &str) -> io::Result<u16> {
        self.channel(topic, [name, "jsonschema", schema], "json")
    }

    fn channel(&mut self, topic: &str, schema: [&str; 3], encoding: &str) -> io::Result<u16> {
        let id = self.schema_count.checked_add(1).ok_or_else(|| invalid("at most 65535 channels", "more"))?;
        self.schema_count = id;
        self.counts.insert(id, 0);
        let number = id.to_le_bytes().to_vec();
        let [name, written_in, definition] = schema.map(text);
        let mut records = Vec::new();
        put_record(&mut records, op::SCHEMA, &[number.clone(), name, written_in, definition]);
        self.schemas.extend(&records);
        self.chunk.append(&mut records);
        put_record(
            &mut records,
            op::CHANNEL,
            &[number.clone(), number, text(topic), text(encoding), vec![0; 4]],
        );
        self.channels.extend(&records);
        self.chunk.extend(records);
        Ok(id)
    }

    /// Writes a message of `channel` at `t_us`, in microseconds; an earlier time is 0.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn message(&mut self, channel: u16, t_us: i64, data: &[u8]) -> io::Result<()> {
        let time = (t_us.max(0) as u64).min(LATEST_US) * 1000;
        let count = self.counts.entry(channel).or_default();
        let place = self.chunk.len() as u64;
        let index = self.index.entry(channel).or_default();
        index.extend([time, place].into_iter().flat_map(u64::to_le_bytes));
        let head = [
            channel.to_le_bytes().to_vec(),
            (*count as u32).to_le_bytes().to_vec(),
            [time; 2].map(u64::to_le_bytes).concat(),
        ]
        .concat();
        *count += 1;
        self.chunk.push(op::MESSAGE);
        self.chunk.extend((head.len() as u64 + data.len() as u64).to_le_bytes());
        self.chunk.extend(head);
        self.chunk.extend(data);
        for times in [&mut self.times, &mut self.all_times] {
            let (first, last) = times.unwrap_or((time, time));
            *times = Some((first.min(time), last.max(time)));
        }
        if self.chunk.len() >= CHUNK { self.flush() } else { Ok(()) }
    }

    /// Writes `events` of `sensor` to a channel of [`Self::event_channel`], exactly.
    ///
    /// # Errors
    /// Those of `out`, and [`io::ErrorKind::InvalidInput`] for a time before 0 or after
    /// 18,446,744,073,709,551 us, or a row from 32768 on.
    pub fn events(&mut self, channel: u16, sensor: Sensor, mut events: &[Event]) -> io::Result<()> {
        loop {
            let (mut first, mut last, mut length) = (u64::MAX, 0, 0);
            for event in events.iter().take(PACKET) {
                let t_us = u64::try_from(event.t_us).ok().filter(|&t_us| t_us <= LATEST_US);
                let t_us = t_us.ok_or_else(|| invalid("times of 0 to 18446744073709551 us", event.t_us))?;
                if event.y >= 1 << 15 {
                    return Err(invalid("rows below 32768", event.y));
                }
                let (from, to) = (first.min(t_us), last.max(t_us));
                if to - from > PACKET_US {
                    break;
                }
                (first, last, length) = (from, to, length + 1);
            }
            let (packet, rest) = events.split_at(length);
            let seq = self.counts.get(&channel).copied().unwrap_or_default();
            let data = event_packet(sensor, seq, (first.min(last), last), packet);
            self.message(channel, last as i64, &data)?;
            events = rest;
            if rest.is_empty() {
                return Ok(());
            }
        }
    }

    /// Writes the data so far, so that they are readable.
    ///
    /// # Errors
    /// The errors of `out`; the file then has the content of the previous flush and an incomplete
    /// part.
    pub fn flush(&mut self) -> io::Result<()> {
        if self.chunk.is_empty() {
            return self.out.flush();
        }
        let mut encoder = FrameEncoder::new(Vec::new());
        encoder.write_all(&self.chunk)?;
        let packed = encoder.finish().map_err(io::Error::other)?;
        let (first, last) = self.times.take().unwrap_or_default();
        let times = [first, last].map(u64::to_le_bytes).concat();
        let size = (self.chunk.len() as u64).to_le_bytes().to_vec();
        let packed_size = (packed.len() as u64).to_le_bytes().to_vec();
        let crc = crc32fast::hash(&self.chunk).to_le_bytes().to_vec();
        self.chunk.clear();
        let mut records = Vec::new();
        let fields = [times.clone(), size.clone(), crc, text("lz4"), packed_size.clone(), packed];
        put_record(&mut records, op::CHUNK, &fields);
        let length = records.len() as u64;
        let mut places = Vec::new();
        for (channel, index) in std::mem::take(&mut self.index) {
            places.extend(channel.to_le_bytes());
            places.extend((self.at + records.len() as u64).to_le_bytes());
            put_record(&mut records, op::MESSAGE_INDEX, &[channel.to_le_bytes().to_vec(), sized(index)]);
        }
        let indexed = (records.len() as u64 - length).to_le_bytes().to_vec();
        let chunk = [self.at, length].map(u64::to_le_bytes).concat();
        let fields = [times, chunk, sized(places), indexed, text("lz4"), packed_size, size];
        put_record(&mut self.chunks, op::CHUNK_INDEX, &fields);
        self.chunk_count += 1;
        self.write(&records)?;
        self.out.flush()
    }

    /// Ends the file with its summary, and returns the output.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn finish(mut self) -> io::Result<W> {
        self.flush()?;
        let mut end = Vec::new();
        put_record(&mut end, op::DATA_END, &[vec![0; 4]]);
        self.write(&end)?;
        let start = self.at;
        let (first, last) = self.all_times.unwrap_or_default();
        let counts = self.counts.iter();
        let each = counts
            .clone()
            .flat_map(|(channel, count)| [&channel.to_le_bytes()[..], &count.to_le_bytes()].concat());
        let statistics = [
            counts.map(|(_, count)| count).sum::<u64>().to_le_bytes().to_vec(),
            self.schema_count.to_le_bytes().to_vec(),
            // Channels; attachments, metadata; chunks.
            [u32::from(self.schema_count), 0, 0, self.chunk_count].map(u32::to_le_bytes).concat(),
            [first, last].map(u64::to_le_bytes).concat(),
            sized(each.collect()),
        ];
        let mut summary = [&self.schemas[..], &self.channels].concat();
        put_record(&mut summary, op::STATISTICS, &statistics);
        summary.extend(&self.chunks);
        // The footer's checksum covers its own fields before it.
        put_record(&mut summary, op::FOOTER, &[[start, 0].map(u64::to_le_bytes).concat(), vec![0; 4]]);
        let crc = crc32fast::hash(&summary[..summary.len() - 4]);
        summary.truncate(summary.len() - 4);
        summary.extend(crc.to_le_bytes());
        summary.extend(MAGIC);
        self.write(&summary)?;
        self.out.flush()?;
        Ok(self.out)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)?;
        self.at += bytes.len() as u64;
        Ok(())
    }
}

/// Writes a file with `events`, which [`CAPACITY`] allows.
pub(crate) fn encode(sensor: Sensor, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    let mut writer = McapWriter::new(out)?;
    let channel = writer.event_channel("/events")?;
    writer.events(channel, sensor, events)?;
    writer.finish().map(drop)
}

/// The message of `events` in `mono`, whose times are in `times`.
fn event_packet(sensor: Sensor, seq: u64, times: (u64, u64), events: &[Event]) -> Vec<u8> {
    let (first, last) = times;
    let mut message = cdr::Writer::new();
    message.header(last);
    message.put(u32::from(sensor.height).to_le_bytes());
    message.put(u32::from(sensor.width).to_le_bytes());
    message.put(seq.to_le_bytes());
    message.put((first * 1000).to_le_bytes());
    message.text("mono");
    message.put([0]);
    let record = |event: &Event| {
        let t_ns = (event.t_us as u64 - first) * 1000;
        u64::from(event.on) << 63 | u64::from(event.y) << 48 | u64::from(event.x) << 32 | t_ns
    };
    let records: Vec<u8> = events.iter().flat_map(|event| record(event).to_le_bytes()).collect();
    message.sequence(&records);
    message.end()
}

/// Adds a record of these fields.
fn put_record(out: &mut Vec<u8>, op: u8, fields: &[Vec<u8>]) {
    let length: usize = fields.iter().map(Vec::len).sum();
    out.push(op);
    out.extend((length as u64).to_le_bytes());
    fields.iter().for_each(|field| out.extend(field));
}

/// A text after its length.
fn text(text: &str) -> Vec<u8> {
    sized(text.as_bytes().to_vec())
}

/// Bytes after their number.
fn sized(bytes: Vec<u8>) -> Vec<u8> {
    let mut sized = (bytes.len() as u32).to_le_bytes().to_vec();
    sized.extend(bytes);
    sized
}

fn invalid(expected: &str, found: impl ToString) -> io::Error {
    let found = found.to_string();
    io::Error::new(io::ErrorKind::InvalidInput, format!("MCAP holds {expected}, found {found}"))
}
