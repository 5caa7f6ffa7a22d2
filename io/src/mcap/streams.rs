//! Streams of events in MCAP: decodes the messages of one topic to events, and counts those of the
//! other topics.

use meissner_engine::{Event, Sensor};

use super::cdr::{Cdr, EventPacket};
use super::records::{Container, Content, Message};
use crate::bytes::Bytes;
use crate::error::{IoError, shown};
use crate::format::Format;
use crate::limits::PACKET_BYTES;
use crate::options::{ReadOptions, no_stream};
use crate::recording::{Recording, StreamSummary};
use crate::ros::EventPackets;

/// Bytes of an event in memory.
const EVENT: usize = 16;
/// Maximum number of events per byte: a vector of EVT3.
const DENSEST: usize = 6;

/// The topics so far that have messages.
pub(super) struct Streams {
    /// By index of the topic; `None`: no message yet.
    all: Vec<Option<Stream>>,
    /// Number of topics of events so far, and number of the topic to read, from 1.
    events: usize,
    asked: usize,
    strict: bool,
    /// Maximum number of events of the file.
    most: usize,
}

struct Stream {
    summary: StreamSummary,
    /// Present if the stream contains events.
    packets: Option<Packets>,
}

/// The events of a topic.
struct Packets {
    is_main: bool,
    /// Present from the first message on.
    decoder: Option<(EventPackets, Vec<u8>, Sensor)>,
    /// The number of the newest message.
    seq: Option<u64>,
}

impl Streams {
    /// The state before the first message of a file of `length` bytes.
    pub(super) fn new(options: ReadOptions, length: usize) -> Self {
        let most = (PACKET_BYTES as usize / EVENT).saturating_add(length.saturating_mul(DENSEST));
        let (asked, strict) = (options.stream_number(), options.strict);
        Self { all: Vec::new(), events: 0, asked, strict, most }
    }

    /// Takes a message.
    pub(super) fn take(&mut self, container: &Container, message: &Message<'_>) -> Result<(), IoError> {
        if self.all.len() <= message.topic {
            self.all.resize_with(message.topic + 1, || None);
        }
        let (name, content) = container.topic(message.topic);
        let is_of_events = matches!(content, Content::Packet | Content::EventArray);
        let stream = self.all[message.topic].get_or_insert_with(|| {
            self.events += usize::from(is_of_events);
            let is_main = self.events == self.asked;
            let packets = is_of_events.then_some(Packets { is_main, decoder: None, seq: None });
            Stream { summary: StreamSummary::new(name, content.kind()), packets }
        });
        let Some(packets) = &mut stream.packets else {
            stream.summary.add(1);
            return Ok(());
        };
        let strict = self.strict && packets.is_main;
        let taken = match content {
            Content::EventArray => packets.array(message.data, strict, self.most),
            _ => packets.packet(message.data, strict, self.most),
        };
        if packets.is_main {
            return taken;
        }
        // A fault of another stream does not affect the stream that is read.
        let decoder = packets.decoder.as_mut().map(|(decoder, ..)| decoder);
        stream.summary.add(decoder.map_or(0, |decoder| decoder.clear() as u64));
        Ok(())
    }

    /// The events of the stream that is read, and the other streams.
    pub(super) fn recording(self) -> Result<Recording, IoError> {
        if self.events < self.asked && self.asked > 1 {
            return Err(no_stream(self.asked, self.events));
        }
        let mut recording = Recording::of_events(Format::Mcap, None, Vec::new());
        let mut others = Vec::new();
        for Stream { summary, packets } in self.all.into_iter().flatten() {
            match packets {
                Some(Packets { is_main: true, decoder, .. }) => {
                    if let Some((decoder, _, sensor)) = decoder {
                        let (events, beside, left_out) = decoder.into_parts();
                        others.extend(beside);
                        recording = Recording { sensor: Some(sensor), events, left_out, ..recording };
                    }
                }
                _ => others.push(summary),
            }
        }
        if self.events == 0 && others.iter().any(|stream| stream.packets > 0) {
            let names = others.iter().map(|stream| format!("{} ({})", stream.name, stream.kind));
            let actual = crate::format::beginning(&names.collect::<Vec<_>>().join(", "), 200);
            let expected = "MCAP with a topic of event_camera_msgs/msg/EventPacket, or of EventArray of dvs_msgs, in CDR";
            return Err(IoError::Unsupported { expected, actual });
        }
        Ok(Recording { other_streams: StreamSummary::present(others), ..recording })
    }
}

impl Packets {
    /// Takes an `EventPacket`.
    fn packet(&mut self, message: Bytes<'_>, strict: bool, most: usize) -> Result<(), IoError> {
        let packet = EventPacket::parse(message)?;
        let EventPacket { width, height, encoding, events, .. } = packet;
        let sensor = sensor(message, width, height)?;
        if packet.is_bigendian {
            let (expected, actual) =
                ("event packets with the least significant byte first", "the other order");
            return Err(IoError::Unsupported { expected, actual: actual.to_owned() });
        }
        let newest = self.seq.replace(packet.seq);
        // Some writers leave the number at 0.
        let lost = newest.is_some_and(|seq| ![seq, seq.wrapping_add(1)].contains(&packet.seq));
        let decoder = self.decoder(message, encoding, sensor, strict)?;
        if lost {
            decoder.resync();
        }
        decoder.append(events, packet.time_base, most)
    }

    /// Takes an `EventArray`.
    fn array(&mut self, message: Bytes<'_>, strict: bool, most: usize) -> Result<(), IoError> {
        let mut cdr = Cdr::new(message)?;
        cdr.header()?;
        let (height, width) = (cdr.u32()?, cdr.u32()?);
        let sensor = sensor(message, width, height)?;
        let count = cdr.u32()?;
        let decoder = self.decoder(message, b"mono", sensor, strict)?;
        for _ in 0..count {
            let (x, y) = (cdr.u16()?, cdr.u16()?);
            let at = cdr.place();
            let t_us = i64::from(cdr.i32()?) * 1_000_000 + i64::from(cdr.u32()? / 1000);
            let on = cdr.u8()? != 0;
            decoder.push(cdr.bytes(), Event::new(t_us, x, y, on), at, most)?;
        }
        Ok(())
    }

    /// The decoder, which is created at the first message.
    fn decoder(
        &mut self,
        message: Bytes<'_>,
        encoding: &[u8],
        sensor: Sensor,
        strict: bool,
    ) -> Result<&mut EventPackets, IoError> {
        if self.decoder.is_none() {
            let name = String::from_utf8_lossy(&encoding[..encoding.len().min(40)]);
            let decoder = EventPackets::of(&name, sensor, strict)?;
            self.decoder = Some((decoder, encoding.to_vec(), sensor));
        }
        let (decoder, first, first_sensor) = self.decoder.as_mut().expect("made above");
        if first != encoding {
            let expected = format!("{} as in the first", shown(first));
            return Err(message.malformed("encoding of an event packet", 0, expected, shown(encoding)));
        }
        if *first_sensor != sensor {
            let expected = format!("{first_sensor} as in the first");
            return Err(message.malformed("sensor of an event packet", 0, expected, sensor));
        }
        Ok(decoder)
    }
}

/// The sensor that a message names.
fn sensor(message: Bytes<'_>, width: u32, height: u32) -> Result<Sensor, IoError> {
    match (u16::try_from(width), u16::try_from(height)) {
        (Ok(width @ 1..), Ok(height @ 1..)) => Ok(Sensor::new(width, height)),
        _ => Err(message.malformed("sensor", 0, "1 to 65535 pixels a side", format!("{width}x{height}"))),
    }
}
