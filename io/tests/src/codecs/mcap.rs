//! A writer of MCAP and CDR for the tests, which shares no code with the crate's writer.

use meissner_engine::{Event, Sensor};

use super::aedat4::Compression;

/// CRC-32, bit by bit.
pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

/// A record of these fields.
pub fn record(op: u8, fields: &[&[u8]]) -> Vec<u8> {
    let content = fields.concat();
    [&[op][..], &(content.len() as u64).to_le_bytes(), &content].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

/// A schema of `ros2msg`, without its text.
pub fn schema(id: u16, name: &str) -> Vec<u8> {
    record(3, &[&id.to_le_bytes(), &text(name), &text("ros2msg"), &text("")])
}

/// A channel of messages with this schema.
pub fn channel(id: u16, schema: u16, topic: &str, encoding: &str) -> Vec<u8> {
    let ids = [id, schema].map(u16::to_le_bytes).concat();
    record(4, &[&ids, &text(topic), &text(encoding), &[0; 4]])
}

/// A message, logged and published at this time.
pub fn message(channel: u16, t_ns: u64, data: &[u8]) -> Vec<u8> {
    record(5, &[&channel.to_le_bytes(), &[0; 4], &t_ns.to_le_bytes(), &t_ns.to_le_bytes(), data])
}

/// A chunk of `records`, which are `packed` as `compression` says.
pub fn packed_chunk(compression: &str, records: &[u8], packed: &[u8]) -> Vec<u8> {
    let crc = crc32(records).to_le_bytes();
    let sizes = [records, packed].map(|bytes| (bytes.len() as u64).to_le_bytes());
    record(6, &[&[0; 16], &sizes[0], &crc, &text(compression), &sizes[1], packed])
}

/// A chunk of `records` in this compression, `lz4` or none.
pub fn chunk(compression: &str, records: &[u8]) -> Vec<u8> {
    let packed = if compression == "lz4" { Compression::Lz4.pack(records) } else { records.to_vec() };
    packed_chunk(compression, records, &packed)
}

/// A file of these records and chunks, without checksums and summary.
pub fn file(records: &[Vec<u8>]) -> Vec<u8> {
    let magic = b"\x89MCAP0\r\n";
    let (header, end) = (record(1, &[&text(""), &text("tests")]), record(15, &[&[0; 4]]));
    [&magic[..], &header, &records.concat(), &end, &record(2, &[&[0; 20]]), magic].concat()
}

/// Values of a message in CDR, each at a multiple of its size.
pub struct Cdr {
    /// The written bytes, from the encapsulation header on.
    pub bytes: Vec<u8>,
    big: bool,
}

impl Cdr {
    /// A message in big or little endian.
    pub fn new(big: bool) -> Self {
        Self { bytes: vec![0, u8::from(!big), 0, 0], big }
    }

    fn put(&mut self, size: usize, value: u64) -> &mut Self {
        while !(self.bytes.len() - 4).is_multiple_of(size) {
            self.bytes.push(0);
        }
        let mut bytes = value.to_le_bytes()[..size].to_vec();
        if self.big {
            bytes.reverse();
        }
        self.bytes.extend(bytes);
        self
    }

    /// Appends a byte.
    pub fn u8(&mut self, value: u8) -> &mut Self {
        self.put(1, value.into())
    }

    /// Appends 16 bits, aligned.
    pub fn u16(&mut self, value: u16) -> &mut Self {
        self.put(2, value.into())
    }

    /// Appends 32 bits, aligned.
    pub fn u32(&mut self, value: u32) -> &mut Self {
        self.put(4, value.into())
    }

    /// Appends 64 bits, aligned.
    pub fn u64(&mut self, value: u64) -> &mut Self {
        self.put(8, value)
    }

    /// Appends a sequence of bytes.
    pub fn sequence(&mut self, bytes: &[u8]) -> &mut Self {
        self.u32(bytes.len() as u32);
        self.bytes.extend(bytes);
        self
    }

    /// Appends a string.
    pub fn text(&mut self, text: &str) -> &mut Self {
        self.sequence(&[text.as_bytes(), b"\0"].concat())
    }

    /// A `std_msgs/msg/Header`.
    pub fn header(&mut self) -> &mut Self {
        self.u32(1).u32(2).text("camera")
    }
}

/// An `event_camera_msgs/msg/EventPacket`.
pub fn packet(sensor: Sensor, seq: u64, base: u64, encoding: &str, events: &[u8]) -> Vec<u8> {
    let mut cdr = Cdr::new(false);
    cdr.header();
    cdr.u32(sensor.height.into()).u32(sensor.width.into()).u64(seq).u64(base);
    cdr.text(encoding).u8(0).sequence(events);
    cdr.bytes
}

/// The same of `events` in `mono`, which begin with the earliest and last at most 4 s.
pub fn mono_packet(sensor: Sensor, seq: u64, events: &[Event]) -> Vec<u8> {
    let first = events.first().map_or(0, |e| e.t_us);
    let bits = |e: &Event| {
        let (x, y) = (u64::from(e.x), u64::from(e.y));
        (u64::from(e.on) << 63) | (y << 48) | (x << 32) | ((e.t_us - first) as u64 * 1000)
    };
    let bytes: Vec<u8> = events.iter().flat_map(|e| bits(e).to_le_bytes()).collect();
    packet(sensor, seq, first as u64 * 1000, "mono", &bytes)
}
