//! The layout of a text of events: given by the caller, by the first lines, or found from the values of all lines.
//!
//! A column can be x or y if all its values are whole and from 0 to 65535 (and on the sensor that a comment names), the
//! polarity if all are 0, 1, -1 or booleans, and the time if all are numbers. y follows x. An order that fits every line
//! is possible; a possible order whose time never steps back is plausible.
//!
//! Without a header and without options, the lines of a text decide by these rules:
//! 1. The only possible order is taken if it is t, x, y, p, or if its time cannot be a pixel, or from [`ENOUGH`] lines on.
//! 2. Otherwise, from so many lines on, the only plausible order is taken: the columns and rows of pixels do not rise for
//!    so long.
//! 3. Otherwise t, x, y, p is taken if it is plausible, commas separate, and there are fewer lines.
//!
//! Otherwise the text is undecided, and the caller has to decide. In a stream, the first line alone decides.

use meissner_engine::{Event, Sensor};

use super::columns::{ColumnOrder, TimeUnit, coordinate, polarity};
use crate::error::{IoError, shown};
use crate::text::{Line, Number, Separator, bare, is_comment};

/// Lines from which on rising times are evidence.
const ENOUGH: usize = 16;
/// Columns of a text without a header.
const COLUMNS: usize = 4;
/// Decimals from which on a time is in seconds: in milliseconds it would be finer than microseconds.
const DECIMALS_OF_SECONDS: usize = 4;

/// Columns of t, x and p in every order in which y follows x.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 3], [2, 0, 3], [3, 0, 2], [0, 2, 1], [1, 2, 0], [3, 1, 0]];

/// The layout of a text as far as the caller knows it; `None` is found from the text.
///
/// ```
/// use meissner_io::{TextOptions, TimeUnit};
///
/// let (columns, time_unit) = (Some("xytp".parse()?), Some(TimeUnit::Seconds));
/// let options = TextOptions { columns, time_unit };
/// # Ok::<(), meissner_io::IoError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TextOptions {
    /// The order of the columns, in place of a header.
    pub columns: Option<ColumnOrder>,
    /// The unit of the times.
    pub time_unit: Option<TimeUnit>,
}

