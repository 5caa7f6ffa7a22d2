//! Bytes of every format, made here, and the strategies of the property tests.

use std::error::Error;
use std::io::{self, Read};

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, IoError, ReadOptions, Recording, decode_with, encode};
use proptest::prelude::*;

/// An error with its sources.
pub fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(inner) = source {
        text = format!("{text}: {inner}");
        source = inner.source();
    }
    text
}

/// The result of a strict reader for `bytes`: no odd data are left out.
///
/// # Errors
/// The errors of the reader.
pub fn strictly(bytes: &[u8]) -> Result<Recording, IoError> {
    decode_with(bytes, ReadOptions::default().strict(true))
}

/// A recording that every format except N-MNIST can hold, with all values different.
pub fn events() -> Vec<Event> {
    (0..40_u16).map(|i| Event::new(1000 + i64::from(i) * 700, i * 3, 200 - i * 5, i % 3 == 0)).collect()
}

/// The sensor of [`events`].
pub const SENSOR: Sensor = Sensor { width: 346, height: 260 };

/// The file that the encoder of `format` makes.
pub fn encoded(format: Format, sensor: Option<Sensor>, events: &[Event]) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(format, sensor, events, &mut bytes).expect("events that the format holds");
    bytes
}

/// A file of EVT2 with this header and these words.
pub fn evt2(header: &str, words: &[u32]) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    bytes
}

/// The words of `events`, with a time word before an event if one is due.
pub fn evt2_words(events: &[Event]) -> Vec<u32> {
    let mut words = Vec::new();
    let mut high = None;
    for event in events {
        let new = (event.t_us >> 6) as u32 & 0x0fff_ffff;
        if high != Some(new) {
            words.push(0x8000_0000 | new);
            high = Some(new);
        }
        let low = (event.t_us as u32 & 0x3f) << 22;
        words.push(u32::from(event.on) << 28 | low | u32::from(event.x) << 11 | u32::from(event.y));
    }
    words
}

/// A file of EVT2.1 with this header and these words, each an upper half and a lower one.
pub fn evt21(header: &str, words: &[[u32; 2]], legacy: bool) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    let halves =
        words.iter().flat_map(|&[upper, lower]| if legacy { [upper, lower] } else { [lower, upper] });
    bytes.extend(halves.flat_map(u32::to_le_bytes));
    bytes
}

/// The words of `events`, which are in order: events of a time, row and polarity whose columns rise
/// share a word.
pub fn evt21_words(events: &[Event]) -> Vec<[u32; 2]> {
    let (mut words, mut newest): (Vec<[u32; 2]>, Option<(Event, u16)>) = (Vec::new(), None);
    let mut high = None;
    for event in events {
        if let (Some((first, last)), Some([_, mask])) = (newest, words.last_mut())
            && (first.t_us, first.y, first.on) == (event.t_us, event.y, event.on)
            && (last + 1..=first.x.saturating_add(31)).contains(&event.x)
        {
            *mask |= 1 << (event.x - first.x);
            newest = Some((first, event.x));
            continue;
        }
        for word in evt2_words(std::slice::from_ref(event)) {
            let is_time = word >> 28 == 0x8;
            if !is_time || high != Some(word) {
                words.push([word, u32::from(!is_time)]);
            }
            if is_time {
                high = Some(word);
            }
        }
        newest = Some((*event, event.x));
    }
    words
}

/// A file of EVT3 with this header and these words.
pub fn evt3(header: &str, words: &[u16]) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    bytes
}

/// The bytes of `events`, on 34 x 34 pixels and before 2^23 microseconds.
pub fn nmnist(events: &[Event]) -> Vec<u8> {
    let bytes = events.iter().flat_map(|e| {
        let [_, high, middle, low] = (e.t_us as u32).to_be_bytes();
        [e.x as u8, e.y as u8, high | u8::from(e.on) << 7, middle, low]
    });
    bytes.collect()
}

