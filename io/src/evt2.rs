//! Prophesee EVT 2.0 and 2.1: the bytes of a file to events.
//!
//! After the text header ([`crate::prophesee`]) a file of EVT 2.0 consists of words of 32 bits,
//! least significant byte first:
//!
//! | bits 31-28 | word | bits 27-22 | bits 21-11 | bits 10-0 |
//! |---|---|---|---|---|
//! | 0x0, 0x1 | event, polarity off or on | time, bits 5-0 | x | y |
//! | 0x8 | time, bits 33-6, in bits 27-0 | | | |
//! | 0xA | external trigger | time, bits 5-0 | | |
//! | 0xE, 0xF | vendor's word, and its continuation | | | |
//! | others | reserved, IMU, or values of pictures | | | |
//!
//! A word of EVT 2.1 has 64 bits. Its upper half is a word of EVT 2.0; its lower half is the mask
//! of an event word, which represents an event at x + i for each set bit i. The `GenX320` sends the
//! whole word least significant byte first, so that the mask comes first; the IMX636 and earlier
//! sensors send the upper half first (`endianness` is `legacy`). If the header does not state the
//! order, it is found from the time words.
//!
//! Source: the vendor's pages "EVT 2.0 Format" and "EVT 2.1 Format"; the key `endianness` is that
//! of `OpenEB`. Invariants: words of other types and events outside the sensor are left out and
//! counted, unless the reader is strict; an event's time is the newest time word's plus its own six
//! bits; the 34-bit time wraps if a time word falls by half its range or more, and a smaller fall
//! is a step back.

use meissner_engine::{Event, Sensor};

use crate::bytes::{Bytes, array};
use crate::error::IoError;
use crate::format::Format;
use crate::left_out::{LeftOutKind, PassedOver};
use crate::options::ReadOptions;
use crate::prophesee::{Header, WrappingClock};
use crate::recording::{Recording, Salvage, StreamKind, StreamSummary};
use crate::seek::Records;

/// Bits 31-28 of a time word.
pub(crate) const TIME: u32 = 0x8;
/// Bits of an event's own time.
const LOW_BITS: u32 = 6;
/// Times count from 0 to this value - 1, and wrap.
pub(crate) const TIME_RANGE: i64 = 1 << 34;
/// Coordinates have 11 bits.
const SIDE: u16 = 2048;

/// Number of words from which the order of their halves is found: at most as many as are read from
/// a file to find its header.
const TELLING: usize = 1 << 13;
/// Maximum number of units of 64 us between consecutive time words: 4 s. The masks of events differ
/// by more.
const NEAR: i64 = 1 << 16;

/// Layout of the words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Words {
    /// EVT 2.0.
    Plain,
    /// EVT 2.1, the mask first.
    MaskFirst,
    /// EVT 2.1, the mask last.
    MaskLast,
}

impl Words {
    /// The layout of the words of `format` that the header of `file` states; `None`: it must be
    /// found from the words.
    pub(crate) fn of(header: &Header, file: Bytes<'_>, format: Format) -> Result<Option<Self>, IoError> {
        let is_legacy = header.is_legacy(file)?;
        Ok(match is_legacy {
            _ if format != Format::Evt21 => Some(Self::Plain),
            Some(true) => Some(Self::MaskLast),
            Some(false) => Some(Self::MaskFirst),
            None => None,
        })
    }

    /// Bytes of a word.
    pub(crate) fn stride(self) -> usize {
        if self == Self::Plain { 4 } else { 8 }
    }

    /// The word of EVT 2.0 in `record`, which has [`Self::stride`] bytes, and its mask.
    pub(crate) fn split(self, record: &[u8]) -> (u32, u32) {
        match self {
            Self::Plain => (u32::from_le_bytes(array(record)), 1),
            Self::MaskFirst => halves(array(record), true),
            Self::MaskLast => halves(array(record), false),
        }
    }

    /// The order of the halves of `words` of EVT 2.1: the order in which more time words are close
    /// to the previous one.
    pub(crate) fn found_in(words: &[u8]) -> Self {
        let near = |order: Self| {
            let heads = words.as_chunks::<8>().0.iter().take(TELLING).map(|word| order.split(word).0);
            let times: Vec<u32> = heads.filter(|head| head >> 28 == TIME).collect();
            let is_near = |pair: &&[u32]| (0..NEAR << LOW_BITS).contains(&(time(pair[1]) - time(pair[0])));
            (times.windows(2).filter(is_near).count(), times.len())
        };
        if near(Self::MaskLast) > near(Self::MaskFirst) { Self::MaskLast } else { Self::MaskFirst }
    }
}

/// The content of the header.
pub(crate) struct Layout {
    format: Format,
    sensor: Option<Sensor>,
    /// First byte of the first word.
    start: usize,
    words: Words,
    strict: bool,
}

/// The time of a time word in microseconds.
fn time(word: u32) -> i64 {
    i64::from(word & 0x0fff_ffff) << LOW_BITS
}

/// The word of EVT 2.0 in a word of EVT 2.1, and its mask.
fn halves([a, b, c, d, e, f, g, h]: [u8; 8], mask_first: bool) -> (u32, u32) {
    let (first, last) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
    if mask_first { (last, first) } else { (first, last) }
}

