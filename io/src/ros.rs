//! Event packets of ROS 2 (`event_camera_msgs/msg/EventPacket`): the bytes of a message to events.
//!
//! A node passes on the fields of each message as they come; no part of ROS is needed here.
//!
//! | `encoding` | `events` | time |
//! |---|---|---|
//! | `evt3` | words as in an EVT3 file after its header | in the words, not `time_base` |
//! | `mono` | u64: polarity (1 bit), row (15), column (16), time | nanoseconds after `time_base` |
//!
//! Source: the readme of `event_camera_msgs`. One decoder takes all messages of a camera, in order,
//! since `evt3` has a state. Where some are lost, it resynchronises.

use meissner_engine::{Event, Sensor};

use crate::bytes::Bytes;
use crate::error::IoError;
use crate::evt3;
use crate::left_out::{LeftOut, PassedOver};

const NAME: &str = "event packet";

/// The decoder of one camera's packets.
///
/// ```
/// use meissner_engine::{Event, Sensor};
///
/// let mut packets = meissner_io::EventPackets::new("mono", Sensor::new(640, 480))?;
/// // 2,500 ns after the time base, column 3, row 4, a rise.
/// let event = 1_u64 << 63 | 4 << 48 | 3 << 32 | 2_500;
/// assert_eq!(packets.decode(1_000_000, &event.to_le_bytes())?, [Event::new(1_002, 3, 4, true)]);
/// # Ok::<(), meissner_io::IoError>(())
/// ```
#[derive(Debug)]
pub struct EventPackets {
    sensor: Sensor,
    encoding: Encoding,
    events: Vec<Event>,
    /// Of `mono`; the decoder of EVT 3.0 has its own.
    passed: PassedOver,
}

#[derive(Debug)]
enum Encoding {
    Evt3(Box<evt3::Decoder>),
    Mono,
}

impl EventPackets {
    /// A decoder for the messages' fields `encoding`, and `width` and `height`.
    ///
    /// # Errors
    /// [`IoError::Unsupported`] for an encoding other than `evt3` and `mono`.
    pub fn new(encoding: &str, sensor: Sensor) -> Result<Self, IoError> {
        let encoding = match encoding {
            "evt3" => Encoding::Evt3(Box::new(evt3::Decoder::new(Some(sensor), false))),
            "mono" => Encoding::Mono,
            other => {
                let (expected, actual) = ("an event packet in evt3 or mono", format!("{other:?}"));
                return Err(IoError::Unsupported { expected, actual });
            }
        };
        Ok(Self { sensor, encoding, events: Vec::new(), passed: PassedOver::default() })
    }

    /// The events of the next message, in microseconds, from `time_base` (ns) and `events`.
    /// O(bytes).
    ///
    /// # Errors
    /// [`IoError::Truncated`] where the bytes end within an event or a word; nothing of the message
    /// is then read. Words and events that a recording would leave out are counted in
    /// [`Self::left_out`].
    pub fn decode(&mut self, time_base: u64, bytes: &[u8]) -> Result<&[Event], IoError> {
        self.events.clear();
        let packet = Bytes::file(NAME, bytes);
        match &mut self.encoding {
            Encoding::Evt3(decoder) => {
                let words = packet.records("the last word", 0, false)?.0;
                decoder.events.clear();
                for (&word, at) in words.iter().zip((0..).step_by(2)) {
                    decoder.push(packet, u16::from_le_bytes(word), at)?;
                }
                std::mem::swap(&mut self.events, &mut decoder.events);
            }
            Encoding::Mono => {
                let records = packet.records("the last event", 0, false)?.0;
                self.events.reserve(records.len());
                for (&record, at) in records.iter().zip((0..).step_by(8)) {
                    let bits = u64::from_le_bytes(record);
                    let (x, y) = ((bits >> 32) as u16, (bits >> 48) as u16 & 0x7fff);
                    if !packet.is_inside(Some(self.sensor), x, y, at, &mut self.passed)? {
                        continue;
                    }
                    let t_us = time_base.saturating_add(bits & 0xffff_ffff) / 1000;
                    self.events.push(Event::new(t_us as i64, x, y, bits >> 63 == 1));
                }
            }
        }
        Ok(&self.events)
    }

    /// Messages before the next one were lost. Words of EVT 3.0 hold for those that follow, so that
    /// events are left out until the sensor has sent time, row and base column again: none gets the
    /// row or the time of another. A sensor sends its time every 16 us at the latest. A loss of
    /// more than 8 s can hide a wrap of its clock.
    pub fn resync(&mut self) {
        if let Encoding::Evt3(decoder) = &mut self.encoding {
            decoder.resync();
        }
    }

    /// Events so far that had no time, row or base column: at the start of a stream that was joined
    /// in its middle, and after each [`Self::resync`].
    pub fn unplaced(&self) -> u64 {
        match &self.encoding {
            Encoding::Evt3(decoder) => decoder.unplaced_events(),
            Encoding::Mono => 0,
        }
    }

    /// The events of the newest message, as [`Self::decode`] gave them.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// What was left out of all messages so far, by kind. The places count from the start of each
    /// message.
    pub fn left_out(&self) -> &[LeftOut] {
        match &self.encoding {
            Encoding::Evt3(decoder) => decoder.passed.so_far(),
            Encoding::Mono => self.passed.so_far(),
        }
    }
}
