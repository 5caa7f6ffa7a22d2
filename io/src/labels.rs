//! Tables of labels: CSV with one row per labelled instant.
//!
//! ```text
//! recording,t_us,roll_deg,force_n,material
//! press1.aedat4,120000,3.5,1.2,wood
//! ```
//!
//! The header is required. Its names (upper or lower case) give the meaning of a column:
//!
//! | column | meaning |
//! |---|---|
//! | `recording`, `file`, `filename` | the recording that the row is about |
//! | `t_us`, also `ts`, `time`, `timestamp` | a time of the sensor's clock |
//! | `host_us`, also `host_t`, `host_time` | a time of the host's clock |
//! | no name | skipped, such as the index that pandas writes |
//! | any other | a label, with its unit at the end (`roll_deg`) or in brackets (`force [N]`) |
//!
//! A time has the unit `_s`, `_ms`, `_us` or `_ns`. If there are times of both clocks, the sensor's
//! time counts in rows that name a recording, and the host's time in other rows. Times are rounded
//! to microseconds without floats, halves away from zero.
//!
//! Commas, semicolons or tabs separate fields, as in the header; with semicolons and tabs, numbers
//! may have a decimal comma. Quotes around a field, doubled quotes in it, comments (`#`, `%`),
//! blank lines, rows of empty fields, the line `sep=;`, both kinds of line end and a byte order
//! mark are accepted.
//!
//! A label has classes if its name is `class` or `.._class`, or if most of its values are not
//! numbers. Empty fields and `nan` are missing values. In a label of numbers, infinities and the
//! words `null`, `none`, `na` and `n/a` are missing values too; in a label of classes, these words
//! may be names.

mod fields;
mod header;

use std::collections::HashMap;
use std::path::Path;

use crate::error::{IoError, shown};
use crate::files::{compare, read_whole};
use crate::format::Kind;
use crate::text::{BYTE_ORDER_MARK, Line, Lines, Number, is_comment};
use fields::Separator;
pub use header::LabelClock;
use header::{Column, Header};

const EXPECTED: &str = "a table of labels as CSV in UTF-8";

/// A table of labels: rows in the order of the text. Every list has an entry for each row.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelTable {
    /// The clock of the times; `None`: there is no column of times.
    pub clock: Option<LabelClock>,
    /// The recording that each row names; `None`: there is no such column.
    pub recordings: Option<Vec<String>>,
    /// The time of each row in microseconds; `None`: the field is empty, or there is no column.
    pub times_us: Vec<Option<i64>>,
    /// The line of each row, counted from 1.
    pub lines: Vec<u64>,
    /// The labels, in the order of the columns.
    pub labels: Vec<LabelColumn>,
}

/// A label with its value in each row.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelColumn {
    /// Its name, without the unit; no two labels have the same.
    pub name: String,
    /// Its unit, if the header names one: "deg", "N".
    pub unit: Option<String>,
    /// Its values.
    pub values: LabelValues,
    /// Rows of a label of numbers whose field is not a number, with the start of the field.
    pub refused: Vec<(usize, String)>,
}

/// The values of a label, row by row.
#[derive(Clone, Debug, PartialEq)]
pub enum LabelValues {
    /// Finite numbers; NaN: the value is missing or refused.
    Numbers(Vec<f64>),
    /// Names of the classes in natural order, and the class of each row, if it has one.
    Classes {
        /// The names.
        names: Vec<String>,
        /// Index of the class.
        of: Vec<Option<u32>>,
    },
}

