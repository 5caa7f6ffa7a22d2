//! Readings of a tactile array of 24 electrodes (`BioTac SP`) from CSV, one reading a line.
//!
//! ```text
//! ff_e1,ff_e2,ff_e3, ... ,ff_e24
//! 3530,3662,3582, ... ,3119
//! ```
//!
//! The header is required, also where no row follows. An electrode's column ends in `e1` to `e24` or `electrode1` to
//! `electrode24` (upper or lower case, with `_`, a space or nothing between) after a prefix that all 24 share, such as
//! a finger's; the columns may stand in any order. A column `t`, `time` or `timestamp` is the time in seconds; with
//! `_s`, `_ms`, `_us` or `_ns` after it, in that unit. Other columns are passed over. Fields, quotes, comments, blank
//! lines, line ends and the byte order mark are as in the CSV of events.
//!
//! Invariant: a reading is delivered as soon as its line is there, and nothing is allocated for it; each of its values
//! is finite.

mod header;
mod settings;

use std::io::BufRead;
use std::str::FromStr;

use crate::csv::{Lines, bare, shown};
use crate::error::{IoError, Place};
use crate::format::Format;
use crate::kind::{self, Kind};

pub(crate) use header::are_named_in;
use header::{Columns, Role};
pub use settings::{ElectrodeSettings, ElectrodeWarnings};

/// Electrodes of the array.
pub const ELECTRODES: usize = 24;

/// What the electrodes read at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Line of the text, counted from 1.
    pub line: u64,
    /// The electrodes e1 to e24, in the sensor's counts.
    pub values: [f32; ELECTRODES],
    /// Time in seconds, where the text has a column for it.
    pub time_s: Option<f64>,
}

/// The readings of a text, each as soon as its line is there: for a pipe as well as for a file.
///
/// Nothing is read before the first call of `next`, and no call reads beyond the line feed of its reading, other
/// than what the reader's own buffer holds. A line takes O(its length).
///
/// A row that is no reading gives an error with its line, and the next call goes on with the row after it; a caller
/// who wants all or nothing stops at the first error. After a bad header or none, a line of more than
/// [`crate::limits::LINE_BYTES`], a reader's failure or an input of another kind ([`IoError::OtherKind`]) there are no more items. What is suspicious but can be read is
/// delivered and counted in [`Self::warnings`].
///
/// ```
/// use meissner_io::{ElectrodeSettings, Electrodes};
///
/// let names: Vec<String> = (1..=24).map(|e| format!("ff_e{e}")).collect();
/// let text = format!("{}\n{}\n", names.join(","), ["3500"; 24].join(","));
/// let mut readings = Electrodes::new(text.as_bytes(), ElectrodeSettings::default());
/// let reading = readings.next().expect("one row")?;
/// assert_eq!((reading.line, reading.values, reading.time_s), (2, [3500.0; 24], None));
/// assert_eq!(readings.warnings().values_out_of_range, 0);
/// # Ok::<(), meissner_io::IoError>(())
/// ```
#[derive(Debug)]
pub struct Electrodes<R: BufRead> {
    lines: Lines<R>,
    settings: ElectrodeSettings,
    columns: Option<Columns>,
    warnings: ElectrodeWarnings,
    /// Time of the row before, where that was a reading with a time.
    last_s: Option<f64>,
    /// Whether the row before was a reading.
    unbroken: bool,
    follows: bool,
    ended: bool,
}

impl<R: BufRead> Electrodes<R> {
    /// The readings of `input`.
    pub fn new(input: R, settings: ElectrodeSettings) -> Self {
        let lines = Lines::new(input);
        let warnings = ElectrodeWarnings::default();
        Self {
            lines,
            settings,
            columns: None,
            warnings,
            last_s: None,
            unbroken: false,
            follows: false,
            ended: false,
        }
    }

    /// What was suspicious in the readings that have been delivered so far.
    pub fn warnings(&self) -> ElectrodeWarnings {
        self.warnings
    }

