//! Bytes of Prophesee's sensors from a driver: EVT2, EVT2.1 and EVT3 from a pipe, a socket or in
//! datagrams, with or without a text header, from the start or from the middle of the stream.
//!
//! If a byte is lost, the words after it are out of step, and their apparent events are wrong. So
//! an event is held until later words show that its word was in step: the time of the sensor, which
//! is sent every 16 us, has advanced twice, or [`HELD`] words have arrived. A word of a reserved
//! type, or of an event outside the sensor, is odd. If two odd words are near each other, the words
//! of every other step are tried. If the words of one step are not odd, bytes were lost between the
//! last odd word of that step and the first odd word of the old one. The exact position is unknown,
//! so the events of these words are left out. Otherwise only the odd words are left out.
//!
//! These formats do not show a loss that leaves the other words in step, such as a lost datagram.

use std::cmp::Reverse;
use std::collections::VecDeque;
use std::io::BufRead;

use meissner_engine::{Event, Sensor};

use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::evt2::{self, Words};
use crate::evt3::{self, word};
use crate::format::Format;
use crate::prophesee::{Header, WrappingClock, has_header};

/// Number of words within which two odd words are suspect.
const NEAR: usize = 64;
/// Number of words from the first odd word on that must not be odd in the right step.
const TRIED: usize = 64;
/// Number of words after which an event is delivered if the sensor sends no time.
const HELD: usize = 256;
/// Longest advance of the time, in microseconds, that shows that words are in step.
const ADVANCE_US: i64 = 128;
/// Maximum bytes of a text header.
const HEADER_BYTES: usize = 1 << 16;
/// Number of bytes from which the order of the halves of EVT2.1 is found if no header states it.
const TELLING: usize = 1 << 12;

/// The kind of a word, without the words before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// A word of a reserved type, or of an event outside the sensor.
    Odd,
    /// A time word.
    Time,
    Other,
}

/// Words of one format, and the events in them.
#[derive(Debug)]
enum Decoder {
    Evt2(evt2::Decoder, Words),
    Evt3(evt3::Decoder),
}

impl Decoder {
    fn new(format: Format, sensor: Option<Sensor>, words: Words) -> Self {
        if format == Format::Evt3 {
            return Self::Evt3(evt3::Decoder::new(sensor, false));
        }
        let clock = WrappingClock::new(evt2::TIME_RANGE);
        Self::Evt2(evt2::Decoder::new(sensor, false, clock), words)
    }

    /// Bytes of a word.
    fn stride(&self) -> usize {
        match self {
            Self::Evt2(_, words) => words.stride(),
            Self::Evt3(_) => 2,
        }
    }

    fn kind(&self, bytes: &[u8], sensor: Sensor) -> Kind {
        let is_on = |x: u32, y: u32| x < sensor.width.into() && y < sensor.height.into();
        let is_fine = match self {
            Self::Evt2(_, words) => {
                let (head, mask) = words.split(bytes);
                match head >> 28 {
                    // The event in the last column, if there is one.
                    0x0 | 0x1 => mask != 0 && is_on((head >> 11 & 0x7ff) + mask.ilog2(), head & 0x7ff),
                    evt2::TIME => return Kind::Time,
                    other => matches!(other, 0xa | 0xe | 0xf),
                }
            }
            Self::Evt3(_) => {
                let found = u16::from_le_bytes([bytes[0], bytes[1]]);
                match found >> 12 {
                    word::Y => is_on(0, (found & 0x7ff).into()),
                    word::X | word::BASE => is_on((found & 0x7ff).into(), 0),
                    word::TIME_LOW | word::TIME_HIGH => return Kind::Time,
                    other => !matches!(other, word::OTHER_Y | 0x9 | 0xb | 0xc | 0xd),
                }
            }
        };
        if is_fine { Kind::Other } else { Kind::Odd }
    }

    /// Takes a word.
    fn push(&mut self, file: Bytes<'_>, bytes: &[u8], at: u64) -> Result<(), IoError> {
        match self {
            Self::Evt2(decoder, words) => decoder.push(file, words.split(bytes), at as usize),
            Self::Evt3(decoder) => decoder.push(file, u16::from_le_bytes([bytes[0], bytes[1]]), at as usize),
        }
    }

    /// The newest time in microseconds; in EVT3 without the lower bits if only the upper are known.
    fn time_us(&self) -> Option<i64> {
        match self {
            Self::Evt2(decoder, _) => decoder.base_us(),
            Self::Evt3(decoder) => decoder.time_us(),
        }
    }

    fn clock(&mut self) -> &mut WrappingClock {
        match self {
            Self::Evt2(decoder, _) => &mut decoder.clock,
            Self::Evt3(decoder) => &mut decoder.clock,
        }
    }

