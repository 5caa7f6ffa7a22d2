//! How a text of events is laid out: what a caller says about it, what its first lines say, and what follows.

use std::fmt;
use std::str::FromStr;

use meissner_engine::{Event, Sensor};

use super::columns::{ColumnOrder, Fault};
use super::evidence::{Choice, Evidence};
use super::field::{Number, Refusal, bare, coordinate, polarity};
use super::is_comment;
use super::separator::Separator;

/// The unit of the times of a text.
///
/// Times become whole microseconds: digits beyond are rounded to the nearest, halves away from zero. No float is involved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeUnit {
    /// `s`.
    Seconds,
    /// `ms`.
    Milliseconds,
    /// `us`.
    Microseconds,
    /// `ns`.
    Nanoseconds,
}

impl TimeUnit {
    /// The power of ten that makes microseconds of it.
    fn power(self) -> i32 {
        match self {
            Self::Seconds => 6,
            Self::Milliseconds => 3,
            Self::Microseconds => 0,
            Self::Nanoseconds => -3,
        }
    }
}

impl fmt::Display for TimeUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Seconds => "s",
            Self::Milliseconds => "ms",
            Self::Microseconds => "us",
            Self::Nanoseconds => "ns",
        })
    }
}

impl FromStr for TimeUnit {
    type Err = String;

    /// The unit of this name: `s`, `ms`, `us` or `ns`.
    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "s" => Ok(Self::Seconds),
            "ms" => Ok(Self::Milliseconds),
            "us" => Ok(Self::Microseconds),
            "ns" => Ok(Self::Nanoseconds),
            _ => Err("expected s, ms, us or ns".to_owned()),
        }
    }
}

/// What a caller says about a text of events; what is `None` is found from the text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TextOptions {
    /// The order of the columns, in place of a header.
    pub columns: Option<ColumnOrder>,
    /// The unit of the times.
    pub time_unit: Option<TimeUnit>,
}

/// How a field becomes a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Time {
    /// Whole microseconds.
    Whole,
    /// Seconds, known by their decimals: each is 0 or has a point.
    Pointed,
    /// Of a unit that a caller or the header named.
    Named(TimeUnit),
}

/// Decimals from which on a time is in seconds: in milliseconds it would say more than microseconds.
pub(super) const DECIMALS_OF_SECONDS: usize = 4;

/// Why a line gives no event.
pub(super) enum Wrong {
    /// The line is at fault.
    Line(Fault),
    /// The text can be read in several ways: what is undecided, and the ways.
    Undecided(&'static str, String),
}

impl From<Fault> for Wrong {
    fn from(fault: Fault) -> Self {
        Self::Line(fault)
    }
}

/// What is known of a text.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    options: TextOptions,
    separator: Option<Separator>,
    columns: Option<ColumnOrder>,
    time: Option<Time>,
    pub(super) sensor: Option<Sensor>,
}

impl Layout {
    pub(super) fn new(options: TextOptions) -> Self {
        let time = options.time_unit.map(Time::Named);
        Self { options, columns: options.columns, time, ..Self::default() }
    }

    /// Whether nothing has to be found from the values of a text with or without a decimal point.
    pub(super) fn is_settled(&self, has_points: bool) -> bool {
        self.columns.is_some() && (self.time.is_some() || !has_points)
    }

    /// Takes a line before the first event: a comment, a header, or the sensor's size; whether it is one of these.
    pub(super) fn preamble(&mut self, line: &[u8]) -> Result<bool, Fault> {
        if is_comment(line) {
            let comment = line[1..].trim_ascii();
            if let Some(text) = comment.strip_prefix(b"sensor ") {
                self.sensor = Some(sensor(text, b'x').ok_or_else(|| {
                    let expected = "WIDTHxHEIGHT, each 1 to 65535 pixels";
                    ("sensor in a comment", Refusal::new(expected, text))
                })?);
            } else if ColumnOrder::is_plain_header(comment) {
                self.header(comment)?;
                // The events may be separated otherwise.
                self.separator = None;
            }
            return Ok(true);
        }
        if ColumnOrder::is_header(line) {
            self.header(line)?;
            return Ok(true);
        }
        // Width and height on a line of their own; an event has more fields.
        if let Some(size) = sensor(line, b' ') {
            self.sensor = Some(size);
            return Ok(true);
        }
        Ok(false)
    }

