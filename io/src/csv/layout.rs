//! The layout of a text of events: given, in the first lines, or found from all values.
//!
//! A column can be x or y if all its values are whole and from 0 to 65535 (and on the named
//! sensor), the polarity if all are 0, 1, -1 or booleans, the time if all are numbers. y follows x.
//! An order that fits every line is possible, and plausible if its time never falls.
//!
//! Without a header and without options, the lines of a text decide by these rules:
//! 1. The only possible order, if it is t, x, y, p, if its time cannot be a pixel, or from
//!    [`ENOUGH`] lines on.
//! 2. Otherwise, from the same number of lines on, the only plausible order: pixels do not rise for
//!    so long.
//! 3. Otherwise, for fewer lines with commas, t, x, y, p if it is plausible.
//!
//! Otherwise the caller has to decide. In a stream, only the first line decides.

use meissner_engine::{Event, Sensor};

use super::columns::{ColumnOrder, TimeUnit, coordinate, polarity};
use crate::error::{IoError, shown};
use crate::text::{Line, Number, Separator, bare, is_comment};

/// Number of lines from which rising times are evidence.
const ENOUGH: usize = 16;
/// Columns of a text without a header.
const COLUMNS: usize = 4;
/// Number of decimals from which a time is in seconds: in milliseconds it would be finer than
/// microseconds.
pub(crate) const DECIMALS_OF_SECONDS: usize = 4;

/// Columns of t, x and p in every order in which y follows x.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 3], [2, 0, 3], [3, 0, 2], [0, 2, 1], [1, 2, 0], [3, 1, 0]];

/// The layout of a text as far as the caller knows it. Properties that are `None` are found from
/// the text.
///
/// ```
/// use meissner_io::{ColumnOrder, TextOptions, TimeUnit};
///
/// let order = "xytp".parse::<ColumnOrder>()?;
/// let options = TextOptions::default().columns(order).time_unit(TimeUnit::Seconds);
/// # Ok::<(), meissner_io::IoError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct TextOptions {
    /// The order of the columns, instead of a header.
    pub columns: Option<ColumnOrder>,
    /// The unit of the times.
    pub time_unit: Option<TimeUnit>,
}

impl TextOptions {
    /// Sets the order of the columns, instead of a header.
    #[must_use]
    pub fn columns(mut self, columns: impl Into<Option<ColumnOrder>>) -> Self {
        self.columns = columns.into();
        self
    }

    /// Sets the unit of the times.
    #[must_use]
    pub fn time_unit(mut self, unit: impl Into<Option<TimeUnit>>) -> Self {
        self.time_unit = unit.into();
        self
    }
}

/// Notation of times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Time {
    /// Whole microseconds.
    Whole,
    /// Seconds, recognised by their decimals: each time is 0 or has a point.
    Pointed,
    /// In a unit that the caller or the header names.
    Named(TimeUnit),
}

