//! CSV: events from and to text, one event per line.
//!
//! ```text
//! # sensor 346x260
//! t,x,y,p
//! 1589163005561252,215,164,1
//! ```
//!
//! Commas, semicolons, or blanks and tabs separate the fields of a line. Lines that start with `#`
//! or `%` are comments. A comment `# sensor WxH` before the first event names the sensor; so do a
//! line with only width and height, the comment `%geometry:W,H` of Metavision (whose columns are x,
//! y, p, t), and the header `t,x@W,y@H,on` of faery and aestream.
//!
//! A header may be in a comment. It names the columns (t, ts, time or timestamp; x; y; p, pol,
//! polarity or on) in any order, in upper or lower case; other columns are skipped. Without a
//! header there are four columns, and their order is given by the caller ([`TextOptions`]) or found
//! from all lines (`layout`). A text with several possible orders is refused.
//!
//! t is in whole microseconds (`12` or `12.0`), or in the unit that the caller or the header
//! (`t_ms`) names. Times with a decimal point are seconds if any of them has four or more decimals;
//! fewer decimals could be milliseconds, and such a text is refused. Every number may have an
//! exponent (`1.9e-06`, `1.2e+01`). Digits beyond microseconds are rounded to the nearest, halves
//! away from zero, without floats. p is 1 or +1 for a rise, and 0 or -1 for a fall (also `True` and
//! `False`). Blank lines, spaces and quotes around fields, both kinds of line end, and a byte order
//! mark are accepted.

pub(crate) mod columns;
pub(crate) mod layout;

use std::io::{self, BufRead, Write};

use meissner_engine::{Event, Sensor};

pub use columns::{ColumnOrder, TimeUnit};
pub use layout::TextOptions;
use layout::{Evidence, Layout};

use crate::detect::other_kind;
use crate::error::{IoError, Place};
use crate::format::{Format, Kind};
use crate::left_out::events_of_lines;
use crate::options::ReadOptions;
use crate::recording::{Recording, Salvage};
use crate::text::{Lines, is_comment, lines_of};

/// The events of a text, each as soon as its line has arrived, also from a pipe or a socket.
///
/// Nothing is read before the first call of `next`. No call reads beyond the line feed of its
/// event, except for the content of the reader's own buffer. A line takes O(its length); a line
/// longer than [`crate::limits::LINE_BYTES`] is refused.
///
/// Without a header and without [`TextOptions`], the first event's line decides the order of the
/// columns: t, x, y, p if commas separate and the line fits, otherwise the only order that fits.
/// Times are whole microseconds, or seconds if the first time that is not 0 has four or more
/// decimals. A line that fits several layouts gives [`IoError::Undecided`]. [`crate::decode_with`]
/// has the whole text and uses all lines to decide.
///
/// A line that is not an event gives an error with its number, and the next call continues with the
/// line after it, so that a live stream survives a bad line. A caller that needs every event stops
/// at the first error. There are no further items after a bad header, an undecided line, an
/// overlong line, a reader's failure, or input of another kind ([`IoError::OtherKind`]).
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
    /// The first lines, which may be the header of a binary format.
    marks: Vec<u8>,
    /// Whether the first line that may be an event was read.
    begun: bool,
    ended: bool,
}

impl<R: BufRead> CsvEvents<R> {
    /// The events of `input`.
    pub fn new(input: R) -> Self {
        Self::with_options(input, TextOptions::default())
    }

    /// The events of `input`, with the parts of the layout that `options` give.
    pub fn with_options(input: R, options: TextOptions) -> Self {
        let layout = Layout::new(options);
        Self { lines: Lines::new(input), layout, marks: Vec::new(), begun: false, ended: false }
    }

    /// The sensor that the text names before its first event; known after the first event was read.
    pub fn sensor(&self) -> Option<Sensor> {
        self.layout.sensor
    }