    fn header(&mut self, line: &[u8]) -> Result<(), Fault> {
        let separator = Separator::of(line);
        self.separator = Some(separator);
        if self.options.columns.is_none() {
            let (columns, unit) = ColumnOrder::from_header(line, separator)?;
            self.columns = Some(columns);
            if let (None, Some(unit)) = (self.options.time_unit, unit) {
                self.time = Some(Time::Named(unit));
            }
        }
        Ok(())
    }

    /// The separator of the events, of which `line` is the first.
    pub(super) fn separator(&mut self, line: &[u8]) -> Separator {
        *self.separator.get_or_insert_with(|| Separator::of(line))
    }

    /// Settles what is not known yet by all lines of a text.
    pub(super) fn settle(&mut self, evidence: &Evidence) -> Result<(), Wrong> {
        if self.columns.is_none() {
            match evidence.columns(self.sensor) {
                Choice::One(columns) => self.columns = Some(columns),
                Choice::Several(readings) => return Err(Wrong::Undecided("order of the columns", readings)),
                Choice::None => self.columns = Some(ColumnOrder::PLAIN),
            }
        }
        if let (None, Some(columns)) = (self.time, self.columns) {
            self.time = Some(evidence.time(columns)?);
        }
        Ok(())
    }

    /// The event of a line; the first lines settle what is not known yet.
    pub(super) fn event(&mut self, line: &[u8]) -> Result<Event, Wrong> {
        let separator = self.separator(line);
        let columns = match self.columns {
            Some(columns) => columns,
            None => match Evidence::of(separator, line).first_line(self.sensor) {
                Choice::One(columns) => *self.columns.insert(columns),
                Choice::Several(readings) => return Err(Wrong::Undecided("order of the columns", readings)),
                // Not an event in any order: the plain order says why, the next line may be one.
                Choice::None => ColumnOrder::PLAIN,
            },
        };
        let [t, x, y, p] = columns.fields(separator, line)?;
        let t_us = self.time_us(t)?;
        Ok(Event {
            t_us,
            x: coordinate(x).map_err(|refusal| ("column x", refusal))?,
            y: coordinate(y).map_err(|refusal| ("row y", refusal))?,
            on: polarity(p).map_err(|refusal| ("polarity p", refusal))?,
        })
    }

    /// A time in microseconds; the first that is not 0 settles the unit.
    fn time_us(&mut self, field: &[u8]) -> Result<i64, Wrong> {
        let refuse = |expected: &str| Wrong::Line(("time t", Refusal::new(expected, field)));
        let Some(number) = Number::parse(field) else { return Err(refuse("a number")) };
        if number.is_zero() {
            return Ok(0);
        }
        let time = match self.time {
            Some(time) => time,
            None if number.is_whole() => *self.time.insert(Time::Whole),
            None if number.decimals() >= DECIMALS_OF_SECONDS => *self.time.insert(Time::Pointed),
            None => return Err(Wrong::Undecided("unit of time", "seconds or milliseconds".to_owned())),
        };
        let (unit, expected) = match time {
            Time::Named(unit) => (unit, "a time within 2^63 microseconds"),
            Time::Whole if !number.is_whole() => {
                return Err(refuse("a whole number of microseconds (a fraction suggests seconds)"));
            }
            Time::Whole => (TimeUnit::Microseconds, "a whole number of microseconds below 2^63"),
            Time::Pointed if !number.has_point() => {
                return Err(refuse("a number of seconds with a decimal point, as in the lines before"));
            }
            Time::Pointed => (TimeUnit::Seconds, "a time within 2^63 microseconds"),
        };
        number.scaled(unit.power()).and_then(|us| us.try_into().ok()).ok_or_else(|| refuse(expected))
    }
}

/// Width and height, each from 1 to 65535, with `between` or blanks between them.
fn sensor(text: &[u8], between: u8) -> Option<Sensor> {
    let text = std::str::from_utf8(bare(text)).ok()?;
    let (width, height) = match between {
        b' ' => text.split_once(|c: char| c.is_ascii_whitespace())?,
        _ => text.split_once(char::from(between))?,
    };
    let side = |text: &str| text.trim().parse().ok().filter(|&side: &u16| side > 0);
    Some(Sensor { width: side(width)?, height: side(height)? })
}
