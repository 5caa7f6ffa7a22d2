//! Readings of a tactile array of 24 electrodes (`BioTac SP`) from CSV, one reading per line.
//!
//! ```text
//! ff_e1,ff_e2,ff_e3, ... ,ff_e24
//! 3530,3662,3582, ... ,3119
//! ```
//!
//! The header is required, even if no row follows. The name of an electrode's column ends in `e1`
//! to `e24` or `electrode1` to `electrode24` (upper or lower case, with `_`, a space or nothing
//! before the number) after a prefix that all 24 share, such as a finger's; the columns may have
//! any order. A column `t`, `time` or `timestamp` is the time in seconds; with `_s`, `_ms`, `_us`
//! or `_ns` at its end, it is in that unit. Other columns are skipped. Fields, quotes, comments,
//! blank lines, line ends and the byte order mark are as in the CSV of events.
//!
//! Invariant: a reading is delivered as soon as its line has arrived, without allocation; its
//! values are finite.

pub(crate) mod header;

use std::io::BufRead;
use std::ops::RangeInclusive;
use std::str::FromStr;

use crate::detect::other_kind;
use crate::error::{IoError, shown};
use crate::format::Kind;
use crate::text::{Line, Lines, Separator};
pub use header::ELECTRODES;
use header::{Columns, Role, expected};

/// Relative error that the rounding of times may add to an interval.
const ROUNDING: f64 = 1e-4;

/// The values of all electrodes at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Line of the text, counted from 1.
    pub line: u64,
    /// The electrodes e1 to e24, in the sensor's counts.
    pub values: [f32; ELECTRODES],
    /// Time in seconds; `None`: the text has no column of time.
    pub time_s: Option<f64>,
}

/// The readings of a text, each as soon as its line has arrived, from a pipe or a file.
///
/// Nothing is read before the first call of `next`. No call reads beyond the line feed of its
/// reading, except for the content of the reader's own buffer. A line takes O(its length).
///
/// A row that is not a reading gives an error with its line, and the next call continues with the
/// row after it. A caller that needs every reading stops at the first error. There are no further
/// items after a bad or missing header, a line longer than [`crate::limits::LINE_BYTES`], a
/// reader's failure, or input of another kind ([`IoError::OtherKind`]). Suspicious readings are
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
    /// The row before, if it was a reading.
    before: Option<Reading>,
    follows: bool,
    ended: bool,
}

impl<R: BufRead> Electrodes<R> {
    /// The readings of `input`.
    pub fn new(input: R, settings: ElectrodeSettings) -> Self {
        Self {
            lines: Lines::new(input),
            settings,
            columns: None,
            warnings: ElectrodeWarnings::default(),
            before: None,
            follows: false,
            ended: false,
        }
    }

    /// Counts of the suspicious readings delivered so far.
    pub fn warnings(&self) -> ElectrodeWarnings {
        self.warnings
    }

    /// Whether the newest reading follows the one delivered before it, so that both can be in one
    /// window: no refused row lies between them, and their times, if any, have neither a gap
    /// ([`ElectrodeSettings::longest_gap`]) nor a step back. A repeated time is allowed, because
    /// times may be coarser than the readings. False for the first reading, and before it.
    pub fn follows(&self) -> bool {
        self.follows
    }

