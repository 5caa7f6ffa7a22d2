//! Lines without a header in, the orders of columns that fit them out.
//!
//! A column can be x or y where all its values are whole and from 0 to 65535 (and on the sensor that a comment names), the
//! polarity where all are 0, 1, -1 or booleans, and the time where all are numbers. y follows x. An order that fits
//! every line is possible; of several possible ones, those are plausible whose time never steps back.
//!
//! Taken is, of all lines of a text:
//! 1. the only possible order, where it is t, x, y, p, or its time cannot be a pixel, or there are [`ENOUGH`] lines or more;
//! 2. else the only plausible one, where there are so many: columns and rows of pixels do not rise over so many;
//! 3. else t, x, y, p where it is plausible, commas separate, and there are fewer lines.
//!
//! Otherwise the text is undecided, and the caller has to say. Of the first line of a stream, t, x, y, p is taken where it is possible
//! and commas separate, else the only possible order as in 1.

use meissner_engine::Sensor;

use super::columns::ColumnOrder;
use super::field::{Number, coordinate, polarity};
use super::layout::{DECIMALS_OF_SECONDS, Time, Wrong};
use super::separator::Separator;

/// Lines over which the order of times is evidence.
const ENOUGH: usize = 16;
/// Columns of a text without a header.
const COLUMNS: usize = 4;

/// Columns of t, x and p in the orders that there are where y follows x.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 3], [2, 0, 3], [3, 0, 2], [0, 2, 1], [1, 2, 0], [3, 1, 0]];

/// What the values of a column have in common.
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
    /// All that are not 0 have a point.
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
        self.polarities &= polarity(field).is_ok();
        match coordinate(field) {
            Ok(pixel) => self.largest = self.largest.max(pixel),
            Err(_) => self.pixels = false,
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

    fn on(&self, side: Option<u16>) -> bool {
        self.pixels && side.is_none_or(|side| self.largest < side)
    }
}

/// What is found.
pub(super) enum Choice {
    One(ColumnOrder),
    /// Several, in words.
    Several(String),
    /// None that fits, or only one that is not certain: the lines are at fault.
    None,
}

/// What lines of one text say.
pub(super) struct Evidence {
    separator: Separator,
    columns: Vec<Column>,
    lines: usize,
}

impl Evidence {
    pub(super) fn new(separator: Separator) -> Self {
        Self { separator, columns: Vec::new(), lines: 0 }
    }

    /// What one line says.
    pub(super) fn of(separator: Separator, line: &[u8]) -> Self {
        let mut evidence = Self::new(separator);
        evidence.add(line);
        evidence
    }

    /// Takes a line; one that has other fields than the first, or words in place of values, says nothing: it is refused later.
    pub(super) fn add(&mut self, line: &[u8]) {
        let fields = || self.separator.fields(line);
        let count = fields().count();
        if self.lines == 0 && self.columns.is_empty() {
            self.columns = vec![Column::EMPTY; count];
        }
        let words = || fields().any(|field| Number::parse(field).is_none() && polarity(field).is_err());
        if count != self.columns.len() || (count == COLUMNS && words()) {
            return;
        }
        for (column, field) in self.columns.iter_mut().zip(self.separator.fields(line)) {
            column.add(field);
        }
        self.lines += 1;
    }

    /// The orders that fit every line.
    fn possible(&self, sensor: Option<Sensor>) -> Vec<ColumnOrder> {
        if self.columns.len() != COLUMNS || self.lines == 0 {
            return Vec::new();
        }
        let orders = ORDERS.map(|[t, x, p]| ColumnOrder { t, x, y: x + 1, p, count: COLUMNS });
        let fits = |order: &ColumnOrder| {
            self.columns[order.t].numbers
                && self.columns[order.p].polarities
                && self.columns[order.x].on(sensor.map(|sensor| sensor.width))
                && self.columns[order.y].on(sensor.map(|sensor| sensor.height))
        };
        orders.into_iter().filter(fits).collect()
    }

    /// Whether the only possible `order` is no accident of few lines with small numbers.
    fn is_certain(&self, order: ColumnOrder) -> bool {
        order == ColumnOrder::PLAIN || self.lines >= ENOUGH || !self.columns[order.t].pixels
    }

    /// The order of a whole text.
    pub(super) fn columns(&self, sensor: Option<Sensor>) -> Choice {
        let possible = self.possible(sensor);
        let plausible: Vec<_> = possible.iter().copied().filter(|o| self.columns[o.t].rises).collect();
        let plain = self.separator == Separator::Comma && plausible.contains(&ColumnOrder::PLAIN);
        match (&possible[..], &plausible[..]) {
            ([], _) => Choice::None,
            (&[one], _) => {
                if self.is_certain(one) {
                    Choice::One(one)
                } else {
                    Choice::None
                }
            }
            (_, &[one]) if self.lines >= ENOUGH => Choice::One(one),
            _ if plain && self.lines < ENOUGH => Choice::One(ColumnOrder::PLAIN),
            _ => several(&possible),
        }
    }

    /// The order of a stream of which nothing is known but its first line.
    pub(super) fn first_line(&self, sensor: Option<Sensor>) -> Choice {
        let possible = self.possible(sensor);
        match possible[..] {
            [] => Choice::None,
            [one] => {
                if self.is_certain(one) {
                    Choice::One(one)
                } else {
                    Choice::None
                }
            }
            _ if self.separator == Separator::Comma && possible.contains(&ColumnOrder::PLAIN) => {
                Choice::One(ColumnOrder::PLAIN)
            }
            _ => several(&possible),
        }
    }

    /// How the times of a whole text are written.
    pub(super) fn time(&self, columns: ColumnOrder) -> Result<Time, Wrong> {
        match self.columns.get(columns.t) {
            Some(column) if column.fractions && column.points => {
                if column.decimals >= DECIMALS_OF_SECONDS {
                    return Ok(Time::Pointed);
                }
                Err(Wrong::Undecided("unit of time", "seconds or milliseconds".to_owned()))
            }
            _ => Ok(Time::Whole),
        }
    }
}

fn several(orders: &[ColumnOrder]) -> Choice {
    let names: Vec<_> = orders.iter().map(ToString::to_string).collect();
    let (last, others) = names.split_last().expect("several orders");
    Choice::Several(format!("{} or {last}", others.join(", ")))
}
