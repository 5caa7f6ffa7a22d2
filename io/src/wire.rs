//! Live events: a text, or records of 16 bytes, from a pipe or a socket.
//!
//! | bytes | record |
//! |---|---|
//! | 0-7 | time in microseconds, i64 |
//! | 8-9, 10-11 | column, row, u16 |
//! | 12 | polarity, i8: more than 0 for a rise |
//! | 13-15 | 0 |
//!
//! Over TCP and from a pipe, lines and records follow one another. A UDP datagram is independent:
//! it may arrive in any order or not at all, so no line or record continues in the next.
//!
//! All values have their least significant byte first: on most machines, the memory of a
//! `meissner_event` of the C interface is a record.

use std::collections::VecDeque;
use std::io::{BufRead, Chain, Cursor, Read};

use meissner_engine::{Event, Sensor};

use crate::aedat4::stream::PacketEvents;
use crate::csv::{CsvEvents, TextOptions};
use crate::error::{IoError, Place};
use crate::format::{self, Format};
use crate::limits::LINE_BYTES;
use crate::options::ReadOptions;
use crate::raw::RawEvents;

/// Bytes of a record.
pub const RECORD_BYTES: usize = 16;
const NAME: &str = "records";
const UNDECIDED: &str = "CSV or records";
/// Number of bytes that distinguish records from a text: the last of them is 0, or 255 before the
/// epoch, which does not occur in a text. A line with an event has at least as many bytes.
const TELLING: usize = 8;

/// The record of `event`.
///
/// ```
/// let event = meissner_engine::Event::new(513, 3, 4, true);
/// assert_eq!(meissner_io::record(event), [1, 2, 0, 0, 0, 0, 0, 0, 3, 0, 4, 0, 1, 0, 0, 0]);
/// ```
pub fn record(event: Event) -> [u8; RECORD_BYTES] {
    let mut bytes = [0; RECORD_BYTES];
    bytes[..8].copy_from_slice(&event.t_us.to_le_bytes());
    bytes[8..10].copy_from_slice(&event.x.to_le_bytes());
    bytes[10..12].copy_from_slice(&event.y.to_le_bytes());
    bytes[12] = event.on.into();
    bytes
}

/// The event of a record; `None` if its last three bytes are not 0. For programs that read
/// datagrams themselves, each with complete records.
///
/// ```
/// let event = meissner_engine::Event::new(513, 3, 4, true);
/// assert_eq!(meissner_io::event_of(meissner_io::record(event)), Some(event));
/// ```
pub fn event_of(record: [u8; RECORD_BYTES]) -> Option<Event> {
    let [t0, t1, t2, t3, t4, t5, t6, t7, x0, x1, y0, y1, polarity, 0, 0, 0] = record else { return None };
    let t_us = i64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]);
    let (x, y) = (u16::from_le_bytes([x0, x1]), u16::from_le_bytes([y0, y1]));
    Some(Event::new(t_us, x, y, (polarity as i8) > 0))
}

/// The first bytes of a stream, then the remaining ones.
type Whole<R> = Chain<Cursor<Vec<u8>>, R>;

/// Events, each as soon as its last byte has arrived. The first bytes distinguish a text from
/// records.
///
/// A record whose last three bytes are not 0 ends the events, because the following records would
/// be out of step. In [datagrams](Self::of_datagrams), no error ends them.
///
/// ```
/// use meissner_io::{LiveEvents, TextOptions, record};
///
/// let event = meissner_engine::Event::new(10, 3, 4, true);
/// for bytes in [b"10,3,4,1\n".to_vec(), record(event).to_vec()] {
///     let mut events = LiveEvents::new(&bytes[..], TextOptions::default());
///     assert_eq!(events.next().transpose()?, Some(event));
/// }
/// # Ok::<(), meissner_io::IoError>(())
/// ```
#[derive(Debug)]
pub struct LiveEvents<R: BufRead>(Kind<R>);

#[derive(Debug)]
enum Kind<R: BufRead> {
    /// The state before the first bytes; without an input if these could not be read.
    Undecided(Option<R>, TextOptions),
    Text(CsvEvents<Whole<R>>),
    Datagrams(Datagrams<R>),
    Raw(Box<RawEvents<R>>),
    Packets(Box<PacketEvents<R>>),
    Records {
        input: Whole<R>,
        /// Number of records that were read; `None` after the end or an error.
        read: Option<u64>,
    },
}

impl<R: BufRead> LiveEvents<R> {
    /// The events of `input`; `options` are for a text. Nothing is read before the first call of
    /// `next`.
    pub fn new(input: R, options: TextOptions) -> Self {
        Self(Kind::Undecided(Some(input), options))
    }

    /// The events of `input`: each read gives a datagram of complete lines or records; an empty one
    /// is the end.
    ///
    /// A line that is not an event, a record whose last three bytes are not 0, or a datagram with
    /// part of a record gives an [`IoError::Datagram`], and the next call continues. The layout and
    /// sensor of a text hold for all datagrams from the first event on.
    pub fn of_datagrams(input: R, options: TextOptions) -> Self {
        Self(Kind::Datagrams(Datagrams::new(input, options)))
    }