/// A small valid file of every format, and of every compression of AEDAT4.
pub fn samples() -> Vec<(Format, Vec<u8>)> {
    let all = events();
    let on_34: Vec<_> = all.iter().map(|e| Event { x: e.x % 34, y: e.y % 34, ..*e }).collect();
    let mut samples = vec![
        (Format::Evt2, evt2("% evt 2.0\n% geometry 346x260\n% end\n", &evt2_words(&all))),
        (Format::Nmnist, nmnist(&on_34)),
    ];
    for format in [Format::Evt3, Format::Dat, Format::Csv, Format::Npy] {
        samples.push((format, encoded(format, Some(SENSOR), &all)));
    }
    for compression in aedat4::Compression::ALL {
        samples.push((Format::Aedat4, aedat4::sample(compression)));
    }
    samples.push((Format::Es, encoded(Format::Es, Some(SENSOR), &all)));
    samples.push((Format::Aedat2, aedat::aedat2(&aedat::DAVIS346, &aedat::davis_records(SENSOR, &all))));
    samples.push((Format::Aedat3, aedat::aedat3(&all, 15)));
    let header = "% format EVT21;height=260;width=346;endianness=legacy\n% end\n";
    samples.push((Format::Evt21, evt21(header, &evt21_words(&all), true)));
    samples.push((Format::Mcap, encoded(Format::Mcap, Some(SENSOR), &all)));
    let (packet, name) = (mcap::mono_packet(SENSOR, 0, &all), "event_camera_msgs/msg/EventPacket");
    let declared = [mcap::schema(1, name), mcap::channel(1, 1, "/events", "cdr")].concat();
    samples.push((
        Format::Mcap,
        mcap::file(&[mcap::chunk("", &[declared, mcap::message(1, 5, &packet)].concat())]),
    ));
    samples
}

/// A text without a line feed that fails if more than `left` bytes of it are read.
pub struct Endless {
    /// Bytes that are left.
    pub left: u64,
}

impl Read for Endless {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        assert!(self.left >= buffer.len() as u64, "more is read than a line may have");
        self.left -= buffer.len() as u64;
        buffer.fill(b'1');
        Ok(buffer.len())
    }
}

/// Any event with a time from `times`, on `side` x `side` pixels.
pub fn any_event(times: impl Strategy<Value = i64>, side: u16) -> impl Strategy<Value = Event> {
    (times, 0..side, 0..side, any::<bool>()).prop_map(|(t, x, y, on)| Event::new(t, x, y, on))
}

/// Events in order of time from 0 to `most`, with bursts and long silences.
pub fn sorted_events(most: i64, side: u16) -> impl Strategy<Value = Vec<Event>> {
    let times = prop_oneof![0..=most, 0..=most.min(20_000)];
    prop::collection::vec(any_event(times, side), 0..60).prop_map(|mut events| {
        events.sort_by_key(|e| e.t_us);
        events
    })
}

pub mod mcap;

pub mod aedat {
    //! Writers of AEDAT 2.0 and 3.1 for the tests.

    use meissner_engine::{Event, Sensor};

    /// A file of AEDAT 2.0 with these lines after the first, and these pairs of address and time.
    pub fn aedat2(lines: &[&str], records: &[[u32; 2]]) -> Vec<u8> {
        let mut bytes = b"#!AER-DAT2.0\r\n".to_vec();
        bytes.extend(lines.iter().flat_map(|line| format!("# {line}\r\n").into_bytes()));
        bytes.extend(records.iter().flatten().flat_map(|word| word.to_be_bytes()));
        bytes
    }

    /// The header's line that names a DAVIS346, and the last line.
    pub const DAVIS346: [&str; 2] = ["AEChip: eu.seebetter.ini.chips.davis.Davis346B", "End of ASCII Header"];

    /// The records of `events` of a DAVIS with this sensor.
    pub fn davis_records(sensor: Sensor, events: &[Event]) -> Vec<[u32; 2]> {
        let address = |e: &Event| {
            let (x, y) = (sensor.width - 1 - e.x, sensor.height - 1 - e.y);
            u32::from(y) << 22 | u32::from(x) << 12 | u32::from(e.on) << 11
        };
        events.iter().map(|e| [address(e), e.t_us as u32]).collect()
    }

    /// The records of `events` of a DVS128.
    pub fn dvs128_records(events: &[Event]) -> Vec<[u32; 2]> {
        let address = |e: &Event| u32::from(127 - e.y) << 8 | u32::from(127 - e.x) << 1 | u32::from(!e.on);
        events.iter().map(|e| [address(e), e.t_us as u32]).collect()
    }

    /// The header of AEDAT 3.1 with one source.
    pub fn aedat3_header(source: u16, chip: &str) -> Vec<u8> {
        let start = "#Start-Time: 2017-03-21 14:12:03 (TZ+0100)";
        format!("#!AER-DAT3.1\r\n#Format: RAW\r\n#Source {source}: {chip}\r\n{start}\r\n#!END-HEADER\r\n")
            .into_bytes()
    }

