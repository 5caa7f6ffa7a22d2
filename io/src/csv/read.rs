//! Lines in, events out, one at a time; the format stands in [`super`].

use std::io::BufRead;

use meissner_engine::{Event, Sensor};

use super::evidence::Evidence;
use super::field::shown;
use super::is_comment;
use super::layout::{Layout, TextOptions, Wrong};
use super::line::Lines;
use crate::error::{IoError, Place};
use crate::format::Format;
use crate::kind::Kind;
use crate::recording::{Recording, Salvage};

/// The events of a text, each as soon as its line is there: for a pipe or a socket as well as for a file.
///
/// Nothing is read before the first call of `next`, and no call reads beyond the line feed of its event,
/// other than what the reader's own buffer holds. A line takes O(its length); a line of more than
/// [`crate::limits::LINE_BYTES`] is refused.
///
/// Without a header and without [`TextOptions`] the first event's line has to say the order of the columns: that is t, x, y, p
/// where commas separate and the line can be read so, else the only order in which it can be. Times are whole microseconds,
/// or seconds where the first that is not 0 has four or more decimals. A line that leaves the choice gives
/// [`IoError::Undecided`]. [`crate::decode_with`], which has the whole text, decides by all lines.
///
/// A line that is not an event gives an error with its number, and the next call goes on with the line after
/// it, so that a live stream survives a bad line; a caller who wants all or nothing stops at the first error.
/// After a bad header, an undecided line, an overlong line, a reader's failure, or where the input is of another kind
/// ([`IoError::OtherKind`]), there are no more items.
///
/// ```
/// let text = "t,x,y,p\n10,3,4,1\n12,3,5,-1\n";
/// let events: Result<Vec<_>, _> = meissner_io::CsvEvents::new(text.as_bytes()).collect();
/// assert_eq!(events?[1], meissner_engine::Event::new(12, 3, 5, false));
/// # Ok::<(), meissner_io::IoError>(())
/// ```
#[derive(Debug)]
pub struct CsvEvents<R: BufRead> {
    lines: Lines<R>,
    layout: Layout,
    /// The first lines, where they may be the header of a binary format.
    marks: Vec<u8>,
    /// Whether a line that may be an event has been there.
    begun: bool,
    ended: bool,
}

impl<R: BufRead> CsvEvents<R> {
    /// The events of `input`.
    pub fn new(input: R) -> Self {
        Self::with_options(input, TextOptions::default())
    }

    /// The events of `input`, of which `options` say what it does not say itself.
    pub fn with_options(input: R, options: TextOptions) -> Self {
        Self::of(input, Layout::new(options))
    }

    fn of(input: R, layout: Layout) -> Self {
        Self { lines: Lines::new(input), layout, marks: Vec::new(), begun: false, ended: false }
    }

    /// The geometry that the text names before its first event; known once the first event has been read.
    pub fn sensor(&self) -> Option<Sensor> {
        self.layout.sensor
    }

    /// The next event; what ends the iteration sets `ended`.
    fn advance(&mut self) -> Result<Option<Event>, IoError> {
        let Self { lines, layout, marks, begun, ended } = self;
        loop {
            *ended = true;
            let is_first = lines.number() == 0;
            let next = match lines.next() {
                Ok(None) => return Ok(None),
                next => next.map(drop),
            };
            // What has no lines, or a first line of another kind, may be no text.
            if is_first && let Some(error) = other_kind(lines.raw()) {
                return Err(error);
            }
            next?;
            if !*begun && lines.raw().starts_with(b"%") && marks.len() < 4096 {
                marks.extend_from_slice(lines.raw());
                if let Some(error) = other_kind(marks) {
                    return Err(error);
                }
            }
            let (line, number) = lines.current();
            let malformed = |(what, refusal): super::columns::Fault| IoError::Malformed {
                format: Format::Csv,
                what,
                place: Place::Line(number),
                expected: refusal.expected,
                actual: refusal.actual,
            };
            if line.is_empty() || (*begun && is_comment(line)) {
                continue;
            }
            if !*begun && layout.preamble(line).map_err(malformed)? {
                continue;
            }
            *begun = true;
            let event = match layout.event(line) {
                Ok(event) => event,
                Err(Wrong::Line(fault)) => {
                    *ended = false;
                    return Err(malformed(fault));
                }
                Err(Wrong::Undecided(what, readings)) => return Err(undecided(what, readings, line, number)),
            };
            *ended = false;
            if let Some(sensor) = layout.sensor.filter(|s| !s.contains(event.x, event.y)) {
                let (format, place) = (Format::Csv, Place::Line(number));
                return Err(IoError::OutsideSensor {
                    format,
                    place,
                    sensor,
                    x: event.x.into(),
                    y: event.y.into(),
                });
            }
            return Ok(Some(event));
        }
    }
}