    /// The events of `input`, raw bytes in `format`.
    ///
    /// EVT2, EVT2.1 and EVT3 are bytes of a Prophesee sensor, with or without a header, from the
    /// start or the middle of the stream, over a stream or in datagrams. An event is delivered when
    /// the words after it show that its own word was in step. Lost bytes give an [`IoError::Lost`],
    /// other odd words an [`IoError::Word`], and the next call continues after it. The sensor of
    /// `options` is for streams whose header names none: with it, odd words are detected sooner.
    ///
    /// AEDAT4 is a network stream of `dv-processing`, or a file from its start. `options` selects
    /// its stream of events. A packet with odd events gives an [`IoError::Datagram`] and its other
    /// events.
    ///
    /// # Errors
    /// [`IoError::Unsupported`] for another format.
    pub fn raw(input: R, format: Format, options: ReadOptions) -> Result<Self, IoError> {
        Ok(Self(match format {
            Format::Evt2 | Format::Evt21 | Format::Evt3 => {
                Kind::Raw(Box::new(RawEvents::new(input, format, options.sensor)))
            }
            Format::Aedat4 => Kind::Packets(Box::new(PacketEvents::new(input, options))),
            _ => {
                let expected = "AEDAT4, EVT2, EVT2.1 or EVT3 for a raw stream";
                return Err(IoError::Unsupported { expected, actual: format.to_string() });
            }
        }))
    }

    /// The name of the format, which is known after the first call of `next`.
    pub fn format(&self) -> &'static str {
        match &self.0 {
            Kind::Undecided(..) => UNDECIDED,
            Kind::Text(_) => Format::Csv.name(),
            Kind::Datagrams(datagrams) => datagrams.format,
            Kind::Raw(raw) => raw.format.name(),
            Kind::Packets(_) => Format::Aedat4.name(),
            Kind::Records { .. } => NAME,
        }
    }

    /// The sensor that the stream names before its first event; known after this event was read.
    pub fn sensor(&self) -> Option<Sensor> {
        match &self.0 {
            Kind::Text(text) => text.sensor(),
            Kind::Datagrams(datagrams) => datagrams.text.sensor(),
            Kind::Raw(raw) => raw.sensor,
            Kind::Packets(packets) => packets.sensor(),
            Kind::Undecided(..) | Kind::Records { .. } => None,
        }
    }

    /// Reads the first bytes of `input`, which tell its kind.
    fn decide(mut input: R, options: TextOptions) -> Result<Self, IoError> {
        let mut first = Vec::with_capacity(RECORD_BYTES);
        let read = input.by_ref().take(TELLING as u64).read_to_end(&mut first);
        read.map_err(|source| failed(0, source))?;
        let is_binary = tells_records(&first);
        if is_binary {
            // The mark of a format can be the time of a record: the other bytes decide.
            let rest = (RECORD_BYTES - TELLING) as u64;
            input.by_ref().take(rest).read_to_end(&mut first).map_err(|source| failed(0, source))?;
        }
        // A binary recording is refused by its name, as by a reader of text.
        let are_records = is_binary && (is_record(&first) || format::Kind::of(&first).is_none());
        let input = Cursor::new(first).chain(input);
        Ok(Self(if are_records {
            Kind::Records { input, read: Some(0) }
        } else {
            Kind::Text(CsvEvents::with_options(input, options))
        }))
    }
}

impl<R: BufRead> Iterator for LiveEvents<R> {
    type Item = Result<Event, IoError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Kind::Undecided(input, options) = &mut self.0 {
            match Self::decide(input.take()?, *options) {
                Ok(decided) => *self = decided,
                Err(error) => return Some(Err(error)),
            }
        }
        match &mut self.0 {
            Kind::Undecided(..) => None,
            Kind::Text(text) => text.next(),
            Kind::Datagrams(datagrams) => datagrams.next(),
            Kind::Raw(raw) => raw.next(),
            Kind::Packets(packets) => packets.next(),
            Kind::Records { input, read } => {
                let number = read.take()?;
                let found = next_record(input, number).transpose()?;
                if found.is_ok() {
                    *read = Some(number + 1);
                }
                Some(found)
            }
        }
    }
}

/// Whether `first` is a record with a time between the years -4253 and 4253.
fn is_record(first: &[u8]) -> bool {
    let record: Option<[u8; RECORD_BYTES]> = first.try_into().ok();
    record.is_some_and(|record| matches!(record[TELLING - 1], 0 | 0xff) && event_of(record).is_some())
}

