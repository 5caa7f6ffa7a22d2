//! Event packets of ROS 2 (`event_camera_msgs/msg/EventPacket`): the bytes of a message to events.
//!
//! A node passes the fields of each message directly; no part of ROS is needed here. A file of such
//! messages is MCAP ([`Format::Mcap`](crate::Format::Mcap)).
//!
//! | `encoding` | `events` | time |
//! |---|---|---|
//! | `evt3` | words as in an EVT3 file after its header | in the words, not `time_base` |
//! | `mono` | u64: polarity (1 bit), row (15), column (16), time | nanoseconds after `time_base` |
//! | `libcaer` | u32: column (15 bits), row (15), polarity, one bit; time | us after `time_base` |
//! | `libcaer_cmp` | words of 16 bits, as `word` lists them | us after `time_base` |
//!
//! Source: the readme of `event_camera_msgs`, and the types of `event_camera_codecs`. One decoder
//! takes all messages of a camera, in order, because `evt3` has a state. If messages are lost, it
//! resynchronises.

use meissner_engine::{Event, Sensor};

use crate::bytes::{Bytes, array};
use crate::error::IoError;
use crate::evt3;
use crate::left_out::{LeftOut, LeftOutKind, PassedOver};
use crate::recording::StreamSummary;

const NAME: &str = "event packet";
/// Number of words after which the number of events is compared with its bound.
const WORDS: usize = 4096;

/// Types of a word of `libcaer_cmp`: its four upper bits.
mod word {
    /// Upper 12 bits of the time after the packet's.
    pub(super) const TIME_HIGH: u16 = 0;
    /// Lower 12 bits.
    pub(super) const TIME_LOW: u16 = 1;
    /// Column of the next events.
    pub(super) const COLUMN: u16 = 2;
    /// An event: polarity and row.
    pub(super) const EVENT: u16 = 3;
    /// First row of the next vector, and its polarity.
    pub(super) const BASE: u16 = 4;
    /// Events of 8 rows in a column.
    pub(super) const VECTOR: u16 = 5;
}

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
    /// For every encoding except `evt3`, whose decoder has its own.
    passed: PassedOver,
}

#[derive(Debug)]
enum Encoding {
    Evt3(Box<evt3::Decoder>),
    Mono,
    Libcaer,
    Compressed(Compressed),
}

/// The state that words of `libcaer_cmp` change.
#[derive(Debug, Default)]
struct Compressed {
    /// Upper and lower bits of the time after the packet's, in microseconds.
    high: u64,
    low: u64,
    /// Column of the next events, and whether a word has given it.
    column: u16,
    is_placed: bool,
    /// Row of the newest event, or first row of the newest vector.
    row: u16,
    /// First row of the next vector, and its polarity.
    base: (u16, bool),
}

impl Compressed {
    /// Takes a word; the events of the rows from `row` on, as bits, and their polarity.
    fn take(
        &mut self,
        packet: Bytes<'_>,
        word: u16,
        at: usize,
        passed: &mut PassedOver,
    ) -> Result<Option<(u16, bool)>, IoError> {
        let (value, coordinate, flag) = (word & 0xfff, word & 0x7ff, word & 0x800 != 0);
        let bits = match word >> 12 {
            word::TIME_HIGH => {
                self.high = u64::from(value) << 12;
                return Ok(None);
            }
            word::TIME_LOW => {
                self.low = value.into();
                return Ok(None);
            }
            word::COLUMN => {
                (self.column, self.is_placed) = (coordinate, true);
                return Ok(None);
            }
            word::BASE => {
                self.base = (coordinate, flag);
                return Ok(None);
            }
            word::EVENT => {
                self.row = coordinate;
                (1, flag)
            }
            word::VECTOR => {
                let (first, on) = self.base;
                // A base may lie beyond the sensor, so it must stop growing somewhere.
                self.base.0 = (first + 8).min(1 << 14);
                self.row = first;
                (value & 0xff, on)
            }
            other => {
                let found = format!("{other:#x}");
                let error = packet.malformed("type of a word", at, "0x0 to 0x5", found);
                passed.pass(LeftOutKind::OtherWords, 1, error)?;
                return Ok(None);
            }
        };
        if !self.is_placed {
            let error = packet.malformed("event", at, "a word of its column before it", "none");
            passed.pass(LeftOutKind::Malformed, bits.0.count_ones().into(), error)?;
            return Ok(None);
        }
        Ok(Some(bits))
    }
}