/// The state that the words change, and their events.
#[derive(Debug)]
pub(crate) struct Decoder {
    sensor: Option<Sensor>,
    pub(crate) clock: WrappingClock,
    /// Time of the newest time word in microseconds.
    base_us: Option<i64>,
    pub(crate) events: Vec<Event>,
    triggers: StreamSummary,
    vendor: StreamSummary,
    unplaced: StreamSummary,
    pub(crate) passed: PassedOver,
}

impl Decoder {
    /// The state before the first word, which is read with `clock`.
    pub(crate) fn new(sensor: Option<Sensor>, strict: bool, clock: WrappingClock) -> Self {
        Self {
            sensor,
            clock,
            base_us: None,
            events: Vec::new(),
            triggers: StreamSummary::new("external triggers", StreamKind::Triggers),
            vendor: StreamSummary::new("vendor's words", StreamKind::Other),
            unplaced: StreamSummary::new("before the first time word", StreamKind::Unplaced),
            passed: PassedOver::new(strict),
        }
    }

    /// Takes all of `words`; `split` gives the word of EVT 2.0 in `N` bytes, and its mask. Returns
    /// the part that was cut short.
    #[inline]
    fn push_all<const N: usize>(
        &mut self,
        words: Bytes<'_>,
        salvage: bool,
        split: impl Fn([u8; N]) -> (u32, u32),
    ) -> Result<Option<Salvage>, IoError> {
        let (all, salvaged) = words.records("the last word", 0, salvage)?;
        self.events.reserve(all.len());
        for (word, at) in all.iter().zip((0..).step_by(N)) {
            self.push(words, split(*word), at)?;
        }
        Ok(salvaged)
    }

    /// Takes the `word` of EVT 2.0 at byte `at` of `file`; an event word represents an event in
    /// each column x + i for which bit i of `mask` is set.
    #[inline]
    pub(crate) fn push(
        &mut self,
        file: Bytes<'_>,
        (word, mut mask): (u32, u32),
        at: usize,
    ) -> Result<(), IoError> {
        match word >> 28 {
            polarity @ (0x0 | 0x1) => {
                let (low, x, y) = (i64::from(word >> 22 & 0x3f), (word >> 11 & 0x7ff) as u16, word & 0x7ff);
                let Some(base_us) = self.base_us else {
                    if self.passed.is_strict() {
                        return Err(file.malformed("event", at, "a word of time before it", "none"));
                    }
                    self.unplaced.add(mask.count_ones().into());
                    return Ok(());
                };
                while mask != 0 {
                    let (x, y) = (x + mask.trailing_zeros() as u16, y as u16);
                    if file.is_inside(self.sensor, x, y, at, &mut self.passed)? {
                        self.events.push(Event::new(base_us + low, x, y, polarity == 1));
                    }
                    mask &= mask - 1;
                }
            }
            TIME => self.base_us = Some(self.clock.advance(time(word))),
            0xa => self.triggers.add(1),
            0xe | 0xf => self.vendor.add(1),
            reserved => {
                let expected = "0x0, 0x1, 0x8, 0xa, 0xe or 0xf";
                let error = file.malformed("type of a word", at, expected, format!("{reserved:#x}"));
                self.passed.pass(LeftOutKind::OtherWords, 1, error)?;
            }
        }
        Ok(())
    }

    /// Words may be missing before the next one: events are unplaced until the next time word. The
    /// clock continues, so that a loss of less than 2.3 hours hides no wrap.
    pub(crate) fn resync(&mut self) {
        self.base_us = None;
    }

    /// Time of the newest time word in microseconds, since the last loss.
    pub(crate) fn base_us(&self) -> Option<i64> {
        self.base_us
    }

    /// Number of events without a time so far.
    pub(crate) fn unplaced_events(&self) -> u64 {
        self.unplaced.elements
    }
}

impl Records for Layout {
    const PERIOD: Option<i64> = Some(TIME_RANGE);

    fn open(file: Bytes<'_>, options: ReadOptions) -> Result<Self, IoError> {
        let header = Header::parse(file)?;
        let is_21 = file.format == Format::Evt21.name();
        let format = if is_21 { Format::Evt21 } else { Format::Evt2 };
        let said = Words::of(&header, file, format)?;
        let words = said.unwrap_or_else(|| Words::found_in(&file.data[header.end..]));
        let (sensor, strict) = (header.sensor(file, SIDE)?, options.strict);
        Ok(Self { format, sensor, start: header.end, words, strict })
    }

    fn start(&self) -> usize {
        self.start
    }

    fn stride(&self) -> usize {
        self.words.stride()
    }

    fn clock(&self, record: &[u8]) -> Option<i64> {
        let (word, _) = self.words.split(record);
        (word >> 28 == TIME).then(|| time(word))
    }

    fn decode(&self, words: Bytes<'_>, clock: WrappingClock, salvage: bool) -> Result<Recording, IoError> {
        let mut decoder = Decoder::new(self.sensor, self.strict, clock);
        let salvaged = match self.words {
            Words::Plain => decoder.push_all(words, salvage, |word| (u32::from_le_bytes(word), 1)),
            Words::MaskFirst => decoder.push_all(words, salvage, |word| halves(word, true)),
            Words::MaskLast => decoder.push_all(words, salvage, |word| halves(word, false)),
        }?;
        let Decoder { events, triggers, vendor, unplaced, passed, .. } = decoder;
        let other_streams = StreamSummary::present([triggers, vendor, unplaced]);
        let (left_out, plain) = (passed.end(), Recording::of_events(self.format, self.sensor, events));
        Ok(Recording { other_streams, left_out, salvaged, ..plain })
    }
}
