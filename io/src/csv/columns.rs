//! The columns of a text of events: order, unit of the times, coordinates and polarities.

use std::fmt;
use std::str::FromStr;

use meissner_engine::Sensor;

use crate::error::{IoError, shown};
use crate::format::{POLARITY, UnknownName, X, Y};
use crate::text::{Line, Number, Separator, content_lines, is_json, text_start};

/// The letters of an order of columns.
const LETTERS: [char; 4] = ['t', 'x', 'y', 'p'];

/// The order of the columns of a text of events.
///
/// It is written as one letter per column: `t`, `x`, `y` and `p` once each, and `_` for a column
/// that is skipped, such as `xytp` or `t_xyp`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColumnOrder {
    /// The columns of t, x, y and p.
    pub(super) at: [usize; 4],
    pub(super) count: usize,
}

/// The content of the header of a text.
pub(super) struct Header {
    pub(super) columns: ColumnOrder,
    /// The unit of the times, if it names one.
    pub(super) unit: Option<TimeUnit>,
    /// The sensor, if the names of x and y contain its sides: `x@346,y@260`.
    pub(super) sensor: Option<Sensor>,
}

impl ColumnOrder {
    /// Columns t, x, y, p.
    pub(super) const PLAIN: Self = Self { at: [0, 1, 2, 3], count: 4 };
    /// Columns x, y, p, t, which Metavision's programs write without a header.
    pub(super) const METAVISION: Self = Self { at: [3, 0, 1, 2], count: 4 };
    /// Longest order, in letters.
    const MAX: usize = 64;

    /// Whether a line is a header: its first field starts like a name.
    pub(super) fn is_header(line: &[u8]) -> bool {
        let first = Separator::of(line).fields(line).next().unwrap_or_default();
        first.first().is_some_and(|b| b.is_ascii_alphabetic() || *b == b'_')
    }

    /// Whether a line consists of the names of the four columns and nothing else.
    pub(super) fn is_plain_header(line: Line<'_>) -> bool {
        Self::from_header(line, Separator::of(line.text)).is_ok_and(|header| header.columns.count == 4)
    }

    /// The content of a header.
    pub(super) fn from_header(line: Line<'_>, separator: Separator) -> Result<Header, IoError> {
        let fields: Vec<_> = separator.fields(line.text).map(<[u8]>::to_ascii_lowercase).collect();
        // A side of the sensor may follow the names of x and y: `x@346`.
        let parts = |field: &Vec<u8>| {
            let at = field.iter().position(|&byte| byte == b'@');
            at.map_or((field.clone(), None), |at| (field[..at].to_vec(), Some(field[at + 1..].to_vec())))
        };
        let (names, sides): (Vec<_>, Vec<_>) = fields.iter().map(parts).unzip();
        let find = |what, is: &dyn Fn(&[u8]) -> bool, expected: &str| {
            let mut found = names.iter().enumerate().filter(|(_, name)| is(name));
            match (found.next(), found.next()) {
                (Some((index, _)), None) => Ok(index),
                _ => Err(line.malformed(what, format!("one column of {expected}"), shown(line.text))),
            }
        };
        let one_of = |what, known: &[&str]| {
            find(what, &|name| known.iter().any(|k| name == k.as_bytes()), &known.join(", "))
        };
        let times = "t, ts, time, timestamp, each also with _s, _ms, _us or _ns";
        let t = find("column t of the header", &|name| time_column(name).0, times)?;
        let (x, y) = (one_of("column x of the header", X)?, one_of("column y of the header", Y)?);
        let p = one_of("column p of the header", POLARITY)?;
        let side = |column: usize| {
            let Some(text) = &sides[column] else { return Ok(None) };
            let side =
                str::from_utf8(text).ok().and_then(|text| text.parse().ok()).filter(|&side: &u16| side > 0);
            let refuse =
                || line.malformed("side of the sensor in the header", "1 to 65535 pixels", shown(text));
            side.map(Some).ok_or_else(refuse)
        };
        let sensor = side(x)?.zip(side(y)?).map(|(width, height)| Sensor { width, height });
        let columns = Self { at: [t, x, y, p], count: names.len() };
        Ok(Header { columns, unit: time_column(&names[t]).1, sensor })
    }

    /// The fields t, x, y and p of a line.
    pub(super) fn fields(self, separator: Separator, line: Line<'_>) -> Result<[&[u8]; 4], IoError> {
        let mut parts = [&[][..]; 4];
        let mut count = 0;
        for (index, field) in separator.fields(line.text).enumerate() {
            if let Some(part) = self.at.iter().position(|&column| column == index) {
                parts[part] = field;
            }
            count += 1;
        }
        if count != self.count {
            let actual = format!("{count} in {}", shown(line.text));
            return Err(line.malformed("line", format!("{} fields", self.count), actual));
        }
        Ok(parts)
    }
}