    /// Continues after words were lost, with the clock before the loss.
    fn resync(&mut self, clock: Option<WrappingClock>) {
        *self.clock() = clock.unwrap_or(*self.clock());
        match self {
            Self::Evt2(decoder, _) => decoder.resync(),
            Self::Evt3(decoder) => decoder.resync(),
        }
    }

    fn events(&mut self) -> &mut Vec<Event> {
        match self {
            Self::Evt2(decoder, _) => &mut decoder.events,
            Self::Evt3(decoder) => &mut decoder.events,
        }
    }

    /// Number of events without time, row or base column so far.
    fn unplaced(&self) -> u64 {
        match self {
            Self::Evt2(decoder, _) => decoder.unplaced_events(),
            Self::Evt3(decoder) => decoder.unplaced_events(),
        }
    }
}

/// An odd word.
#[derive(Clone, Copy, Debug)]
struct Odd {
    at: u64,
    word: u64,
}

/// A loss that is not reported yet.
#[derive(Clone, Copy, Debug)]
struct Loss {
    /// Place where it was detected.
    at: u64,
    /// Events that were left out because their words may have been out of step.
    events: u64,
    /// Number of unplaced events before it.
    unplaced: u64,
}

/// Events of raw bytes as they arrive.
///
/// Lost bytes give an [`IoError::Lost`], other odd words an [`IoError::Word`], and the next call
/// continues after it.
#[derive(Debug)]
pub(crate) struct RawEvents<R> {
    input: R,
    /// Known after the first call of `next` if a header states it.
    pub(crate) format: Format,
    /// The requested sensor, or the sensor that the header names.
    pub(crate) sensor: Option<Sensor>,
    /// `None` before the first word.
    decoder: Option<Decoder>,
    /// The newest bytes, the position of the first, and the index of the next word.
    bytes: Vec<u8>,
    start: u64,
    next: usize,
    /// The newest odd word, unless it has been left out.
    odd: Option<Odd>,
    /// The end of the newest time word that advanced.
    advanced: u64,
    /// The end of the words that are known to have been in step.
    sure: u64,
    /// For odd words before this position, only the words themselves are left out.
    tried: u64,
    /// Events with the positions of their words.
    held: VecDeque<(u64, Event)>,
    /// The clock after time words, with their positions: the newest time word known to be in step,
    /// and the words since.
    clocks: VecDeque<(u64, WrappingClock)>,
    /// The newest time, and the number of its advances.
    time_us: Option<i64>,
    advances: u8,
    loss: Option<Loss>,
    ready: VecDeque<Result<Event, IoError>>,
    ended: bool,
}

impl<R: BufRead> RawEvents<R> {
    /// The events of `input` in `format`, which is EVT2, EVT2.1 or EVT3 unless a header states
    /// another of these. Events outside `sensor`, or outside the sensor of a header, are odd.
    /// Nothing is read before the first call of `next`.
    pub(crate) fn new(input: R, format: Format, sensor: Option<Sensor>) -> Self {
        Self {
            input,
            format,
            sensor,
            decoder: None,
            bytes: Vec::new(),
            start: 0,
            next: 0,
            odd: None,
            advanced: 0,
            sure: 0,
            tried: 0,
            held: VecDeque::new(),
            clocks: VecDeque::new(),
            time_us: None,
            advances: 0,
            loss: None,
            ready: VecDeque::new(),
            ended: false,
        }
    }

    /// The sensor, or the range of the coordinates.
    fn bounds(&self) -> Sensor {
        self.sensor.unwrap_or(Sensor::new(evt3::SIDE, evt3::SIDE))
    }

    /// The position of the next word.
    fn at(&self) -> u64 {
        self.start + self.next as u64
    }

    /// Reads more bytes, if the stream has not ended.
    fn read(&mut self) -> Result<(), IoError> {
        let place = Place::Byte(self.start + self.bytes.len() as u64);
        let format = self.format.name();
        let read = self.input.fill_buf();
        let read = read.map_err(|source| IoError::Stream { format, action: "read", place, source })?;
        let length = read.len();
        self.bytes.extend_from_slice(read);
        self.input.consume(length);
        self.ended = length == 0;
        Ok(())
    }

