//! Prophesee EVT 3.0: events from and to words of 16 bits.
//!
//! After the text header ([`crate::prophesee`]) the file consists of words, least significant byte
//! first, that change the state of time, row and column; only changes are sent:
//!
//! | bits 15-12 | word | bits 11-0 |
//! |---|---|---|
//! | 0x0 | row | bit 11: which camera of a pair; 10-0: y |
//! | 0x1 | row of events of an external system (EM) | 10-0: y |
//! | 0x2 | event at this column | bit 11: polarity; 10-0: x |
//! | 0x3 | base column of the vectors that follow | bit 11: their polarity; 10-0: x |
//! | 0x4 | 12 pixels: an event at base + i where bit i is set; the base advances by 12 | bits |
//! | 0x5 | 8 pixels, likewise; the base advances by 8 | 7-0: bits |
//! | 0x6 | time, bits 11-0 | microseconds |
//! | 0x8 | time, bits 23-12 | 4096 microseconds |
//! | 0xA | external trigger | 11-8: channel; 0: edge |
//! | 0xE, 0x7, 0xF | vendor's word, and its continuations | |
//! | 0x9, 0xB, 0xC, 0xD | reserved, padding of other makers, or IMU | |
//!
//! Source: the vendor's page "EVT 3.0 Format", and for 0x1 and 0xD the header `evt3_event_types.h`
//! of `OpenEB`. Invariants:
//!
//! - Odd data do not end the reading unless it is strict: reserved words, events outside the sensor
//!   and events of a row of kind 0x1 are left out and counted. Events before the first words of
//!   time, row and (in a vector) base column are unplaced: a stream may be cut anywhere.
//! - The 24-bit time wraps only if word 0x8 falls by half its range or more. Within word 0x6, a
//!   fall is a step back: sensors under load fall by microseconds. Word 0x8 from just after a wrap
//!   to just before it, then 0x6, steps back over the wrap ([`WrappingClock`]).
//! - A change of word 0x8 clears the lower bits until the next word 0x6.
//! - Only single events (word 0x2) are written: vectors would reorder the events of a row. A
//!   silence of a whole period of 2^24 microseconds is written as the two time words of a wrap; one
//!   above half a period has a time word in its middle, so that times are absolute.

use std::io::{self, Write};

use meissner_engine::{Event, Sensor};

use crate::bytes::Bytes;
use crate::error::IoError;
use crate::format::Format;
use crate::left_out::{LeftOut, LeftOutKind, PassedOver};
use crate::options::ReadOptions;
use crate::prophesee::{Header, WrappingClock};
use crate::recording::{Capacity, Recording, StreamKind, StreamSummary};
use crate::seek::DISORDER_US;

/// Coordinates have 11 bits.
pub(crate) const SIDE: u16 = 2048;
/// Bits of the time in each of its two words.
const TIME_BITS: u32 = 12;
/// The upper word counts from 0 to this value - 1, and wraps.
const HIGH_RANGE: u16 = 1 << TIME_BITS;

/// Bits 15-12 of the words.
pub(crate) mod word {
    pub(crate) const Y: u16 = 0x0;
    pub(crate) const OTHER_Y: u16 = 0x1;
    pub(crate) const X: u16 = 0x2;
    pub(crate) const BASE: u16 = 0x3;
    pub(crate) const VECTOR_12: u16 = 0x4;
    pub(crate) const VECTOR_8: u16 = 0x5;
    pub(crate) const TIME_LOW: u16 = 0x6;
    pub(crate) const CONTINUED_4: u16 = 0x7;
    pub(crate) const TIME_HIGH: u16 = 0x8;
    pub(crate) const TRIGGER: u16 = 0xa;
    pub(crate) const VENDOR: u16 = 0xe;
    pub(crate) const CONTINUED_12: u16 = 0xf;
}