impl EventPackets {
    /// A decoder for the messages' fields `encoding`, and `width` and `height`.
    ///
    /// # Errors
    /// [`IoError::Unsupported`] for another encoding than `evt3`, `mono`, `libcaer` and
    /// `libcaer_cmp`.
    pub fn new(encoding: &str, sensor: Sensor) -> Result<Self, IoError> {
        Self::of(encoding, sensor, false)
    }

    /// As [`Self::new`]; with `strict`, every omitted part is an error.
    pub(crate) fn of(encoding: &str, sensor: Sensor, strict: bool) -> Result<Self, IoError> {
        let encoding = match encoding {
            "evt3" => Encoding::Evt3(Box::new(evt3::Decoder::new(Some(sensor), strict))),
            "mono" => Encoding::Mono,
            "libcaer" => Encoding::Libcaer,
            "libcaer_cmp" => Encoding::Compressed(Compressed::default()),
            other => {
                let expected = "an event packet in evt3, mono, libcaer or libcaer_cmp";
                return Err(IoError::Unsupported { expected, actual: format!("{other:?}") });
            }
        };
        Ok(Self { sensor, encoding, events: Vec::new(), passed: PassedOver::new(strict) })
    }

    /// The events of the next message, in microseconds, from `time_base` (ns) and `events`.
    /// O(bytes).
    ///
    /// # Errors
    /// [`IoError::Truncated`] if the bytes end within an event or a word; no part of the message
    /// is then read. Words and events that a recording would leave out are counted in
    /// [`Self::left_out`].
    pub fn decode(&mut self, time_base: u64, bytes: &[u8]) -> Result<&[Event], IoError> {
        self.events.clear();
        self.append(Bytes::file(NAME, bytes), time_base, usize::MAX)?;
        Ok(&self.events)
    }

    /// Adds the events of `packet` to the existing ones, up to about `most` in total.
    ///
    /// # Errors
    /// Those of [`Self::decode`], and [`IoError::TooLarge`] beyond `most` events.
    pub(crate) fn append(&mut self, packet: Bytes<'_>, time_base: u64, most: usize) -> Result<(), IoError> {
        let Self { sensor, encoding, events, passed } = self;
        let base_us = time_base / 1000;
        match encoding {
            Encoding::Evt3(decoder) => {
                let words = packet.records("the last word", 0, false)?.0;
                std::mem::swap(events, &mut decoder.events);
                let mut read = || {
                    for (block, start) in words.chunks(WORDS).zip((0..).step_by(2 * WORDS)) {
                        for (&word, at) in block.iter().zip((start..).step_by(2)) {
                            decoder.push(packet, u16::from_le_bytes(word), at)?;
                        }
                        check_room(packet, start, &decoder.events, most)?;
                    }
                    Ok(())
                };
                let result = read();
                std::mem::swap(events, &mut decoder.events);
                return result;
            }
            Encoding::Mono => {
                let records = packet.records("the last event", 0, false)?.0;
                events.reserve(records.len());
                for (&record, at) in records.iter().zip((0..).step_by(8)) {
                    let bits = u64::from_le_bytes(record);
                    let (x, y) = ((bits >> 32) as u16, (bits >> 48) as u16 & 0x7fff);
                    if packet.is_inside(Some(*sensor), x, y, at, passed)? {
                        let t_us = time_base.saturating_add(bits & 0xffff_ffff) / 1000;
                        events.push(Event::new(t_us as i64, x, y, bits >> 63 == 1));
                    }
                }
            }
            Encoding::Libcaer => {
                let records: &[[u8; 8]] = packet.records("the last event", 0, false)?.0;
                events.reserve(records.len());
                // The clock has 31 bits, and may wrap within a packet.
                let (mut high, mut newest) = (base_us, 0);
                for (record, at) in records.iter().zip((0..).step_by(8)) {
                    let data = u32::from_le_bytes(array(record));
                    let low = u32::from_le_bytes(array(&record[4..])) & 0x7fff_ffff;
                    if low < newest {
                        high = high.saturating_add(1 << 31);
                    }
                    newest = low;
                    let (x, y) = ((data >> 17) as u16, (data >> 2) as u16 & 0x7fff);
                    if packet.is_inside(Some(*sensor), x, y, at, passed)? {
                        let t_us = high.saturating_add(low.into()) as i64;
                        events.push(Event::new(t_us, x, y, data & 2 != 0));
                    }
                }
            }
            Encoding::Compressed(state) => {
                let words = packet.records("the last word", 0, false)?.0;
                for (block, start) in words.chunks(WORDS).zip((0..).step_by(2 * WORDS)) {
                    for (&word, at) in block.iter().zip((start..).step_by(2)) {
                        let Some((bits, on)) = state.take(packet, u16::from_le_bytes(word), at, passed)?
                        else {
                            continue;
                        };
                        let t_us = base_us.saturating_add(state.high | state.low) as i64;
                        for y in (0..8).filter(|row| bits >> row & 1 == 1).map(|row| state.row + row) {
                            if packet.is_inside(Some(*sensor), state.column, y, at, passed)? {
                                events.push(Event::new(t_us, state.column, y, on));
                            }
                        }
                    }
                    check_room(packet, start, events, most)?;
                }
                (state.high, state.low) = (0, 0);
            }
        }
        check_room(packet, 0, events, most)
    }

