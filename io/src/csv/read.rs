//! Lines in, events out, one at a time; the format stands in [`super`].

use std::io::BufRead;

use meissner_engine::{Event, Sensor};

use super::columns::{Columns, Fault};
use super::field::{Refusal, bare};
use super::line::Lines;
use crate::error::{IoError, Place};
use crate::format::Format;
use crate::recording::Recording;

/// The events of a text, each as soon as its line is there: for a pipe or a socket as well as for a file.
///
/// Nothing is read before the first call of `next`, and no call reads beyond the line feed of its event,
/// other than what the reader's own buffer holds. A line takes O(its length); a line of more than
/// [`crate::limits::LINE_BYTES`] is refused.
///
/// A line that is not an event gives an error with its number, and the next call goes on with the line after
/// it, so that a live stream survives a bad line; a caller who wants all or nothing stops at the first error.
/// After a bad header, an overlong line or a reader's failure there are no more items.
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
    columns: Option<Columns>,
    sensor: Option<Sensor>,
    ended: bool,
}

impl<R: BufRead> CsvEvents<R> {
    /// The events of `input`.
    pub fn new(input: R) -> Self {
        Self { lines: Lines::new(input), columns: None, sensor: None, ended: false }
    }

    /// The geometry that a comment `# sensor WxH` named; known once the first event has been read.
    pub fn sensor(&self) -> Option<Sensor> {
        self.sensor
    }

    /// The next event; what ends the iteration sets `ended`.
    fn advance(&mut self) -> Result<Option<Event>, IoError> {
        loop {
            self.ended = true;
            let Some((line, number)) = self.lines.next()? else { return Ok(None) };
            let malformed = |(what, refusal): Fault| IoError::Malformed {
                format: Format::Csv,
                what,
                place: Place::Line(number),
                expected: refusal.expected,
                actual: refusal.actual,
            };
            if line.is_empty() {
                continue;
            }
            if let Some(comment) = line.strip_prefix(b"#") {
                if self.columns.is_none()
                    && let Some(text) = comment.trim_ascii().strip_prefix(b"sensor ")
                {
                    self.sensor = Some(geometry(text).map_err(malformed)?);
                }
                continue;
            }
            let columns = match self.columns {
                Some(columns) => columns,
                None if Columns::is_header(line) => {
                    self.columns = Some(Columns::from_header(line).map_err(malformed)?);
                    continue;
                }
                None => *self.columns.insert(Columns::PLAIN),
            };
            self.ended = false;
            let event = columns.event(line).map_err(malformed)?;
            if let Some(sensor) = self.sensor.filter(|s| !s.contains(event.x, event.y)) {
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

/// `WxH`, each from 1 to 65535.
fn geometry(text: &[u8]) -> Result<Sensor, Fault> {
    let parse = || {
        let (width, height) = std::str::from_utf8(bare(text)).ok()?.split_once('x')?;
        let side = |text: &str| text.parse().ok().filter(|&side: &u16| side > 0);
        Some(Sensor { width: side(width)?, height: side(height)? })
    };
    parse().ok_or_else(|| ("sensor in a comment", Refusal::new("WIDTHxHEIGHT, each 1 to 65535 pixels", text)))
}

/// The events of the text `bytes`.
pub(crate) fn decode(bytes: &[u8]) -> Result<Recording, IoError> {
    let mut text = CsvEvents::new(bytes);
    let events = text.by_ref().collect::<Result<Vec<_>, _>>()?;
    Ok(Recording { format: Format::Csv, sensor: text.sensor, events, other_streams: Vec::new() })
}