impl fmt::Display for ColumnOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let letter = |index| self.at.iter().position(|&at| at == index).map_or('_', |part| LETTERS[part]);
        f.pad(&(0..self.count).map(letter).collect::<String>())
    }
}

impl FromStr for ColumnOrder {
    type Err = UnknownName;

    fn from_str(text: &str) -> Result<Self, UnknownName> {
        let is_known = text.len() <= Self::MAX && text.bytes().all(|b| b"txyp_".contains(&b));
        let once = |letter| text.find(letter).filter(|at| text.rfind(letter) == Some(*at));
        match LETTERS.map(once) {
            [Some(t), Some(x), Some(y), Some(p)] if is_known => {
                Ok(Self { at: [t, x, y, p], count: text.len() })
            }
            _ => {
                let expected =
                    "the letters t, x, y and p once each, such as xytp, with _ for each other column";
                Err(UnknownName::new("order of columns", expected, text))
            }
        }
    }
}

/// The unit of the times of a text.
///
/// Times are rounded to whole microseconds without floats, halves away from zero.
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
    const ALL: [Self; 4] = [Self::Seconds, Self::Milliseconds, Self::Microseconds, Self::Nanoseconds];

    /// The unit's name, and the power of ten that converts it to microseconds.
    pub(crate) const fn name_and_power(self) -> (&'static str, i32) {
        match self {
            Self::Seconds => ("s", 6),
            Self::Milliseconds => ("ms", 3),
            Self::Microseconds => ("us", 0),
            Self::Nanoseconds => ("ns", -3),
        }
    }
}

impl fmt::Display for TimeUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name_and_power().0)
    }
}

impl FromStr for TimeUnit {
    type Err = UnknownName;

    /// The unit of this name: `s`, `ms`, `us` or `ns`.
    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let found = Self::ALL.into_iter().find(|unit| unit.name_and_power().0 == name);
        found.ok_or_else(|| UnknownName::new("unit of time", "s, ms, us or ns", name))
    }
}

/// Whether `name`, in lower case, is a name of the time, and the unit in the name.
fn time_column(name: &[u8]) -> (bool, Option<TimeUnit>) {
    let name = std::str::from_utf8(name).unwrap_or_default();
    let (stem, unit) = name.rsplit_once('_').map_or((name, None), |(stem, unit)| (stem, Some(unit)));
    let known = unit.and_then(|unit| unit.parse().ok());
    (matches!(stem, "t" | "ts" | "time" | "timestamp") && unit.is_some() == known.is_some(), known)
}

/// A column or row: a whole number from 0 to 65535.
pub(super) fn coordinate(field: &[u8]) -> Option<u16> {
    Number::parse(field)?.whole()?.try_into().ok()
}

/// A polarity: whether the brightness rose.
pub(super) fn polarity(field: &[u8]) -> Option<bool> {
    match field {
        b"1" | b"+1" => return Some(true),
        b"0" | b"-1" => return Some(false),
        _ => {}
    }
    match Number::parse(field).and_then(Number::whole) {
        Some(1) => Some(true),
        Some(0 | -1) => Some(false),
        _ if field.eq_ignore_ascii_case(b"true") => Some(true),
        _ if field.eq_ignore_ascii_case(b"false") => Some(false),
        _ => None,
    }
}

/// Whether `line` can only be an event, or the header of events.
pub(crate) fn is_of_events(line: &[u8]) -> bool {
    let separator = Separator::of(line);
    let numbers = separator.fields(line).filter(|field| Number::parse(field).is_some()).count();
    ColumnOrder::from_header(Line { text: line, number: 0 }, separator).is_ok()
        || (numbers == 4 && separator.fields(line).count() == 4)
}

/// Whether `bytes` may be a text of events: no control characters, and the first line after a size
/// has a comma or can only be an event or a header, and does not begin like JSON.
pub(crate) fn is_csv(bytes: &[u8]) -> bool {
    let Some(text) = text_start(bytes) else { return false };
    let mut lines = content_lines(text);
    let Some(first) = lines.next() else { return text.starts_with(b"#") };
    let numbers = |line: &[u8]| Separator::Blanks.fields(line).all(|field| Number::parse(field).is_some());
    let is_size = Separator::Blanks.fields(first).count() == 2 && numbers(first);
    !is_json(first)
        && (first.contains(&b',')
            || is_of_events(first)
            || (is_size && lines.next().is_some_and(is_of_events)))
}