    /// Adds an event that was decoded elsewhere, at byte `at` of `packet`, up to `most` in total.
    pub(crate) fn push(
        &mut self,
        packet: Bytes<'_>,
        event: Event,
        at: usize,
        most: usize,
    ) -> Result<(), IoError> {
        if packet.is_inside(Some(self.sensor), event.x, event.y, at, &mut self.passed)? {
            self.events.push(event);
        }
        check_room(packet, at, &self.events, most)
    }

    /// Forgets the events, and returns their number.
    pub(crate) fn clear(&mut self) -> usize {
        let count = self.events.len();
        self.events.clear();
        count
    }

    /// The events, the other streams, and the omitted parts.
    pub(crate) fn into_parts(self) -> (Vec<Event>, Vec<StreamSummary>, Vec<LeftOut>) {
        match self.encoding {
            Encoding::Evt3(decoder) => {
                let (_, others, left_out) = decoder.end();
                (self.events, others, left_out)
            }
            _ => (self.events, Vec::new(), self.passed.end()),
        }
    }

    /// Tells the decoder that messages before the next one were lost. Words of EVT 3.0 apply to the
    /// following words, so events are left out until the sensor has sent time, row and base column
    /// again: no event gets the row or the time of another. A sensor sends its time at least every
    /// 16 us. A loss of more than 8 s can hide a wrap of its clock. In `libcaer_cmp`, events are
    /// left out until the next column.
    pub fn resync(&mut self) {
        match &mut self.encoding {
            Encoding::Evt3(decoder) => decoder.resync(),
            Encoding::Compressed(state) => state.is_placed = false,
            Encoding::Mono | Encoding::Libcaer => {}
        }
    }

    /// Number of events so far that had no time, row or base column: at the start of a stream that
    /// is read from its middle, and after each [`Self::resync`].
    pub fn unplaced(&self) -> u64 {
        match &self.encoding {
            Encoding::Evt3(decoder) => decoder.unplaced_events(),
            _ => 0,
        }
    }

    /// The events of the newest message, as [`Self::decode`] gave them.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// The parts that were left out of all messages so far, by kind. The places count from the
    /// start of each message.
    pub fn left_out(&self) -> &[LeftOut] {
        match &self.encoding {
            Encoding::Evt3(decoder) => decoder.passed.so_far(),
            _ => self.passed.so_far(),
        }
    }
}

/// Refuses more than `most` events.
fn check_room(packet: Bytes<'_>, at: usize, events: &[Event], most: usize) -> Result<(), IoError> {
    if events.len() <= most {
        return Ok(());
    }
    let (format, what, place, unit) = (packet.format, "events so far", packet.place(at), "events");
    let (limit, actual) = (most as u64, events.len() as u64);
    Err(IoError::TooLarge { format, what, place, unit, limit, actual, at_least: true })
}