/// The layout as far as it is known.
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

    /// Whether the layout of a text with or without decimal points is completely known.
    pub(super) fn is_known(&self, has_points: bool) -> bool {
        self.columns.is_some() && (self.time.is_some() || !has_points)
    }

    /// Takes a line before the first event, if it is a comment, a header, or the sensor's size.
    pub(super) fn preamble(&mut self, line: Line<'_>) -> Result<bool, IoError> {
        if is_comment(line.text) {
            let comment = Line { text: line.text[1..].trim_ascii(), number: line.number };
            if let Some(text) = comment.text.strip_prefix(b"sensor ") {
                let expected = "WIDTHxHEIGHT, each 1 to 65535 pixels";
                let refuse = || line.malformed("sensor in a comment", expected, shown(text));
                self.sensor = Some(sensor(text, |c| c == 'x').ok_or_else(refuse)?);
            } else if let Some((size, columns)) = geometry(comment.text) {
                self.sensor = Some(size);
                self.columns = self.columns.or(columns);
            } else if ColumnOrder::is_plain_header(comment) {
                self.header(comment)?;
                // The events may have another separator.
                self.separator = None;
            }
            return Ok(true);
        }
        if ColumnOrder::is_header(line.text) {
            self.header(line)?;
            return Ok(true);
        }
        // Width and height on a separate line; an event has more fields.
        let size = sensor(line.text, |c| c.is_ascii_whitespace());
        self.sensor = size.or(self.sensor);
        Ok(size.is_some())
    }

    fn header(&mut self, line: Line<'_>) -> Result<(), IoError> {
        let separator = Separator::of(line.text);
        self.separator = Some(separator);
        if self.options.columns.is_none() {
            let header = ColumnOrder::from_header(line, separator)?;
            self.columns = Some(header.columns);
            self.sensor = header.sensor.or(self.sensor);
            if let (None, Some(unit)) = (self.options.time_unit, header.unit) {
                self.time = Some(Time::Named(unit));
            }
        } else if let Ok(header) = ColumnOrder::from_header(line, separator) {
            self.sensor = header.sensor.or(self.sensor);
        }
        Ok(())
    }

    /// The separator of the events; `line` is the first event.
    pub(super) fn separator(&mut self, line: &[u8]) -> Separator {
        *self.separator.get_or_insert_with(|| Separator::of(line))
    }

    /// Decides the unknown properties by all lines of a text; `first` is the first event's line.
    pub(super) fn decide(&mut self, evidence: &Evidence<'_>, first: Line<'_>) -> Result<(), IoError> {
        let columns = match self.columns {
            Some(columns) => columns,
            None => evidence.columns(self.sensor, first)?.unwrap_or(ColumnOrder::PLAIN),
        };
        self.columns = Some(columns);
        if self.time.is_none() {
            self.time = Some(evidence.time(columns, first)?);
        }
        Ok(())
    }

    /// The event of a line; the first lines decide the unknown properties.
    pub(super) fn event(&mut self, line: Line<'_>) -> Result<Event, IoError> {
        let separator = self.separator(line.text);
        if self.columns.is_none() {
            self.columns =
                Evidence::of(separator, line.text, std::iter::empty()).columns(self.sensor, line)?;
        }
        // The plain order refuses a line that is not an event in any order; the next line may be an
        // event.
        let [t, x, y, p] = self.columns.unwrap_or(ColumnOrder::PLAIN).fields(separator, line)?;
        let t_us = self.time_us(t, line)?;
        let refuse = |what, expected: &str, field| line.malformed(what, expected, shown(field));
        let side = "a whole number from 0 to 65535";
        let x = coordinate(x).ok_or_else(|| refuse("column x", side, x))?;
        let y = coordinate(y).ok_or_else(|| refuse("row y", side, y))?;
        let on = polarity(p).ok_or_else(|| refuse("polarity p", "0, 1, -1 or +1", p))?;
        match self.sensor {
            Some(sensor) if !sensor.contains(x, y) => Err(line.bytes().outside(sensor, x.into(), y, 0)),
            _ => Ok(Event { t_us, x, y, on }),
        }
    }

    /// A time in microseconds; the first that is not 0 decides the unit.
    fn time_us(&mut self, field: &[u8], line: Line<'_>) -> Result<i64, IoError> {
        let refuse = |expected: &str| line.malformed("time t", expected, shown(field));
        let number = Number::parse(field).ok_or_else(|| refuse("a number"))?;
        if number.is_zero() {
            return Ok(0);
        }
        let time = match self.time {
            Some(time) => time,
            None if number.is_whole() => *self.time.insert(Time::Whole),
            None if number.decimals() >= DECIMALS_OF_SECONDS => *self.time.insert(Time::Pointed),
            None => return Err(line.undecided("unit of time", "seconds or milliseconds")),
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
        let power = unit.name_and_power().1;
        number.scaled(power).and_then(|us| us.try_into().ok()).ok_or_else(|| refuse(expected))
    }
}

/// The sensor of the comment `geometry:WIDTH,HEIGHT` of Metavision's texts, whose columns are x, y,
/// p, t, or of `geometry WIDTHxHEIGHT` of its other files.
fn geometry(comment: &[u8]) -> Option<(Sensor, Option<ColumnOrder>)> {
    match comment.strip_prefix(b"geometry")? {
        [b':', size @ ..] => Some((sensor(size, |c| c == ',')?, Some(ColumnOrder::METAVISION))),
        [b' ', size @ ..] => Some((sensor(size, |c| c == 'x')?, None)),
        _ => None,
    }
}

/// Width and height, each from 1 to 65535, around the first character that `separates`.
fn sensor(text: &[u8], separates: impl Fn(char) -> bool) -> Option<Sensor> {
    let (width, height) = std::str::from_utf8(bare(text)).ok()?.split_once(separates)?;
    let side = |text: &str| text.trim().parse().ok().filter(|&side: &u16| side > 0);
    Some(Sensor { width: side(width)?, height: side(height)? })
}