    /// Continues with `input`, whose lines count from 1 again; keeps the layout.
    pub(crate) fn go_on(&mut self, input: R) {
        self.lines = Lines::new(input);
        self.marks.clear();
        self.ended = false;
    }

    /// Continues with the next line after an error that ended the events.
    pub(crate) fn pass_over(&mut self) {
        self.ended = false;
    }

    /// The next event; `ended` is false afterwards if the iteration continues.
    fn advance(&mut self) -> Result<Option<Event>, IoError> {
        let Self { lines, layout, marks, begun, ended } = self;
        *ended = true;
        loop {
            if lines.next(other_than_text)?.is_none() {
                return Ok(None);
            }
            if !*begun && lines.raw().starts_with(b"%") && marks.len() < 4096 {
                marks.extend_from_slice(lines.raw());
                if let Some(error) = other_than_text(marks) {
                    return Err(error);
                }
            }
            let line = lines.current();
            let is_skipped =
                line.text.is_empty() || if *begun { is_comment(line.text) } else { layout.preamble(line)? };
            if is_skipped {
                continue;
            }
            *begun = true;
            let event = layout.event(line);
            *ended = matches!(event, Err(IoError::Undecided { .. }));
            return event.map(Some);
        }
    }
}

impl<R: BufRead> Iterator for CsvEvents<R> {
    type Item = Result<Event, IoError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended { None } else { self.advance().transpose() }
    }
}

/// The error of input that starts with `start` and is not a text of events.
fn other_than_text(start: &[u8]) -> Option<IoError> {
    other_kind(start, Kind::Events(Format::Csv), "events as text")
}

impl<'a> CsvEvents<&'a [u8]> {
    /// The events of a whole text; all lines decide the properties that `options` and the header
    /// leave open.
    ///
    /// # Errors
    /// [`IoError::Undecided`] if several layouts fit all lines.
    pub fn of_text(text: &'a [u8], options: TextOptions) -> Result<Self, IoError> {
        let layout = layout_of(text, options)?;
        Ok(Self { layout, ..Self::new(text) })
    }
}

/// The layout of a whole text. Malformed lines are refused only when they are read.
fn layout_of(text: &[u8], options: TextOptions) -> Result<Layout, IoError> {
    let mut layout = Layout::new(options);
    let has_points = text.iter().any(|byte| matches!(byte, b'.' | b'e' | b'E'));
    let mut lines = lines_of(text).filter(|line| !line.text.is_empty());
    while let Some(line) = lines.next() {
        match layout.preamble(line) {
            Ok(true) => {}
            Ok(false) if !layout.is_known(has_points) => {
                let more = lines.map(|line| line.text).filter(|text| !is_comment(text));
                let evidence = Evidence::of(layout.separator(line.text), line.text, more);
                layout.decide(&evidence, line)?;
                return Ok(layout);
            }
            Ok(false) | Err(_) => return Ok(layout),
        }
    }
    Ok(layout)
}

/// The events of the text `bytes`; with `salvage`, without a last line that has no line feed.
pub(crate) fn decode(bytes: &[u8], options: ReadOptions) -> Result<Recording, IoError> {
    let salvage = options.salvage;
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
    let mut text = CsvEvents::of_text(whole, options.text)?;
    let (events, left_out) = events_of_lines(text.by_ref(), options.strict)?;
    Ok(Recording { left_out, salvaged, ..Recording::of_events(Format::Csv, text.sensor(), events) })
}

/// Writes the sensor as a comment if it is known, the header, and a line for each of `events`.
pub(crate) fn encode(sensor: Option<Sensor>, events: &[Event], out: &mut impl Write) -> io::Result<()> {
    if let Some(sensor) = sensor {
        writeln!(out, "# sensor {sensor}")?;
    }
    writeln!(out, "t,x,y,p")?;
    for Event { t_us, x, y, on } in events {
        writeln!(out, "{t_us},{x},{y},{}", u8::from(*on))?;
    }
    Ok(())
}
