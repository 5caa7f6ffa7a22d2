//! Prophesee EVT 2.0: the bytes of a file to events.
//!
//! After the text header ([`crate::prophesee`]) the file consists of words of 32 bits, least
//! significant byte first:
//!
//! | bits 31-28 | word | bits 27-22 | bits 21-11 | bits 10-0 |
//! |---|---|---|---|---|
//! | 0x0, 0x1 | event, polarity off or on | time, bits 5-0 | x | y |
//! | 0x8 | time, bits 33-6, in bits 27-0 | | | |
//! | 0xA | external trigger | time, bits 5-0 | | |
//! | 0xE, 0xF | vendor's word, and its continuation | | | |
//! | others | reserved, IMU, or values of pictures | | | |
//!
//! Source: the vendor's page "EVT 2.0 Format". Invariants: words of other types and events outside
//! the sensor are left out and counted, unless the reader is strict; an event's time is the newest
//! time word's plus its own six bits; the 34-bit time wraps where a time word falls by half its
//! range or more, and a smaller fall is a step back.

use meissner_engine::{Event, Sensor};

use crate::bytes::{Bytes, array};
use crate::error::IoError;
use crate::format::Format;
use crate::left_out::{LeftOutKind, PassedOver};
use crate::options::ReadOptions;
use crate::prophesee::{Header, WrappingClock};
use crate::recording::{Recording, StreamKind, StreamSummary};
use crate::seek::Records;

/// Bytes of a word.
const STRIDE: usize = 4;
/// Bits 31-28 of a time word.
const TIME: u32 = 0x8;
/// Bits of an event's own time.
const LOW_BITS: u32 = 6;
/// Times count from 0 to this value - 1, and wrap.
const TIME_RANGE: i64 = 1 << 34;
/// Coordinates have 11 bits.
const SIDE: u16 = 2048;

/// What the header says.
pub(crate) struct Layout {
    sensor: Option<Sensor>,
    /// First byte of the first word.
    start: usize,
    strict: bool,
}

/// The time of a time word in microseconds.
fn time(word: u32) -> i64 {
    i64::from(word & 0x0fff_ffff) << LOW_BITS
}

impl Records for Layout {
    const PERIOD: Option<i64> = Some(TIME_RANGE);

    fn open(file: Bytes<'_>, options: ReadOptions) -> Result<Self, IoError> {
        let header = Header::parse(file)?;
        Ok(Self { sensor: header.sensor(file, SIDE)?, start: header.end, strict: options.strict })
    }

    fn start(&self) -> usize {
        self.start
    }

    fn stride(&self) -> usize {
        STRIDE
    }

    fn clock(&self, record: &[u8]) -> Option<i64> {
        let word = u32::from_le_bytes(array(record));
        (word >> 28 == TIME).then(|| time(word))
    }

    fn decode(
        &self,
        words: Bytes<'_>,
        mut clock: WrappingClock,
        salvage: bool,
    ) -> Result<Recording, IoError> {
        let sensor = self.sensor;
        let (all, salvaged) = words.records("the last word", 0, salvage)?;
        let mut events = Vec::with_capacity(all.len());
        let mut passed = PassedOver::new(self.strict);
        let mut base_us = None;
        let mut triggers = StreamSummary::new("external triggers", StreamKind::Triggers);
        let mut vendor = StreamSummary::new("vendor's words", StreamKind::Other);
        let mut unplaced = StreamSummary::new("before the first time word", StreamKind::Unplaced);
        for (word, at) in all.iter().zip((0..).step_by(STRIDE)) {
            let word = u32::from_le_bytes(*word);
            match word >> 28 {
                polarity @ (0x0 | 0x1) => {
                    let low = i64::from(word >> 22 & 0x3f);
                    let (x, y) = ((word >> 11 & 0x7ff) as u16, (word & 0x7ff) as u16);
                    match base_us {
                        Some(base_us) => {
                            if words.is_inside(sensor, x, y, at, &mut passed)? {
                                events.push(Event::new(base_us + low, x, y, polarity == 1));
                            }
                        }
                        None if self.strict => {
                            return Err(words.malformed("event", at, "a word of time before it", "none"));
                        }
                        None => unplaced.add(1),
                    }
                }
                TIME => base_us = Some(clock.advance(time(word))),
                0xa => triggers.add(1),
                0xe | 0xf => vendor.add(1),
                reserved => {
                    let expected = "0x0, 0x1, 0x8, 0xa, 0xe or 0xf";
                    let error = words.malformed("type of a word", at, expected, format!("{reserved:#x}"));
                    passed.pass(LeftOutKind::OtherWords, 1, error)?;
                }
            }
        }
        let other_streams = StreamSummary::present([triggers, vendor, unplaced]);
        let (left_out, plain) = (passed.end(), Recording::of_events(Format::Evt2, sensor, events));
        Ok(Recording { other_streams, left_out, salvaged, ..plain })
    }
}