impl LabelTable {
    /// Reads the table in the file at `path`.
    ///
    /// # Errors
    /// [`IoError`] with the path, if the file cannot be read or is not a table of labels.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, IoError> {
        let path = path.as_ref();
        Self::parse(&read_whole(path)?).map_err(IoError::content(path))
    }

    /// Reads a table from its text. O(bytes): a field takes at most 12 bytes in addition to its
    /// own.
    ///
    /// # Errors
    /// [`IoError`], with the line and the column of a text: a header without a label or with
    /// neither recording nor time, two columns of one name, a row with another number of fields, an
    /// invalid time, a line longer than [`crate::limits::LINE_BYTES`], no row, input of another
    /// kind.
    pub fn parse(bytes: &[u8]) -> Result<Self, IoError> {
        if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
            return Err(IoError::Unsupported { expected: EXPECTED, actual: "UTF-16".to_owned() });
        }
        if let Some(found @ (Kind::Foreign(_) | Kind::Picture(_))) = Kind::of(bytes) {
            return Err(IoError::OtherKind { expected: EXPECTED, found });
        }
        let mut lines = Lines::new(bytes);
        let mut builder: Option<Builder> = None;
        let mut end = 1;
        while let Some(number) = lines.next(|_| None)?.map(|line| line.number) {
            end = number + 1;
            // The line with all its tabs, which separate empty fields.
            let line = content(lines.raw(), number);
            let trimmed = line.text.trim_ascii();
            if trimmed.is_empty() || is_comment(trimmed) {
                continue;
            }
            match &mut builder {
                None if trimmed.len() == 5 && trimmed[..4].eq_ignore_ascii_case(b"sep=") => {}
                None => builder = Some(Builder::new(line)?),
                Some(builder) => builder.row(line)?,
            }
        }
        let nothing = Line { text: b"", number: end };
        let builder = builder.ok_or_else(|| nothing.malformed("header", header::EXPECTED, "the end"))?;
        if builder.lines.is_empty() {
            return Err(nothing.malformed("row", "at least one row below the header", "the end"));
        }
        Ok(builder.table())
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.lines.len()
    }

    /// The label of this name.
    pub fn label(&self, name: &str) -> Option<&LabelColumn> {
        self.labels.iter().find(|label| label.name == name)
    }
}

impl LabelColumn {
    /// The value in `row` as a number; a class is its index. `None`: it is missing.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn value(&self, row: usize) -> Option<f64> {
        match &self.values {
            LabelValues::Numbers(values) => Some(values[row]).filter(|value| !value.is_nan()),
            LabelValues::Classes { of, .. } => of[row].map(f64::from),
        }
    }

    /// The names of its classes; none for a label of numbers.
    pub fn classes(&self) -> &[String] {
        match &self.values {
            LabelValues::Numbers(_) => &[],
            LabelValues::Classes { names, .. } => names,
        }
    }
}

/// A line without its end, and without the byte order mark.
fn content(raw: &[u8], number: u64) -> Line<'_> {
    let text = raw.strip_suffix(b"\n").unwrap_or(raw);
    let text = text.strip_suffix(b"\r").unwrap_or(text);
    let text = if number == 1 { text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text) } else { text };
    Line { text, number }
}

/// The rows so far.
struct Builder {
    separator: Separator,
    header: Header,
    lines: Vec<u64>,
    recordings: Vec<String>,
    times_us: Vec<Option<i64>>,
    values: Vec<Values>,
}

/// The values of a label so far.
#[derive(Default)]
struct Values {
    /// NaN if there is a text or nothing.
    numbers: Vec<f64>,
    /// For each row the number of its text, counted from 1; 0: it has none.
    texts: Vec<u32>,
    names: Vec<String>,
    known: HashMap<String, u32>,
    /// Rows with a word that is a missing value in a label of numbers.
    words: Vec<usize>,
    /// Whether every value is kept as a text.
    is_class: bool,
}

impl Builder {
    fn new(line: Line<'_>) -> Result<Self, IoError> {
        let separator = Separator::of(line.text);
        let header = Header::of(line, &separator.fields(line)?)?;
        let values = header.labels.iter().map(|label| Values {
            is_class: label.name == "class" || label.name.ends_with("_class"),
            ..Values::default()
        });
        let values = values.collect();
        Ok(Self {
            separator,
            header,
            lines: Vec::new(),
            recordings: Vec::new(),
            times_us: Vec::new(),
            values,
        })
    }

    fn row(&mut self, line: Line<'_>) -> Result<(), IoError> {
        let fields = self.separator.fields(line)?;
        if fields.iter().all(|field| field.is_empty()) {
            return Ok(());
        }
        let columns = self.header.columns.len();
        let is_wide = fields.iter().skip(columns).any(|field| !field.is_empty());
        if fields.len() < self.header.named || is_wide {
            let found = format!("{} in {}", fields.len(), shown(line.text));
            return Err(line.malformed("row", format!("{columns} fields, as the header has"), found));
        }
        let (mut time, mut recording) = (None, String::new());
        for (index, (field, column)) in fields.iter().zip(&self.header.columns).enumerate() {
            match *column {
                Column::Recording => recording = String::from_utf8_lossy(field).into_owned(),
                Column::Time { power } if !is_missing(field) => {
                    let number = self.separator.number(field);
                    let us = Number::parse(&number).and_then(|number| number.scaled(power));
                    let us = us.and_then(|us| i64::try_from(us).ok()).ok_or_else(|| {
                        let found = format!("{} in column {}", shown(field), index + 1);
                        line.malformed("time", "a number of its unit within 63 bits of microseconds", found)
                    })?;
                    time = Some(us);
                }
                Column::Skipped | Column::Time { .. } => {}
                Column::Label(label) => self.values[label].push(field, self.separator),
            }
        }
        if self.header.has_recording {
            if recording.is_empty() {
                let found = format!("none in {}", shown(line.text));
                return Err(line.malformed("row", "the name of a recording", found));
            }
            self.recordings.push(recording);
        } else if time.is_none() {
            let found = format!("none in {}", shown(line.text));
            return Err(line.malformed("row", "a time, as no column names recordings", found));
        }
        self.times_us.push(time);
        self.lines.push(line.number);
        Ok(())
    }