/// Record `number` of `input`, or `None` at its end.
fn next_record(input: &mut impl Read, number: u64) -> Result<Option<Event>, IoError> {
    let (mut bytes, at) = (Vec::with_capacity(RECORD_BYTES), number * RECORD_BYTES as u64);
    let read = input.take(RECORD_BYTES as u64).read_to_end(&mut bytes);
    read.map_err(|source| failed(at, source))?;
    if bytes.is_empty() {
        return Ok(None);
    }
    let record: [u8; RECORD_BYTES] = bytes.try_into().map_err(|bytes: Vec<u8>| cut(at, bytes.len()))?;
    decoded(record, at).map(Some)
}

/// Whether the first bytes of an input are those of records.
fn tells_records(bytes: &[u8]) -> bool {
    bytes.iter().take(TELLING).any(|byte| matches!(byte, 0 | 0xff))
}

/// The event of the record at byte `at`.
fn decoded(record: [u8; RECORD_BYTES], at: u64) -> Result<Event, IoError> {
    event_of(record).ok_or_else(|| {
        let [.., a, b, c] = record;
        IoError::Malformed {
            format: NAME,
            what: "end of a record",
            place: Place::Byte(at + 13),
            expected: "0, 0, 0".to_owned(),
            actual: format!("{a}, {b}, {c}"),
        }
    })
}

/// The error of a record of `length` bytes at byte `at`.
fn cut(at: u64, length: usize) -> IoError {
    IoError::Truncated {
        format: NAME,
        what: "the last record",
        place: Place::Byte(at),
        expected: RECORD_BYTES as u64,
        actual: length as u64,
        at_least: false,
    }
}

/// Events of datagrams.
#[derive(Debug)]
struct Datagrams<R> {
    input: R,
    options: TextOptions,
    /// The text; its lines are those of the newest datagram.
    text: CsvEvents<Cursor<Vec<u8>>>,
    /// Whether an event of a text has arrived: later datagrams do not change its layout.
    begun: bool,
    format: &'static str,
    /// Number of datagrams so far.
    number: u64,
    /// The events and errors of the newest datagrams.
    ready: VecDeque<Result<Event, IoError>>,
}

impl<R: BufRead> Datagrams<R> {
    fn new(input: R, options: TextOptions) -> Self {
        let text = CsvEvents::with_options(Cursor::default(), options);
        let (begun, format, number, ready) = (false, UNDECIDED, 0, VecDeque::new());
        Self { input, options, text, begun, format, number, ready }
    }

    fn next(&mut self) -> Option<Result<Event, IoError>> {
        loop {
            if let Some(ready) = self.ready.pop_front() {
                return Some(ready);
            }
            let datagram = match self.input.fill_buf() {
                Ok([]) => return None,
                Ok(datagram) => datagram.to_vec(),
                Err(source) => return Some(Err(failed(0, source))),
            };
            self.input.consume(datagram.len());
            self.number += 1;
            if tells_records(&datagram) {
                self.take_records(&datagram);
            } else {
                self.take_lines(&datagram);
            }
        }
    }

    fn take_records(&mut self, datagram: &[u8]) {
        let (records, rest) = datagram.as_chunks::<RECORD_BYTES>();
        if !rest.is_empty() {
            // The position of the missing or surplus bytes is unknown.
            let at = (datagram.len() - rest.len()) as u64;
            return self.put(Err(cut(at, rest.len())), NAME);
        }
        for (record, i) in records.iter().zip(0..) {
            self.put(decoded(*record, i * RECORD_BYTES as u64), NAME);
        }
    }

    fn take_lines(&mut self, datagram: &[u8]) {
        let (mut lines, mut refused) = (Vec::with_capacity(datagram.len()), false);
        for (line, number) in datagram.split_inclusive(|&byte| byte == b'\n').zip(1..) {
            let (limit, actual) = (LINE_BYTES, line.len() as u64);
            if actual > limit {
                let (format, what, place, unit) = (Format::Csv.name(), "line", Place::Line(number), "bytes");
                let at_least = false;
                let large = IoError::TooLarge { format, what, place, unit, limit, actual, at_least };
                self.put(Err(large), format);
                refused = true;
                // The line number is kept.
                lines.push(b'\n');
            } else {
                lines.extend_from_slice(line);
            }
        }
        self.text.go_on(Cursor::new(lines));
        while let Some(event) = self.text.next() {
            self.begun |= event.is_ok();
            if event.is_err() {
                refused = true;
                self.text.pass_over();
            }
            self.put(event, Format::Csv.name());
        }
        if refused && !self.begun {
            // It may not have been a text of events at all.
            self.text = CsvEvents::with_options(Cursor::default(), self.options);
        }
    }

    /// Adds the content of the newest datagram, in `format`.
    fn put(&mut self, found: Result<Event, IoError>, format: &'static str) {
        if found.is_ok() && self.format == UNDECIDED {
            self.format = format;
        }
        let number = self.number;
        self.ready.push_back(found.map_err(|source| IoError::Datagram { number, source: Box::new(source) }));
    }
}

fn failed(at: u64, source: std::io::Error) -> IoError {
    IoError::Stream { format: NAME, action: "read", place: Place::Byte(at), source }
}