/// The events of the file `bytes`.
pub(crate) fn decode(bytes: &[u8], options: ReadOptions) -> Result<Recording, IoError> {
    let format = Format::Evt3;
    let file = Bytes::file(format.name(), bytes);
    let header = Header::parse(file)?;
    let sensor = header.sensor(file, SIDE)?;
    let (words, salvaged) = file.records("the last word", header.end, options.salvage)?;

    let mut decoder = Decoder::new(sensor, options.strict);
    // Usually there are about half as many events as words.
    decoder.events.reserve(words.len() / 2);
    for (word, at) in words.iter().zip((header.end..).step_by(2)) {
        decoder.push(file, u16::from_le_bytes(*word), at)?;
    }
    let (events, other_streams, left_out) = decoder.end();
    Ok(Recording { other_streams, left_out, salvaged, ..Recording::of_events(format, sensor, events) })
}

/// The row of the next events.
#[derive(Clone, Copy, Debug)]
enum Row {
    /// No row was named yet.
    Unknown,
    /// A row of the sensor.
    At(u16),
    /// A row outside the sensor.
    Outside(u16),
    /// A row of an external system.
    Other,
}

/// The state that the words change, and their events.
#[derive(Debug)]
pub(crate) struct Decoder {
    /// The sensor, or the range of 11 bits.
    bounds: Sensor,
    pub(crate) clock: WrappingClock,
    /// The newest word 0x8, and its time in microseconds.
    high: Option<(u16, i64)>,
    /// Whether no word 0x6 has followed it.
    is_bare: bool,
    /// Whether words were lost, and both words of time have not arrived since.
    is_lost: bool,
    /// The time of the next event.
    t_us: i64,
    row: Row,
    /// Base column of the next vector, and its polarity.
    base: Option<(u32, bool)>,
    pub(crate) events: Vec<Event>,
    triggers: StreamSummary,
    vendor: StreamSummary,
    unplaced: StreamSummary,
    pub(crate) passed: PassedOver,
}

impl Decoder {
    /// The state before the first word of this sensor, or of the largest possible sensor.
    pub(crate) fn new(sensor: Option<Sensor>, strict: bool) -> Self {
        Self {
            bounds: sensor.unwrap_or(Sensor::new(SIDE, SIDE)),
            clock: WrappingClock::new(HIGH_RANGE.into()).stepping_back(DISORDER_US >> TIME_BITS),
            high: None,
            is_bare: false,
            is_lost: false,
            t_us: 0,
            row: Row::Unknown,
            base: None,
            events: Vec::new(),
            triggers: StreamSummary::new("external triggers", StreamKind::Triggers),
            vendor: StreamSummary::new("vendor's words", StreamKind::Other),
            unplaced: StreamSummary::new("before the first time and row", StreamKind::Unplaced),
            passed: PassedOver::new(strict),
        }
    }

    /// Words may be missing: events are unplaced until time, row and (in a vector) base column have
    /// arrived again. The clock continues: a loss of less than 8 s hides no wrap.
    pub(crate) fn resync(&mut self) {
        (self.high, self.is_bare, self.is_lost) = (None, false, true);
        (self.row, self.base) = (Row::Unknown, None);
    }

    /// The time of the next event in microseconds; `None` before both words of time.
    pub(crate) fn time_us(&self) -> Option<i64> {
        (self.high.is_some() && !self.is_bare && !self.is_lost).then_some(self.t_us)
    }

    /// Number of events without a time, a row or a base column so far.
    pub(crate) fn unplaced_events(&self) -> u64 {
        self.unplaced.elements
    }

    /// The events, the other streams, and the omitted parts.
    pub(crate) fn end(self) -> (Vec<Event>, Vec<StreamSummary>, Vec<LeftOut>) {
        let Self { events, triggers, vendor, unplaced, passed, .. } = self;
        (events, StreamSummary::present([triggers, vendor, unplaced]), passed.end())
    }

