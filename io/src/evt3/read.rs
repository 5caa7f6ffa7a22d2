//! Words in, events out; the layout and the invariants stand in [`super`].

use meissner_engine::{Event, Sensor};

use super::{HIGH_RANGE, SIDE, TIME_BITS, word};
use crate::bytes::{array, units};
use crate::error::{IoError, Place};
use crate::evt2::outside;
use crate::format::Format;
use crate::prophesee::Header;
use crate::recording::{Recording, StreamKind, Tally};

/// Bytes of a word.
const WORD: usize = 2;

/// The events of the file `bytes`.
pub(crate) fn decode(bytes: &[u8], salvage: bool) -> Result<Recording, IoError> {
    let format = Format::Evt3;
    let header = Header::parse(format, bytes)?;
    let sensor = header.sensor(format, SIDE)?;
    let (words, salvaged) = units(format, "the last word", bytes, header.end, WORD, salvage)?;

    let mut decoder = Decoder::new(sensor, words.len());
    for (index, word) in words.enumerate() {
        let word = u16::from_le_bytes(array(word));
        decoder.push(word).map_err(|refusal| refusal.at(header.end + index * WORD, sensor))?;
    }
    let other_streams = [
        decoder.triggers.summary("external triggers", StreamKind::Triggers),
        decoder.vendor.summary("vendor's words", StreamKind::Other),
        decoder.unplaced.summary("before the first time and row", StreamKind::Unplaced),
    ];
    let other_streams = other_streams.into_iter().flatten().collect();
    Ok(Recording { format, sensor, events: decoder.events, other_streams, salvaged })
}

/// Why a word cannot be; small, so that the loop over the words stays small.
enum Refusal {
    Reserved(u16),
    Outside { x: u32, y: u16 },
    VectorWithoutBase,
}

impl Refusal {
    #[cold]
    fn at(self, byte: usize, sensor: Option<Sensor>) -> IoError {
        let (format, place) = (Format::Evt3, Place::Byte(byte as u64));
        let malformed = |what, expected: &str, actual: String| IoError::Malformed {
            format,
            what,
            place,
            expected: expected.to_owned(),
            actual,
        };
        match self {
            Self::Outside { x, y } => {
                outside(format, place, sensor.unwrap_or(Sensor::new(SIDE, SIDE)), x, y.into())
            }
            Self::Reserved(kind) => {
                malformed("type of a word", "0x0, 0x2 to 0x8, 0xa, 0xe or 0xf", format!("{kind:#x}"))
            }
            Self::VectorWithoutBase => {
                malformed("vector of events", "a word of its base column before it", "none".to_owned())
            }
        }
    }
}

/// The state that the words change.
struct Decoder {
    /// One past the last column and row: the sensor's, or what 11 bits can say.
    bounds: Sensor,
    /// Microseconds at the start of the current period of 2^24.
    period_us: i64,
    high: Option<u16>,
    /// The time of the next event.
    t_us: i64,
    y: Option<u16>,
    /// Base column of the next vector, and its polarity.
    base: Option<(u32, bool)>,
    events: Vec<Event>,
    triggers: Tally,
    vendor: Tally,
    unplaced: Tally,
}

impl Decoder {
    /// `words` is how many will come: half of them is a good guess of the events.
    fn new(sensor: Option<Sensor>, words: usize) -> Self {
        Self {
            bounds: sensor.unwrap_or(Sensor::new(SIDE, SIDE)),
            period_us: 0,
            high: None,
            t_us: 0,
            y: None,
            base: None,
            events: Vec::with_capacity(words / 2),
            triggers: Tally::default(),
            vendor: Tally::default(),
            unplaced: Tally::default(),
        }
    }

    #[inline]
    fn push(&mut self, word: u16) -> Result<(), Refusal> {
        let value = word & 0x0fff;
        let (flag, coordinate) = (word & 0x0800 != 0, word & 0x07ff);
        match word >> 12 {
            word::Y => {
                if coordinate >= self.bounds.height {
                    return Err(Refusal::Outside { x: 0, y: coordinate });
                }
                self.y = Some(coordinate);
            }
            word::X => self.pixels(coordinate.into(), 1, flag)?,
            word::BASE => self.base = Some((coordinate.into(), flag)),
            word::VECTOR_12 => self.vector(value, 12)?,
            word::VECTOR_8 => self.vector(value & 0xff, 8)?,
            word::TIME_LOW => self.t_us = self.high_us() + i64::from(value),
            word::TIME_HIGH => self.time_high(value),
            word::TRIGGER => self.triggers.add(1),
            word::VENDOR => self.vendor.add(1),
            word::CONTINUED_4 | word::CONTINUED_12 => {}
            reserved => return Err(Refusal::Reserved(reserved)),
        }
        Ok(())
    }

    fn time_high(&mut self, high: u16) {
        match self.high {
            // Sent again and again while nothing happens: the lower bits still hold.
            Some(newest) if newest == high => return,
            Some(newest) if newest.saturating_sub(high) >= HIGH_RANGE / 2 => {
                self.period_us += i64::from(HIGH_RANGE) << TIME_BITS;
            }
            _ => {}
        }
        self.high = Some(high);
        self.t_us = self.high_us();
    }

    fn high_us(&self) -> i64 {
        self.period_us + (i64::from(self.high.unwrap_or(0)) << TIME_BITS)
    }

    fn vector(&mut self, bits: u16, length: u32) -> Result<(), Refusal> {
        let Some((x, on)) = self.base else {
            return Err(Refusal::VectorWithoutBase);
        };
        self.pixels(x, bits, on)?;
        // A base beyond the sensor is an error only with the next event, so it must stop growing somewhere.
        self.base = Some(((x + length).min(u32::from(u16::MAX)), on));
        Ok(())
    }

    /// An event at `x` + i for every set bit i.
    #[inline]
    fn pixels(&mut self, x: u32, mut bits: u16, on: bool) -> Result<(), Refusal> {
        let (Some(y), Some(_)) = (self.y, self.high) else {
            self.unplaced.add(bits.count_ones().into());
            return Ok(());
        };
        while bits != 0 {
            let x = x + bits.trailing_zeros();
            if x >= u32::from(self.bounds.width) {
                return Err(Refusal::Outside { x, y });
            }
            self.events.push(Event::new(self.t_us, x as u16, y, on));
            bits &= bits - 1;
        }
        Ok(())
    }
}