    /// The decoder, once the header, the order of the halves of EVT2.1 and the step are known.
    fn begin(&mut self) -> Result<Option<Decoder>, IoError> {
        let file = Bytes::file(self.format.name(), &self.bytes);
        let header = Header::scan(&self.bytes);
        let rest = &self.bytes[header.end..];
        let may_go_on = !header.has_ended() && (rest.len() < 2 || has_header(rest));
        if may_go_on && !self.ended && self.bytes.len() < HEADER_BYTES {
            return Ok(None);
        }
        let format = match header.encoding() {
            Some(Ok(format @ (Format::Evt2 | Format::Evt21 | Format::Evt3))) => format,
            _ => self.format,
        };
        let words = match Words::of(&header, file, format)? {
            Some(words) => words,
            None if rest.len() < TELLING && !self.ended => return Ok(None),
            None => Words::found_in(&rest[..rest.len().min(TELLING)]),
        };
        let named = header.sensor(file, evt3::SIDE)?;
        let sensor = self.sensor.or(named);
        let decoder = Decoder::new(format, sensor, words);
        if rest.len() < (TRIED + 3) * decoder.stride() && !self.ended {
            return Ok(None);
        }
        let start = header.end;
        (self.sensor, self.format, self.next) = (sensor, format, start);
        // A stream that is read from its middle may begin within a word.
        if start == 0 && self.tries(&decoder, 0, 0).odd > 0 {
            self.next = self.step(&decoder, 0).map_or(0, |step| step.next);
        }
        Ok(Some(decoder))
    }

    /// Decodes the bytes so far, as far as words are known to be in step.
    fn decode(&mut self, decoder: &mut Decoder) -> Result<(), IoError> {
        let (stride, bounds) = (decoder.stride(), self.bounds());
        let before = |at: u64| at.saturating_sub((HELD * stride) as u64);
        while let Some(word) = self.bytes.get(self.next..self.next + stride) {
            let at = self.at();
            let kind = decoder.kind(word, bounds);
            if kind == Kind::Odd {
                let word = word.iter().rev().fold(0, |all, &byte| all << 8 | u64::from(byte));
                let odd = Odd { at, word };
                let before = self.odd.filter(|before| at - before.at <= (NEAR * stride) as u64);
                // A repeated word is padding.
                if let Some(before) = before.filter(|before| before.word != odd.word && at >= self.tried) {
                    let first = (before.at - self.start) as usize;
                    if self.bytes.len() < first + (TRIED + 3) * stride && !self.ended {
                        return Ok(());
                    }
                    if let Some(step) = self.step(decoder, first) {
                        self.lose(decoder, &step);
                        continue;
                    }
                    self.tried = before.at + (TRIED * stride) as u64;
                }
                self.pass_over();
                self.odd = Some(odd);
            }
            decoder.push(
                Bytes::file(self.format.name(), &[]),
                &self.bytes[self.next..self.next + stride],
                at,
            )?;
            self.held.extend(decoder.events().drain(..).map(|event| (at, event)));
            self.next += stride;
            if kind == Kind::Time {
                self.clocks.push_back((at, *decoder.clock()));
            }
            if kind == Kind::Time && self.has_advanced(decoder.time_us()) {
                // The newest of the time words may itself be out of step.
                let end = self.at();
                let sure = std::mem::replace(&mut self.advanced, end);
                if self.odd.is_some_and(|odd| odd.at < sure) {
                    self.pass_over();
                }
                // As long as time words do not confirm an odd word, they do not confirm earlier
                // words either.
                if self.odd.is_none() {
                    self.sure = sure;
                    self.give(sure, decoder);
                }
            }
            // After each word, so that the division of the bytes into pieces changes nothing.
            if self.odd.is_some_and(|odd| odd.at < before(self.at())) {
                self.pass_over();
            }
            // An odd word is tried with the words before it. Padding must not hold events forever.
            let old = before(self.odd.map_or(self.at(), |odd| odd.at));
            if self.held.front().is_some_and(|&(at, _)| at < old) {
                self.give(old, decoder);
            }
        }
        // The words before an odd one are tried in other steps.
        let kept = self.next.saturating_sub(2 * HELD * stride) / stride * stride;
        if kept > 4 * HELD * stride {
            self.bytes.drain(..kept);
            (self.start, self.next) = (self.start + kept as u64, self.next - kept);
        }
        Ok(())
    }

    /// Whether the time has advanced twice, to `time_us`.
    fn has_advanced(&mut self, time_us: Option<i64>) -> bool {
        let (Some(now), before) = (time_us, std::mem::replace(&mut self.time_us, time_us)) else {
            return false;
        };
        match before.map(|before| now - before) {
            Some(0) => return false,
            Some(1..=ADVANCE_US) => self.advances = self.advances.saturating_add(1),
            _ => self.advances = 0,
        }
        if self.advances < 2 {
            self.advanced = self.at();
        }
        self.advances >= 2
    }

    /// The newest odd word was in step: only this word is left out.
    fn pass_over(&mut self) {
        if let Some(Odd { at, word }) = self.odd.take() {
            let (format, place) = (self.format.name(), Place::Byte(at));
            self.ready.push_back(Err(IoError::Word { format, place, word }));
        }
    }