    /// Takes the word at byte `at` of `file`.
    #[inline]
    pub(crate) fn push(&mut self, file: Bytes<'_>, word: u16, at: usize) -> Result<(), IoError> {
        let value = word & 0x0fff;
        let (flag, coordinate) = (word & 0x0800 != 0, word & 0x07ff);
        match word >> 12 {
            word::Y if coordinate < self.bounds.height => self.row = Row::At(coordinate),
            word::Y => self.row = Row::Outside(coordinate),
            word::OTHER_Y => self.row = Row::Other,
            word::X => self.pixels(file, coordinate.into(), 1, flag, at)?,
            word::BASE => self.base = Some((coordinate.into(), flag)),
            word::VECTOR_12 => self.vector(file, value, 12, at)?,
            word::VECTOR_8 => self.vector(file, value & 0xff, 8, at)?,
            word::TIME_LOW => {
                self.is_bare = false;
                self.is_lost &= self.high.is_none();
                self.t_us = self.high.map_or(0, |(_, us)| us) + i64::from(value);
            }
            word::TIME_HIGH => self.time_high(value),
            word::TRIGGER => self.triggers.add(1),
            word::VENDOR => self.vendor.add(1),
            word::CONTINUED_4 | word::CONTINUED_12 => {}
            reserved => {
                let expected = "0x0 to 0x8, 0xa, 0xe or 0xf";
                let error = file.malformed("type of a word", at, expected, format!("{reserved:#x}"));
                self.passed.pass(LeftOutKind::OtherWords, 1, error)?;
            }
        }
        Ok(())
    }

    fn time_high(&mut self, high: u16) {
        // The word is repeated while nothing happens: then the lower bits are still valid.
        if self.high.is_none_or(|(newest, _)| newest != high) {
            if self.is_bare {
                // The words of a silence of whole periods follow each other directly.
                self.clock.take_for_forward();
            }
            self.t_us = self.clock.advance(high.into()) << TIME_BITS;
            self.high = Some((high, self.t_us));
            self.is_bare = true;
        }
    }

    fn vector(&mut self, file: Bytes<'_>, bits: u16, length: u32, at: usize) -> Result<(), IoError> {
        let Some((x, on)) = self.base else {
            return self.unplaced(file, bits.count_ones(), "a word of its base column before it", at);
        };
        self.pixels(file, x, bits, on, at)?;
        // A base may lie beyond the sensor until the next event, so it must stop growing somewhere.
        self.base = Some(((x + length).min(u32::from(u16::MAX)), on));
        Ok(())
    }

    /// An event at `x` + i for every set bit i.
    #[inline]
    fn pixels(&mut self, file: Bytes<'_>, x: u32, mut bits: u16, on: bool, at: usize) -> Result<(), IoError> {
        let is_timed = self.high.is_some() && !self.is_lost;
        let y = match self.row {
            Row::At(y) if is_timed => y,
            Row::Outside(_) | Row::Other if is_timed => return self.beside(file, x, (bits, self.row), at),
            _ => return self.unplaced(file, bits.count_ones(), "words of time and row before it", at),
        };
        while bits != 0 {
            let column = x + bits.trailing_zeros();
            if column >= u32::from(self.bounds.width) {
                return self.beside(file, x, (bits, Row::Outside(y)), at);
            }
            self.events.push(Event::new(self.t_us, column as u16, y, on));
            bits &= bits - 1;
        }
        Ok(())
    }

    /// Leaves out the events at `x` + i for every set bit i, which are outside the sensor's rows or
    /// columns, or in a row of another system.
    #[cold]
    fn beside(&mut self, file: Bytes<'_>, x: u32, (bits, row): (u16, Row), at: usize) -> Result<(), IoError> {
        if bits == 0 {
            return Ok(());
        }
        let (kind, error) = if let Row::Outside(y) = row {
            let x = x + bits.trailing_zeros();
            (LeftOutKind::OutsideSensor, file.outside(self.bounds, x, y, at))
        } else {
            let (expected, actual) = ("a row of this sensor (word 0x0)", "one of another system (word 0x1)");
            (LeftOutKind::OtherEvents, file.malformed("row of an event", at, expected, actual))
        };
        self.passed.pass(kind, bits.count_ones().into(), error)
    }