    /// A packet of AEDAT 3.1: type, source, bytes of an event, overflows of the clock, and the
    /// events.
    pub fn aedat3_packet(kind: i16, source: i16, size: i32, overflows: i32, content: &[u8]) -> Vec<u8> {
        let number = content.len() as i32 / size.max(1);
        let mut bytes = [kind.to_le_bytes(), source.to_le_bytes()].concat();
        for value in [size, 4, overflows, number, number, number] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend(content);
        bytes
    }

    /// The content of a packet of `events`, all valid, within one period of the clock.
    pub fn aedat3_events(events: &[Event]) -> Vec<u8> {
        let event = |e: &Event| {
            let data = u32::from(e.x) << 17 | u32::from(e.y) << 2 | u32::from(e.on) << 1 | 1;
            [data.to_le_bytes(), (e.t_us as u32 & 0x7fff_ffff).to_le_bytes()].concat()
        };
        events.iter().flat_map(event).collect()
    }

    /// A file of AEDAT 3.1 of a DAVIS346: a new packet after at most `most` events, and when the
    /// clock overflows.
    pub fn aedat3(events: &[Event], most: usize) -> Vec<u8> {
        let mut bytes = aedat3_header(1, "DAVIS346");
        for period in events.chunk_by(|a, b| a.t_us >> 31 == b.t_us >> 31) {
            for packet in period.chunks(most) {
                let overflows = (packet[0].t_us >> 31) as i32;
                bytes.extend(aedat3_packet(1, 1, 8, overflows, &aedat3_events(packet)));
            }
        }
        bytes
    }
}

pub mod aedat4 {
    //! A writer of AEDAT4 for the tests: the container, and its tables with the layout of the
    //! recorders.

    use std::io::Write;

    use lz4_flex::frame::FrameEncoder;
    use meissner_engine::{Event, Sensor};
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};

    use super::{SENSOR, events};

    /// Compression of packets, by its number in the header.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Compression {
        /// No compression.
        None = 0,
        /// Frames of LZ4.
        Lz4 = 1,
        /// Frames of Zstandard.
        Zstd = 3,
    }

    impl Compression {
        /// All compressions.
        pub const ALL: [Self; 3] = [Self::None, Self::Lz4, Self::Zstd];

        /// The compressed bytes.
        pub fn pack(self, content: &[u8]) -> Vec<u8> {
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

    /// A file under construction: its packets are compressed already.
    pub struct File {
        /// Compression of all packets.
        pub compression: Compression,
        /// The streams, as the header names them.
        pub xml: String,
        /// The stream and the content of each packet.
        pub packets: Vec<(i32, Vec<u8>)>,
        /// The content of the packet table, not compressed; `None`: the recording was not closed.
        pub table: Option<Vec<u8>>,
    }

    impl File {
        /// An event stream 0 with this geometry, and nothing in it.
        pub fn new(compression: Compression, sensor: Option<Sensor>) -> Self {
            let xml = outputs(&stream(0, "events", "EVTS", sensor));
            Self { compression, xml, packets: Vec::new(), table: Some(vector(*b"FTAB", 0, &[])) }
        }

        /// Adds a packet with this content.
        pub fn push(&mut self, stream: i32, content: &[u8]) {
            self.packets.push((stream, self.compression.pack(content)));
        }

        /// The whole file.
        pub fn bytes(&self) -> Vec<u8> {
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
    pub fn outputs(streams: &str) -> String {
        format!(r#"<dv version="2.0"><node name="outInfo" path="/outInfo/">{streams}</node></dv>"#)
    }

    /// A stream's node.
    pub fn stream(id: i32, name: &str, kind: &str, sensor: Option<Sensor>) -> String {
        let size = sensor.map_or(String::new(), |Sensor { width, height }| {
            format!(
                r#"<attr key="sizeX" type="int">{width}</attr><attr key="sizeY" type="int">{height}</attr>"#
            )
        });
        format!(
            r#"<node name="{id}"><attr key="originalOutputName">{name}</attr>
        <attr key="typeIdentifier">{kind}</attr><node name="info">{size}</node></node>"#
        )
    }

    /// Magic and header.
    pub fn header(compression: i32, xml: &str, table: i64) -> Vec<u8> {
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
    pub fn vector(name: [u8; 4], count: u32, elements: &[u8]) -> Vec<u8> {
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
    pub fn event_packet(events: &[Event]) -> Vec<u8> {
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
    pub fn sample(compression: Compression) -> Vec<u8> {
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
}
