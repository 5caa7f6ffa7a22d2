//! A writer of AEDAT4 for the tests: the container, and its tables laid out as the recorders do.

use std::io::Write;

use lz4_flex::frame::FrameEncoder;
use meissner_engine::{Event, Sensor};
use ruzstd::encoding::{CompressionLevel, compress_to_vec};

use super::{SENSOR, events};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compression {
    None = 0,
    Lz4 = 1,
    Zstd = 3,
}

impl Compression {
    pub(crate) const ALL: [Self; 3] = [Self::None, Self::Lz4, Self::Zstd];

    pub(crate) fn pack(self, content: &[u8]) -> Vec<u8> {
        match self {
            Self::None => content.to_vec(),
            Self::Lz4 => {
                let mut encoder = FrameEncoder::new(Vec::new());
                encoder.write_all(content).expect("memory");
                encoder.finish().expect("memory")
            }
            Self::Zstd => compress_to_vec(content, CompressionLevel::Fastest),
        }
    }
}

/// A file to be: its packets are compressed already.
pub(crate) struct File {
    pub(crate) compression: Compression,
    pub(crate) xml: String,
    pub(crate) packets: Vec<(i32, Vec<u8>)>,
    /// The content of the packet table, not compressed; `None`: the recording was not closed.
    pub(crate) table: Option<Vec<u8>>,
}

impl File {
    /// An event stream 0 with this geometry, and nothing in it.
    pub(crate) fn new(compression: Compression, sensor: Option<Sensor>) -> Self {
        let xml = outputs(&stream(0, "events", "EVTS", sensor));
        Self { compression, xml, packets: Vec::new(), table: Some(vector(*b"FTAB", 0, &[])) }
    }

    /// Adds a packet with this content.
    pub(crate) fn push(&mut self, stream: i32, content: &[u8]) {
        self.packets.push((stream, self.compression.pack(content)));
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut packets = Vec::new();
        for (stream, packet) in &self.packets {
            packets.extend(stream.to_le_bytes());
            packets.extend((packet.len() as i32).to_le_bytes());
            packets.extend(packet);
        }
        let mut bytes = header(self.compression as i32, &self.xml, -1);
        if let Some(table) = &self.table {
            bytes = header(self.compression as i32, &self.xml, (bytes.len() + packets.len()) as i64);
            packets.extend(self.compression.pack(table));
        }
        bytes.extend(packets);
        bytes
    }
}

/// The XML around the streams' nodes.
pub(crate) fn outputs(streams: &str) -> String {
    format!(r#"<dv version="2.0"><node name="outInfo" path="/outInfo/">{streams}</node></dv>"#)
}

/// A stream's node.
pub(crate) fn stream(id: i32, name: &str, kind: &str, sensor: Option<Sensor>) -> String {
    let size = sensor.map_or(String::new(), |Sensor { width, height }| {
        format!(r#"<attr key="sizeX" type="int">{width}</attr><attr key="sizeY" type="int">{height}</attr>"#)
    });
    format!(
        r#"<node name="{id}"><attr key="originalOutputName">{name}</attr>
        <attr key="typeIdentifier">{kind}</attr><node name="info">{size}</node></node>"#
    )
}

/// Magic and header.
pub(crate) fn header(compression: i32, xml: &str, table: i64) -> Vec<u8> {
    let mut content = Vec::new();
    content.extend(24_u32.to_le_bytes());
    content.extend(b"IOHE");
    content.extend([0; 6]);
    for entry in [10_u16, 24, 4, 12, 8] {
        content.extend(entry.to_le_bytes());
    }
    content.extend(10_i32.to_le_bytes());
    content.extend(compression.to_le_bytes());
    content.extend(16_u32.to_le_bytes());
    content.extend(table.to_le_bytes());
    content.extend([0; 4]);
    content.extend((xml.len() as u32).to_le_bytes());
    content.extend(xml.as_bytes());
    let mut bytes = b"#!AER-DAT4.0\r\n".to_vec();
    bytes.extend((content.len() as u32).to_le_bytes());
    bytes.extend(content);
    bytes
}

/// A buffer whose root has one vector of `count` elements.
pub(crate) fn vector(name: [u8; 4], count: u32, elements: &[u8]) -> Vec<u8> {
    let mut content = Vec::new();
    content.extend(16_u32.to_le_bytes());
    content.extend(name);
    content.extend([0; 2]);
    for entry in [6_u16, 8, 4] {
        content.extend(entry.to_le_bytes());
    }
    content.extend(6_i32.to_le_bytes());
    content.extend(4_u32.to_le_bytes());
    content.extend(count.to_le_bytes());
    content.extend(elements);
    let mut bytes = (content.len() as u32).to_le_bytes().to_vec();
    bytes.extend(content);
    bytes
}

/// A packet's content: events.
pub(crate) fn event_packet(events: &[Event]) -> Vec<u8> {
    let mut elements = Vec::new();
    for event in events {
        elements.extend(event.t_us.to_le_bytes());
        elements.extend(event.x.to_le_bytes());
        elements.extend(event.y.to_le_bytes());
        elements.extend([event.on.into(), 0, 0, 0]);
    }
    vector(*b"EVTS", events.len() as u32, &elements)
}

/// Events in three packets between a frame, two packets of samples and one trigger.
pub(crate) fn sample(compression: Compression) -> Vec<u8> {
    let mut file = File::new(compression, Some(SENSOR));
    let streams = [
        stream(0, "events", "EVTS", Some(SENSOR)),
        stream(1, "frames", "FRME", Some(SENSOR)),
        stream(2, "imu", "IMUS", None),
        stream(3, "triggers", "TRIG", None),
    ];
    file.xml = outputs(&streams.concat());
    let all = events();
    file.push(0, &event_packet(&all[..7]));
    file.push(1, b"a frame is not looked into");
    file.push(2, &vector(*b"IMUS", 2, &[4, 0, 0, 0, 4, 0, 0, 0]));
    file.push(0, &event_packet(&all[7..39]));
    file.push(2, &vector(*b"IMUS", 1, &[4, 0, 0, 0]));
    file.push(3, &vector(*b"TRIG", 1, &[4, 0, 0, 0]));
    file.push(0, &event_packet(&all[39..]));
    file.bytes()
}
