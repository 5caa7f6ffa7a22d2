//! Which field of a line is which part of an event.

use std::fmt;
use std::str::FromStr;

use super::field::{Refusal, shown};
use super::layout::TimeUnit;
use super::separator::Separator;
use crate::names;

/// What a line can have wrong: which field, and how.
pub(super) type Fault = (&'static str, Refusal);

/// The order of the columns of a text of events.
///
/// It is written as a letter for each column: `t`, `x`, `y` and `p` once each, and `_` for a column that is passed over, such
/// as `xytp` or `t_xyp`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColumnOrder {
    pub(super) t: usize,
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) p: usize,
    pub(super) count: usize,
}

impl ColumnOrder {
    /// Columns t, x, y, p.
    pub(super) const PLAIN: Self = Self { t: 0, x: 1, y: 2, p: 3, count: 4 };
    /// Most letters of an order.
    const MOST: usize = 64;

    /// Whether a line is a header: its first field starts as a name does.
    pub(super) fn is_header(line: &[u8]) -> bool {
        let first = Separator::of(line).fields(line).next().unwrap_or_default();
        first.first().is_some_and(|b| b.is_ascii_alphabetic() || *b == b'_')
    }

    /// Whether a line consists of the names of the four columns and nothing else.
    pub(super) fn is_plain_header(line: &[u8]) -> bool {
        Self::from_header(line, Separator::of(line)).is_ok_and(|(columns, _)| columns.count == 4)
    }

    /// The columns that a header names, and the unit of its time where it says one.
    pub(super) fn from_header(line: &[u8], separator: Separator) -> Result<(Self, Option<TimeUnit>), Fault> {
        let names: Vec<_> = separator.fields(line).map(<[u8]>::to_ascii_lowercase).collect();
        let find = |what, is: &dyn Fn(&[u8]) -> bool, expected: &str| {
            let mut found = names.iter().enumerate().filter(|(_, name)| is(name));
            match (found.next(), found.next()) {
                (Some((index, _)), None) => Ok(index),
                _ => Err((what, Refusal::new(format!("one column of {expected}"), line))),
            }
        };
        let one_of = |what, known: &[&str]| {
            find(what, &|name| known.iter().any(|k| name == k.as_bytes()), &known.join(", "))
        };
        let times = "t, ts, time, timestamp, each also with _s, _ms, _us or _ns";
        let t = find("column t of the header", &|name| time_column(name).0, times)?;
        let columns = Self {
            t,
            x: one_of("column x of the header", names::X)?,
            y: one_of("column y of the header", names::Y)?,
            p: one_of("column p of the header", names::POLARITY)?,
            count: names.len(),
        };
        Ok((columns, time_column(&names[t]).1))
    }

    /// The fields t, x, y and p of a line.
    pub(super) fn fields(self, separator: Separator, line: &[u8]) -> Result<[&[u8]; 4], Fault> {
        let mut parts = [&[][..]; 4];
        let mut count = 0;
        for (index, field) in separator.fields(line).enumerate() {
            let part = [self.t, self.x, self.y, self.p].iter().position(|&column| column == index);
            if let Some(part) = part {
                parts[part] = field;
            }
            count += 1;
        }
        if count != self.count {
            let expected = format!("{} fields", self.count);
            return Err(("line", Refusal { expected, actual: format!("{count} in {}", shown(line)) }));
        }
        Ok(parts)
    }
}

impl fmt::Display for ColumnOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let letters = [(self.t, 't'), (self.x, 'x'), (self.y, 'y'), (self.p, 'p')];
        let letter = |column| letters.iter().find(|(c, _)| *c == column).map_or('_', |(_, letter)| *letter);
        f.pad(&(0..self.count).map(letter).collect::<String>())
    }
}

impl FromStr for ColumnOrder {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let place = |letter| {
            let mut found = text.match_indices(letter).map(|(at, _)| at);
            found.next().filter(|_| found.next().is_none())
        };
        let known = text.len() <= Self::MOST && text.bytes().all(|b| b"txyp_".contains(&b));
        let parse = || {
            Some(Self { t: place('t')?, x: place('x')?, y: place('y')?, p: place('p')?, count: text.len() })
        };
        let expected =
            "expected the letters t, x, y and p once each, such as xytp, with _ for each other column";
        parse().filter(|_| known).ok_or_else(|| expected.to_owned())
    }
}

/// Whether `name`, in lower case, is that of a column of time, and the unit that it says.
fn time_column(name: &[u8]) -> (bool, Option<TimeUnit>) {
    let name = std::str::from_utf8(name).unwrap_or_default();
    let (stem, unit) = name.rsplit_once('_').map_or((name, None), |(stem, unit)| (stem, Some(unit)));
    let known = unit.and_then(|unit| unit.parse().ok());
    (matches!(stem, "t" | "ts" | "time" | "timestamp") && unit.is_some() == known.is_some(), known)
}