/// How times are written.
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

    /// Whether the values of a text with or without decimal points have nothing left to decide.
    pub(super) fn is_known(&self, has_points: bool) -> bool {
        self.columns.is_some() && (self.time.is_some() || !has_points)
    }

    /// Takes a line before the first event; whether it is a comment, a header, or the sensor's size.
    pub(super) fn preamble(&mut self, line: Line<'_>) -> Result<bool, IoError> {
        if is_comment(line.text) {
            let comment = Line { text: line.text[1..].trim_ascii(), number: line.number };
            if let Some(text) = comment.text.strip_prefix(b"sensor ") {
                let expected = "WIDTHxHEIGHT, each 1 to 65535 pixels";
                let refuse = || line.malformed("sensor in a comment", expected, shown(text));
                self.sensor = Some(sensor(text, |c| c == 'x').ok_or_else(refuse)?);
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
        // Width and height on a line of their own; an event has more fields.
        let size = sensor(line.text, |c| c.is_ascii_whitespace());
        self.sensor = size.or(self.sensor);
        Ok(size.is_some())
    }

    fn header(&mut self, line: Line<'_>) -> Result<(), IoError> {
        let separator = Separator::of(line.text);
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

    /// The separator of the events; `line` is the first event.
    pub(super) fn separator(&mut self, line: &[u8]) -> Separator {
        *self.separator.get_or_insert_with(|| Separator::of(line))
    }

    /// Decides by all lines of a text whatever is not known yet; `first` is the first event's line.
    pub(super) fn decide(&mut self, evidence: &Evidence, first: Line<'_>) -> Result<(), IoError> {
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

    /// The event of a line; the first lines decide whatever is not known yet.
    pub(super) fn event(&mut self, line: Line<'_>) -> Result<Event, IoError> {
        let separator = self.separator(line.text);
        if self.columns.is_none() {
            self.columns = Evidence::of(separator, line.text).columns(self.sensor, line)?;
        }
        // A line that is no event in any order is refused by the plain order; the next line may be an event.
        let [t, x, y, p] = self.columns.unwrap_or(ColumnOrder::PLAIN).fields(separator, line)?;
        let t_us = self.time_us(t, line)?;
        let refuse = |what, expected: &str, field| line.malformed(what, expected, shown(field));
        let side = "a whole number from 0 to 65535";
        let x = coordinate(x).ok_or_else(|| refuse("column x", side, x))?;
        let y = coordinate(y).ok_or_else(|| refuse("row y", side, y))?;
        let on = polarity(p).ok_or_else(|| refuse("polarity p", "0, 1, -1 or +1", p))?;
        line.bytes().check_pixel(self.sensor, x, y, 0)?;
        Ok(Event { t_us, x, y, on })
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

/// Width and height, each from 1 to 65535, around the first character that `separates`.
fn sensor(text: &[u8], separates: impl Fn(char) -> bool) -> Option<Sensor> {
    let (width, height) = std::str::from_utf8(bare(text)).ok()?.split_once(separates)?;
    let side = |text: &str| text.trim().parse().ok().filter(|&side: &u16| side > 0);
    Some(Sensor { width: side(width)?, height: side(height)? })
}

/// The common properties of a column's values.
#[derive(Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "each is a question of its own")]
struct Column {
    numbers: bool,
    polarities: bool,
    /// All are whole and from 0 to 65535.
    pixels: bool,
    largest: u16,
    /// Any has a fraction.
    fractions: bool,
    /// All except 0 have a point.
    points: bool,
    /// Most digits after a point.
    decimals: usize,
    /// None is less than the one before it.
    rises: bool,
    /// The newest in 1e-9.
    newest: i128,
}

impl Column {
    const EMPTY: Self = Self {
        numbers: true,
        polarities: true,
        pixels: true,
        largest: 0,
        fractions: false,
        points: true,
        decimals: 0,
        rises: true,
        newest: i128::MIN,
    };

    fn add(&mut self, field: &[u8]) {
        self.polarities &= polarity(field).is_some();
        match coordinate(field) {
            Some(pixel) => self.largest = self.largest.max(pixel),
            None => self.pixels = false,
        }
        let Some((number, value)) = Number::parse(field).and_then(|n| Some((n, n.scaled(9)?))) else {
            self.numbers = false;
            return;
        };
        self.fractions |= !number.is_whole();
        self.points &= number.has_point() || number.is_zero();
        self.decimals = self.decimals.max(number.decimals());
        self.rises &= value >= self.newest;
        self.newest = value;
    }

    fn fits(&self, side: Option<u16>) -> bool {
        self.pixels && side.is_none_or(|side| self.largest < side)
    }
}

/// The common properties of the lines of a text.
pub(super) struct Evidence {
    separator: Separator,
    columns: Vec<Column>,
    lines: usize,
}

impl Evidence {
    /// The evidence of one line.
    pub(super) fn of(separator: Separator, line: &[u8]) -> Self {
        let columns = vec![Column::EMPTY; separator.fields(line).count()];
        let mut evidence = Self { separator, columns, lines: 0 };
        evidence.add(line);
        evidence
    }

    /// Adds a line. A line with another number of fields than the first, or with words in place of values, is ignored: it is
    /// refused later.
    pub(super) fn add(&mut self, line: &[u8]) {
        let fields = || self.separator.fields(line);
        let count = fields().count();
        let words = || fields().any(|field| Number::parse(field).is_none() && polarity(field).is_none());
        if count != self.columns.len() || (count == COLUMNS && words()) {
            return;
        }
        for (column, field) in self.columns.iter_mut().zip(fields()) {
            column.add(field);
        }
        self.lines += 1;
    }

    /// The order of the columns; `None`: no order fits, or the only one that fits is not certain. `first` is the first
    /// event's line.
    fn columns(&self, sensor: Option<Sensor>, first: Line<'_>) -> Result<Option<ColumnOrder>, IoError> {
        if self.columns.len() != COLUMNS || self.lines == 0 {
            return Ok(None);
        }
        let fits = |order: &ColumnOrder| {
            self.columns[order.t].numbers
                && self.columns[order.p].polarities
                && self.columns[order.x].fits(sensor.map(|sensor| sensor.width))
                && self.columns[order.y].fits(sensor.map(|sensor| sensor.height))
        };
        let orders = ORDERS.map(|[t, x, p]| ColumnOrder { t, x, y: x + 1, p, count: COLUMNS });
        let possible: Vec<_> = orders.into_iter().filter(fits).collect();
        let plausible: Vec<_> = possible.iter().copied().filter(|o| self.columns[o.t].rises).collect();
        let (many, plain) = (self.lines >= ENOUGH, ColumnOrder::PLAIN);
        match (&possible[..], &plausible[..]) {
            ([], _) => Ok(None),
            // A few lines with small numbers can fit by accident.
            (&[only], _) => Ok(Some(only).filter(|o| *o == plain || many || !self.columns[o.t].pixels)),
            (_, &[only]) if many => Ok(Some(only)),
            _ if !many && self.separator == Separator::Comma && plausible.contains(&plain) => Ok(Some(plain)),
            ([others @ .., last], _) => {
                let others: Vec<_> = others.iter().map(ToString::to_string).collect();
                Err(first.undecided("order of the columns", format!("{} or {last}", others.join(", "))))
            }
        }
    }

    /// How the times of a whole text are written.
    fn time(&self, columns: ColumnOrder, first: Line<'_>) -> Result<Time, IoError> {
        match self.columns.get(columns.t) {
            Some(column) if column.fractions && column.points => {
                if column.decimals >= DECIMALS_OF_SECONDS {
                    return Ok(Time::Pointed);
                }
                Err(first.undecided("unit of time", "seconds or milliseconds"))
            }
            _ => Ok(Time::Whole),
        }
    }
}