    /// Counts events whose time or pixel is not known yet.
    #[cold]
    fn unplaced(&mut self, file: Bytes<'_>, count: u32, expected: &str, at: usize) -> Result<(), IoError> {
        match count {
            0 => {}
            _ if self.passed.is_strict() => return Err(file.malformed("event", at, expected, "none")),
            _ => self.unplaced.add(count.into()),
        }
        Ok(())
    }
}

/// Latest time that is written: 12.7 days; such a file starts with 256 KiB of wraps.
const LATEST_US: i64 = (1 << 40) - 1;

/// The events that the format can hold.
pub(crate) const CAPACITY: Capacity = Capacity {
    times: 0..=LATEST_US,
    side: SIDE as u32,
    sensor: "a sensor of 1 to 2048 pixels a side",
    steps: "in order, or less than 2^23 us earlier in the same 2^24 us",
    is_wrap: |newest_us, t_us| {
        let same_period = newest_us >> (2 * TIME_BITS) == t_us >> (2 * TIME_BITS);
        let fall = (newest_us >> TIME_BITS) - (t_us >> TIME_BITS);
        t_us < newest_us && (!same_period || fall >= i64::from(HIGH_RANGE / 2))
    },
};

/// Writes the header and the words of `events`, which [`CAPACITY`] allows.
pub(crate) fn encode(sensor: Option<Sensor>, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "% evt 3.0")?;
    match sensor {
        Some(Sensor { width, height }) => {
            writeln!(out, "% format EVT3;height={height};width={width}\n% geometry {width}x{height}")?;
        }
        None => writeln!(out, "% format EVT3")?,
    }
    writeln!(out, "% end")?;
    let mut state = Written::default();
    for event in events {
        state.write(event, out)?;
    }
    Ok(())
}

/// The state of a reader after the words written so far.
#[derive(Default)]
struct Written {
    period: i64,
    high: Option<u16>,
    low: Option<u16>,
    y: Option<u16>,
}

impl Written {
    fn write(&mut self, event: &Event, out: &mut impl Write) -> io::Result<()> {
        while self.period < event.t_us >> (2 * TIME_BITS) {
            self.write_high(HIGH_RANGE - 1, out)?;
            self.write_high(0, out)?;
            self.period += 1;
        }
        let high = (event.t_us >> TIME_BITS) as u16 & (HIGH_RANGE - 1);
        if let Some(before) = self.high.filter(|before| high > before + HIGH_RANGE / 2) {
            // A longer rise could be a step back over a wrap.
            self.write_high(before + HIGH_RANGE / 2, out)?;
        }
        self.write_high(high, out)?;
        put_change(&mut self.low, word::TIME_LOW, event.t_us as u16 & (HIGH_RANGE - 1), out)?;
        put_change(&mut self.y, word::Y, event.y, out)?;
        put(word::X, event.x | u16::from(event.on) << 11, out)
    }

    fn write_high(&mut self, high: u16, out: &mut impl Write) -> io::Result<()> {
        if self.high != Some(high) {
            // Some readers keep the lower bits after this word, so they are written again.
            self.low = None;
        }
        put_change(&mut self.high, word::TIME_HIGH, high, out)
    }
}

/// Writes a word if its value is not the `newest` one.
fn put_change(newest: &mut Option<u16>, kind: u16, value: u16, out: &mut impl Write) -> io::Result<()> {
    if newest.replace(value) == Some(value) { Ok(()) } else { put(kind, value, out) }
}

fn put(kind: u16, value: u16, out: &mut impl Write) -> io::Result<()> {
    out.write_all(&(kind << 12 | value).to_le_bytes())
}