    /// Whether the reading that was delivered last follows the one delivered before it, so that both may stand in a
    /// window: no refused row lies between them, and where both have times, neither a gap
    /// ([`ElectrodeSettings::longest_gap`]) nor a step back in time. A repeated time does not part them, because times
    /// may be coarser than the readings. False for the first reading, and where none has been delivered.
    pub fn follows(&self) -> bool {
        self.follows
    }

    /// The next reading; what ends the iteration sets `ended`.
    fn advance(&mut self) -> Result<Option<Reading>, IoError> {
        let mut end = 1;
        loop {
            self.ended = true;
            let is_first = self.lines.number() == 0;
            let next = match self.lines.next() {
                Ok(None) if self.columns.is_some() => return Ok(None),
                Ok(None) => return Err(no_header(end)),
                next => next.map(drop),
            };
            // What has no lines, or a first line of another kind, may be no text.
            if is_first && let Some(error) = other_kind(self.lines.raw()) {
                return Err(error);
            }
            next?;
            let (line, number) = self.lines.current();
            end = number + 1;
            if line.is_empty() || line.starts_with(b"#") {
                continue;
            }
            let Some(columns) = &self.columns else {
                self.columns = Some(Columns::from_header(line, number)?);
                continue;
            };
            self.ended = false;
            // Across a row that is refused there is no interval to be judged.
            let last_s = self.last_s.take();
            let unbroken = std::mem::take(&mut self.unbroken);
            let reading = columns.reading(line, number)?;
            self.last_s = reading.time_s;
            self.unbroken = true;
            self.follows = self.settings.count(&reading, last_s, &mut self.warnings) && unbroken;
            return Ok(Some(reading));
        }
    }
}

impl<R: BufRead> Iterator for Electrodes<R> {
    type Item = Result<Reading, IoError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended { None } else { self.advance().transpose() }
    }
}

impl Columns {
    /// The reading of a row.
    fn reading(&self, line: &[u8], number: u64) -> Result<Reading, IoError> {
        let count = line.split(|&b| b == b',').count();
        if count != self.count() {
            let (expected, actual) =
                (format!("{} fields", self.count()), format!("{count} in {}", shown(line)));
            return Err(malformed("row", number, expected, actual));
        }
        let mut reading = Reading { line: number, values: [0.0; ELECTRODES], time_s: None };
        for (index, field) in line.split(|&b| b == b',').enumerate() {
            let Some((role, name)) = self.role(index) else { continue };
            let refuse = || {
                let expected = format!("a finite number in column {}", shown(name.as_bytes()));
                malformed("field", number, expected, shown(bare(field)))
            };
            match role {
                Role::Electrode(electrode) => {
                    let value = parse(field).filter(|value: &f32| value.is_finite());
                    reading.values[electrode] = value.ok_or_else(refuse)?;
                }
                Role::Time { seconds } => {
                    let value = parse(field).filter(|value: &f64| value.is_finite());
                    reading.time_s = Some(value.ok_or_else(refuse)? * seconds);
                }
            }
        }
        Ok(reading)
    }
}

/// The number that a field is; each type rounds for itself.
fn parse<T: FromStr>(field: &[u8]) -> Option<T> {
    str::from_utf8(bare(field)).ok()?.parse().ok()
}

/// The error of an input that starts with `start`, where that is of another kind.
fn other_kind(start: &[u8]) -> Option<IoError> {
    let found = Kind::of(start).filter(|kind| *kind != Kind::Electrodes)?;
    Some(IoError::OtherKind { expected: kind::ELECTRODES, found })
}

/// The input ended at line `number` without a header.
fn no_header(number: u64) -> IoError {
    malformed("header", number, header::expected(), "the end of the input".to_owned())
}

fn malformed(what: &'static str, line: u64, expected: String, actual: String) -> IoError {
    IoError::Malformed { format: Format::Csv, what, place: Place::Line(line), expected, actual }
}