    /// The next reading; `ended` is false afterwards if the iteration continues.
    fn advance(&mut self) -> Result<Option<Reading>, IoError> {
        self.ended = true;
        let wrong_kind = |start: &[u8]| other_kind(start, Kind::Electrodes, Kind::ELECTRODES);
        let mut end = 1;
        while let Some(line) = self.lines.next(wrong_kind)? {
            end = line.number + 1;
            if line.text.is_empty() || line.text.starts_with(b"#") {
                continue;
            }
            let Some(columns) = &self.columns else {
                self.columns = Some(Columns::from_header(line)?);
                continue;
            };
            self.ended = false;
            // The interval across a refused row is not judged.
            let before = self.before.take();
            let reading = columns.reading(line)?;
            self.before = Some(reading);
            let last_s = before.and_then(|before| before.time_s);
            let fits = self.settings.count(&reading, last_s, &mut self.warnings);
            self.follows = fits && before.is_some();
            return Ok(Some(reading));
        }
        match self.columns {
            Some(_) => Ok(None),
            None => {
                Err(Line { text: b"", number: end }.malformed("header", expected(), "the end of the input"))
            }
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
    fn reading(&self, line: Line<'_>) -> Result<Reading, IoError> {
        let count = Separator::Comma.fields(line.text).count();
        if count != self.0.len() {
            let actual = format!("{count} in {}", shown(line.text));
            return Err(line.malformed("row", format!("{} fields", self.0.len()), actual));
        }
        let mut reading = Reading { line: line.number, values: [0.0; ELECTRODES], time_s: None };
        for (column, field) in self.0.iter().zip(Separator::Comma.fields(line.text)) {
            let Some((role, name)) = column else { continue };
            let refuse = || {
                let expected = format!("a finite number in column {}", shown(name.as_bytes()));
                line.malformed("field", expected, shown(field))
            };
            match role {
                Role::Electrode(electrode) => {
                    let value = parse(field).filter(|value: &f32| value.is_finite());
                    reading.values[*electrode] = value.ok_or_else(refuse)?;
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

/// The number in a field; f32 and f64 each round once from the text.
fn parse<T: FromStr>(field: &[u8]) -> Option<T> {
    str::from_utf8(field).ok()?.parse().ok()
}

/// The expected range and rate of readings; a reading outside of them is counted and delivered.
///
/// ```
/// use meissner_io::ElectrodeSettings;
///
/// let settings = ElectrodeSettings::default().rate_hz(50.0).rate_tolerance(0.1);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ElectrodeSettings {
    /// Range of the values, in the sensor's counts; 0 to 4095 (12 bits) by default.
    pub range: RangeInclusive<f32>,
    /// Readings per second, for a text with times; 100 by default.
    pub rate_hz: f64,
    /// Largest relative difference between an interval and `1 / rate_hz`; 0.2 by default, so that
    /// intervals from 8 to 12 ms are normal at 100 Hz.
    pub rate_tolerance: f64,
    /// Longest interval, in periods of `rate_hz`, after which a reading still follows the one
    /// before; 5 by default (50 ms at 100 Hz).
    pub longest_gap: f64,
}

impl Default for ElectrodeSettings {
    fn default() -> Self {
        Self { range: 0.0..=4095.0, rate_hz: 100.0, rate_tolerance: 0.2, longest_gap: 5.0 }
    }
}

/// Counts of the suspicious readings that were delivered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ElectrodeWarnings {
    /// Values outside [`ElectrodeSettings::range`]; a reading counts up to 24 times.
    pub values_out_of_range: u64,
    /// Readings too early or too late after the row before, unless that row was refused.
    pub rows_off_rate: u64,
    /// Readings after a gap: later than the one before by more than
    /// [`ElectrodeSettings::longest_gap`].
    pub gaps: u64,
    /// Readings with the time of the one before.
    pub times_repeated: u64,
    /// Readings with an earlier time than the one before.
    pub times_backwards: u64,
}

impl ElectrodeSettings {
    /// Sets the range of the values, in the sensor's counts.
    #[must_use]
    pub fn range(mut self, range: RangeInclusive<f32>) -> Self {
        self.range = range;
        self
    }

    /// Sets the readings per second.
    #[must_use]
    pub fn rate_hz(mut self, rate_hz: f64) -> Self {
        self.rate_hz = rate_hz;
        self
    }

    /// Sets the largest relative difference between an interval and `1 / rate_hz`.
    #[must_use]
    pub fn rate_tolerance(mut self, tolerance: f64) -> Self {
        self.rate_tolerance = tolerance;
        self
    }

    /// Sets the longest interval, in periods of `rate_hz`, between readings that follow each other.
    #[must_use]
    pub fn longest_gap(mut self, periods: f64) -> Self {
        self.longest_gap = periods;
        self
    }

    /// Counts the suspicious properties of a reading; `last_s` is the time of the row before.
    /// Returns whether it follows that row, without a gap or step back.
    fn count(&self, reading: &Reading, last_s: Option<f64>, warnings: &mut ElectrodeWarnings) -> bool {
        let outside = reading.values.iter().filter(|value| !self.range.contains(value)).count();
        warnings.values_out_of_range += outside as u64;
        let Some((last_s, now_s)) = last_s.zip(reading.time_s) else { return true };
        // In expected intervals. Times since 1970 in f64 are rounded to 0.24 us: ROUNDING is larger
        // than that and far smaller than the tolerances.
        let interval = (now_s - last_s) * self.rate_hz;
        warnings.rows_off_rate += u64::from((interval - 1.0).abs() - self.rate_tolerance > ROUNDING);
        let (gap, backwards) = (interval - self.longest_gap > ROUNDING, now_s < last_s);
        warnings.gaps += u64::from(gap);
        warnings.times_repeated += u64::from(now_s == last_s);
        warnings.times_backwards += u64::from(backwards);
        !(gap || backwards)
    }
}