impl<R: BufRead> Iterator for CsvEvents<R> {
    type Item = Result<Event, IoError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended { None } else { self.advance().transpose() }
    }
}

/// The error of a text that starts with `start`, where that is no text of events.
fn other_kind(start: &[u8]) -> Option<IoError> {
    let found = Kind::of(start).filter(|kind| *kind != Kind::Events(Format::Csv))?;
    Some(IoError::OtherKind { expected: "events as text", found })
}

fn undecided(what: &'static str, readings: String, line: &[u8], number: u64) -> IoError {
    IoError::Undecided { format: Format::Csv, what, place: Place::Line(number), line: shown(line), readings }
}

impl<'a> CsvEvents<&'a [u8]> {
    /// The events of a whole text, whose layout all lines decide where `options` and header do not say it.
    ///
    /// # Errors
    /// [`IoError::Undecided`] where several layouts fit all lines.
    pub fn of_text(text: &'a [u8], options: TextOptions) -> Result<Self, IoError> {
        Ok(Self::of(text, layout(text, options)?))
    }
}

/// The events of the text `bytes`; to be salvaged is all but a last line without a line feed.
pub(crate) fn decode(bytes: &[u8], options: TextOptions, salvage: bool) -> Result<Recording, IoError> {
    let whole = match bytes.iter().rposition(|&b| b == b'\n') {
        Some(last) if salvage => &bytes[..=last],
        None if salvage => &[],
        _ => bytes,
    };
    let salvaged = (whole.len() < bytes.len()).then(|| Salvage {
        what: "the last line, which has no line feed",
        place: Place::Line(whole.split(|&b| b == b'\n').count() as u64),
        bytes_not_read: (bytes.len() - whole.len()) as u64,
    });
    let mut text = CsvEvents::of_text(whole, options)?;
    let events = text.by_ref().collect::<Result<Vec<_>, _>>()?;
    let sensor = text.sensor();
    Ok(Recording { format: Format::Csv, sensor, events, other_streams: Vec::new(), salvaged })
}

/// The layout of a whole text, as far as it is sound: what is at fault is found with its place when it is read.
fn layout(bytes: &[u8], options: TextOptions) -> Result<Layout, IoError> {
    let mut layout = Layout::new(options);
    let has_points = bytes.contains(&b'.');
    let mut lines = Lines::new(bytes);
    let mut first = None;
    while let Ok(Some((line, number))) = lines.next() {
        if line.is_empty() {
            continue;
        }
        match layout.preamble(line) {
            Ok(true) => {}
            Ok(false) => {
                first = Some((line.to_vec(), number));
                break;
            }
            Err(_) => break,
        }
    }
    let Some((first, number)) = first.filter(|_| !layout.is_settled(has_points)) else { return Ok(layout) };
    let mut evidence = Evidence::of(layout.separator(&first), &first);
    while let Ok(Some((line, _))) = lines.next() {
        if !line.is_empty() && !is_comment(line) {
            evidence.add(line);
        }
    }
    match layout.settle(&evidence) {
        Err(Wrong::Undecided(what, readings)) => Err(undecided(what, readings, &first, number)),
        Err(Wrong::Line(_)) | Ok(()) => Ok(layout),
    }
}