    /// The words from index `first` + `shift` on, and the words before them in the same step.
    fn tries(&self, decoder: &Decoder, first: usize, shift: usize) -> Step {
        let (stride, next) = (decoder.stride(), first + shift);
        let bounds = self.bounds();
        let kind = |at: usize| self.bytes.get(at..at + stride).map(|word| decoder.kind(word, bounds));
        let kinds = (0..TRIED).map_while(|i| kind(next + i * stride));
        let (odd, times) = kinds.fold((0, 0), |(odd, times), kind| {
            (odd + usize::from(kind == Kind::Odd), times + usize::from(kind == Kind::Time))
        });
        let before = (1..=HELD).map_while(|i| next.checked_sub(i * stride));
        let clean = before.take_while(|&at| kind(at) != Some(Kind::Odd)).last().unwrap_or(next);
        Step { first, next, odd, times, clean }
    }

    /// The step in which words are not odd soon after index `first`; `None`: only in the current
    /// one. The first odd word may contain the end of a correct word.
    fn step(&self, decoder: &Decoder, first: usize) -> Option<Step> {
        let stride = decoder.stride();
        let shifts = (1..3 * stride).filter(|shift| !shift.is_multiple_of(stride));
        let steps = shifts.map(|shift| self.tries(decoder, first, shift)).filter(|step| step.odd == 0);
        steps.max_by_key(|step| (step.times, Reverse((step.clean, step.next))))
    }

    /// Continues in another step, and leaves out the events of words that may have been out of
    /// step.
    #[cold]
    fn lose(&mut self, decoder: &mut Decoder, step: &Step) {
        let sure = self.sure.max(self.start + step.clean as u64);
        let stride = decoder.stride() as u64;
        let right = self.held.partition_point(|&(at, _)| at + stride <= sure);
        let events = (self.held.len() - right) as u64;
        self.held.truncate(right);
        let known = self.clocks.partition_point(|&(at, _)| at + stride <= sure);
        let clock = known.checked_sub(1).map(|last| self.clocks[last].1);
        self.clocks.clear();
        self.give(u64::MAX, decoder);
        if let Some(former) = self.loss.take() {
            self.tell(former, decoder);
        }
        let (at, unplaced) = (self.start + step.first as u64, decoder.unplaced());
        self.loss = Some(Loss { at, events, unplaced });
        (self.next, self.odd) = (step.next, None);
        (self.time_us, self.advances) = (None, 0);
        decoder.resync(clock);
        self.clocks.push_back((self.start, *decoder.clock()));
    }

    /// Delivers the events of words before the position `end`, and reports the loss before them.
    fn give(&mut self, end: u64, decoder: &Decoder) {
        while let Some((_, event)) = self.held.pop_front_if(|&mut (at, _)| at < end) {
            if let Some(loss) = self.loss.take() {
                self.tell(loss, decoder);
            }
            self.ready.push_back(Ok(event));
        }
        let known = self.clocks.partition_point(|&(at, _)| at < end);
        self.clocks.drain(..known.saturating_sub(1));
    }

    fn tell(&mut self, loss: Loss, decoder: &Decoder) {
        let events = loss.events + decoder.unplaced() - loss.unplaced;
        let (format, place) = (self.format.name(), Place::Byte(loss.at));
        self.ready.push_back(Err(IoError::Lost { format, place, events }));
    }

    /// Reads and decodes more; at the end, held events are delivered, because no later word can
    /// show that they are wrong.
    fn advance(&mut self) -> Result<(), IoError> {
        self.read()?;
        let mut decoder = match self.decoder.take() {
            Some(decoder) => decoder,
            None => match self.begin()? {
                Some(decoder) => decoder,
                None => return Ok(()),
            },
        };
        self.decode(&mut decoder)?;
        if self.ended {
            self.pass_over();
            self.give(u64::MAX, &decoder);
            if let Some(loss) = self.loss.take() {
                self.tell(loss, &decoder);
            }
        }
        self.decoder = Some(decoder);
        Ok(())
    }
}

/// Words of a step.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// Index of the first odd word of the former step.
    first: usize,
    /// Index of the first word of this step after it.
    next: usize,
    /// Number of odd words, and of time words, from there on.
    odd: usize,
    times: usize,
    /// Index of the first word before it from which no word is odd.
    clean: usize,
}

impl<R: BufRead> Iterator for RawEvents<R> {
    type Item = Result<Event, IoError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(ready) = self.ready.pop_front() {
                return Some(ready);
            }
            if self.ended {
                return None;
            }
            if let Err(error) = self.advance() {
                self.ended = true;
                return Some(Err(error));
            }
        }
    }
}