/// The lines of a text that can be events.
pub(super) struct Evidence<'a> {
    separator: Separator,
    /// Fields of the first line.
    count: usize,
    lines: Vec<&'a [u8]>,
}

impl<'a> Evidence<'a> {
    /// The evidence of these lines. A line whose number of fields differs from that of `first`, or
    /// with words instead of values, is ignored: it is refused later.
    pub(super) fn of(separator: Separator, first: &'a [u8], more: impl Iterator<Item = &'a [u8]>) -> Self {
        let count = separator.fields(first).count();
        let is_word = |field: &[u8]| Number::parse(field).is_none() && polarity(field).is_none();
        let can_be = |line: &&[u8]| {
            separator.fields(line).count() == count
                && (count != COLUMNS || !separator.fields(line).any(is_word))
        };
        Self { separator, count, lines: std::iter::once(first).chain(more).filter(can_be).collect() }
    }

    /// The fields of a column.
    fn column(&self, index: usize) -> impl Iterator<Item = &'a [u8]> {
        self.lines.iter().map(move |line| self.separator.fields(line).nth(index).unwrap_or_default())
    }

    /// The order of the columns; `None`: no order fits, or the only one that fits is not certain.
    /// `first` is the first event's line.
    fn columns(&self, sensor: Option<Sensor>, first: Line<'_>) -> Result<Option<ColumnOrder>, IoError> {
        if self.count != COLUMNS || self.lines.is_empty() {
            return Ok(None);
        }
        let pixels = |column, side: Option<u16>| {
            let fits = |field| coordinate(field).is_some_and(|at| side.is_none_or(|side| at < side));
            self.column(column).all(fits)
        };
        let fits = |order: &ColumnOrder| {
            let [t, x, y, p] = order.at;
            pixels(x, sensor.map(|sensor| sensor.width))
                && pixels(y, sensor.map(|sensor| sensor.height))
                && self.column(p).all(|field| polarity(field).is_some())
                && self.column(t).all(|field| nanoseconds(field).is_some())
        };
        let orders = ORDERS.map(|[t, x, p]| ColumnOrder { at: [t, x, x + 1, p], count: COLUMNS });
        let possible: Vec<_> = orders.into_iter().filter(fits).collect();
        let rises = |order: &ColumnOrder| self.column(order.at[0]).map(nanoseconds).is_sorted();
        let plausible: Vec<_> = possible.iter().copied().filter(rises).collect();
        let (many, plain) = (self.lines.len() >= ENOUGH, ColumnOrder::PLAIN);
        match (&possible[..], &plausible[..]) {
            ([], _) => Ok(None),
            (&[only], _) if only == plain || many || !pixels(only.at[0], None) => Ok(Some(only)),
            // A few lines with small numbers can fit by accident; they may be damaged lines in the
            // plain order.
            (&[_], _) if self.separator == Separator::Comma => Ok(None),
            (&[only], _) => Err(first.undecided("order of the columns", format!("{plain} or {only}"))),
            (_, &[only]) if many => Ok(Some(only)),
            _ if !many && self.separator == Separator::Comma && plausible.contains(&plain) => Ok(Some(plain)),
            ([others @ .., last], _) => {
                let others: Vec<_> = others.iter().map(ToString::to_string).collect();
                Err(first.undecided("order of the columns", format!("{} or {last}", others.join(", "))))
            }
        }
    }

    /// Notation of the times of a whole text.
    fn time(&self, columns: ColumnOrder, first: Line<'_>) -> Result<Time, IoError> {
        let times =
            || self.column(columns.at[0]).filter(|t| nanoseconds(t).is_some()).filter_map(Number::parse);
        let is_pointed = |time: Number<'_>| time.has_point() || time.is_zero();
        if times().all(Number::is_whole) || !times().all(is_pointed) {
            return Ok(Time::Whole);
        }
        if times().any(|time| time.decimals() >= DECIMALS_OF_SECONDS) {
            return Ok(Time::Pointed);
        }
        Err(first.undecided("unit of time", "seconds or milliseconds"))
    }
}

/// A number in units of 1e-9, as for times in seconds; `None`: it is not a number, or too large.
fn nanoseconds(field: &[u8]) -> Option<i128> {
    Number::parse(field)?.scaled(9)
}