    fn table(self) -> LabelTable {
        let labels = self.header.labels.into_iter().zip(self.values);
        LabelTable {
            clock: self.header.clock,
            recordings: self.header.has_recording.then_some(self.recordings),
            times_us: self.times_us,
            lines: self.lines,
            labels: labels.map(|(label, values)| values.column(label.name, label.unit)).collect(),
        }
    }
}

impl Values {
    fn push(&mut self, field: &[u8], separator: Separator) {
        let (mut number, mut text) = (f64::NAN, 0);
        if !is_missing(field) {
            let written = separator.number(field);
            let parsed = str::from_utf8(&written).ok();
            let parsed = parsed.and_then(|text| text.parse::<f64>().ok()).filter(|value| value.is_finite());
            if let Some(value) = parsed.filter(|_| !self.is_class) {
                number = value;
            } else {
                text = self.text(String::from_utf8_lossy(field).into_owned());
                if is_word(field) {
                    self.words.push(self.texts.len());
                }
            }
        }
        self.numbers.push(number);
        self.texts.push(text);
    }

    /// The number, from 1, of a text.
    fn text(&mut self, text: String) -> u32 {
        if let Some(&known) = self.known.get(&text) {
            return known;
        }
        self.names.push(text.clone());
        let number = self.names.len() as u32;
        self.known.insert(text, number);
        number
    }

    fn column(mut self, name: String, unit: Option<String>) -> LabelColumn {
        let texts = self.texts.iter().filter(|&&text| text > 0).count() - self.words.len();
        let numbers = self.numbers.iter().filter(|value| !value.is_nan()).count();
        let only_words = numbers == 0 && !self.words.is_empty();
        if !self.is_class && texts <= numbers && !only_words {
            let is_word = |row: usize| self.words.binary_search(&row).is_ok();
            let odd = self.texts.iter().enumerate().filter(|(row, text)| **text > 0 && !is_word(*row));
            let start = |text: u32| self.names[text as usize - 1].chars().take(40).collect();
            let refused = odd.map(|(row, &text)| (row, start(text))).collect();
            return LabelColumn { name, unit, values: LabelValues::Numbers(self.numbers), refused };
        }
        for row in 0..self.numbers.len() {
            if !self.numbers[row].is_nan() {
                self.texts[row] = self.text(self.numbers[row].to_string());
            }
        }
        let mut order: Vec<usize> = (0..self.names.len()).collect();
        order.sort_by(|&a, &b| compare(self.names[a].as_bytes(), self.names[b].as_bytes()));
        let mut rank = vec![0; order.len()];
        order.iter().zip(0..).for_each(|(&name, index)| rank[name] = index);
        let of = self.texts.iter().map(|&text| Some(rank[(text as usize).checked_sub(1)?])).collect();
        let names = order.iter().map(|&name| std::mem::take(&mut self.names[name])).collect();
        LabelColumn { name, unit, values: LabelValues::Classes { names, of }, refused: Vec::new() }
    }
}

/// Whether a field is a missing value.
fn is_missing(field: &[u8]) -> bool {
    field.is_empty() || field.eq_ignore_ascii_case(b"nan") || field.eq_ignore_ascii_case(b"-nan")
}

/// Whether a field is a missing value in a label of numbers.
fn is_word(field: &[u8]) -> bool {
    const WORDS: [&[u8]; 8] = [b"null", b"none", b"na", b"n/a", b"inf", b"+inf", b"-inf", b"infinity"];
    WORDS.iter().any(|word| field.eq_ignore_ascii_case(word))
}
