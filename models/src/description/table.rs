//! Reads one TOML table key by key.
//!
//! Input: a parsed table with spans. Output: typed values, and a problem for each key that is
//! missing, unknown, mistyped or out of range. Invariant: `None` or a substitute for a required or
//! mistyped value comes with a problem, which need not be reported again.

use std::ops::RangeInclusive;

use toml::de::{DeArray, DeTable, DeValue};

use super::problem::{ProblemKind, Problems};

/// Longest name of a network, a layer or an output.
const MAX_NAME: usize = 80;
/// The values that [`name`] accepts.
pub(super) const NAME: &str = "a name of 1 to 80 printable characters";

/// A value and its line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spanned<T> {
    pub(super) value: T,
    pub(super) line: usize,
}

/// Turns offsets into line numbers.
#[derive(Debug)]
pub(super) struct Lines {
    /// Offset of each line's first byte.
    starts: Vec<usize>,
}

impl Lines {
    pub(super) fn new(text: &str) -> Self {
        let after_breaks = text.bytes().enumerate().filter(|&(_, b)| b == b'\n').map(|(i, _)| i + 1);
        Self { starts: std::iter::once(0).chain(after_breaks).collect() }
    }

    /// Line of byte `offset`, counted from 1.
    pub(super) fn of(&self, offset: usize) -> usize {
        self.starts.partition_point(|&start| start <= offset)
    }
}

/// A table whose keys are read one after the other.
pub(super) struct Table<'t, 'i> {
    entries: &'t DeTable<'i>,
    lines: &'t Lines,
    line: usize,
    layer: Option<String>,
    asked: Vec<&'static str>,
    /// Number of values that were missing or refused and have no obvious substitute.
    unknown: usize,
    problems: &'t mut Problems,
}

impl<'t, 'i> Table<'t, 'i> {
    pub(super) fn root(entries: &'t DeTable<'i>, lines: &'t Lines, problems: &'t mut Problems) -> Self {
        Self { entries, lines, line: 1, layer: None, asked: Vec::new(), unknown: 0, problems }
    }

    /// A table within this one, whose problems concern `layer`.
    fn within<'s>(
        &'s mut self,
        entries: &'s DeTable<'i>,
        line: usize,
        layer: Option<String>,
    ) -> Table<'s, 'i> {
        let Self { lines, problems, .. } = self;
        Table { entries, lines, line, layer, asked: Vec::new(), unknown: 0, problems }
    }

    /// The table under `key`, which must exist.
    pub(super) fn table(&mut self, key: &'static str, expected: &str) -> Option<Table<'_, 'i>> {
        let Spanned { value, line } = self.required(key, expected, DeValue::as_table)?;
        Some(self.within(value, line, None))
    }

    /// The layer that is the entry `value` of `list`; anything but a table is reported.
    pub(super) fn layer(
        &mut self,
        list: &'static str,
        value: &'t toml::Spanned<DeValue<'i>>,
    ) -> Option<Table<'_, 'i>> {
        let line = self.line_at(value);
        let Some(entries) = value.get_ref().as_table() else {
            self.refuse(line, list, format!("a table [[{list}]]"), shown(value.get_ref()));
            return None;
        };
        let layer = entries.get("name").and_then(|value| name(value.get_ref()));
        Some(self.within(entries, line, layer))
    }

    pub(super) fn report(&mut self, line: usize, kind: ProblemKind) {
        self.problems.add(line, self.layer.as_deref(), kind);
    }

    /// Reports that the value of `key` at `line` is not as expected.
    pub(super) fn refuse(
        &mut self,
        line: usize,
        key: &'static str,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) {
        self.report(line, ProblemKind::value(key, expected, found));
    }

    pub(super) fn line(&self) -> usize {
        self.line
    }

    pub(super) fn line_at(&self, value: &toml::Spanned<DeValue<'_>>) -> usize {
        self.lines.of(value.span().start)
    }

    /// The line of `key`, if the table has it.
    pub(super) fn line_of(&self, key: &str) -> Option<usize> {
        self.entries.get(key).map(|value| self.line_at(value))
    }

    /// The result of `read`, unless it substitutes a value that was reported.
    pub(super) fn known<T>(&mut self, read: impl FnOnce(&mut Self) -> T) -> Option<T> {
        let before = self.unknown;
        let read = read(self);
        (self.unknown == before).then_some(read)
    }

    /// The value of `key`, parsed by `read`; a missing key is not a problem.
    pub(super) fn optional<T>(
        &mut self,
        key: &'static str,
        expected: &str,
        read: impl FnOnce(&'t DeValue<'i>) -> Option<T>,
    ) -> Option<Spanned<T>> {
        self.asked.push(key);
        let value: &'t toml::Spanned<DeValue<'i>> = self.entries.get(key)?;
        let line = self.line_at(value);
        let read = read(value.get_ref());
        if read.is_none() {
            self.refuse(line, key, expected, shown(value.get_ref()));
        }
        read.map(|value| Spanned { value, line })
    }

    /// As [`Self::optional`], but a missing key is a problem.
    pub(super) fn required<T>(
        &mut self,
        key: &'static str,
        expected: &str,
        read: impl FnOnce(&'t DeValue<'i>) -> Option<T>,
    ) -> Option<Spanned<T>> {
        if !self.entries.contains_key(key) {
            self.report(self.line, ProblemKind::MissingKey { key, expected: expected.to_owned() });
        }
        self.optional(key, expected, read)
    }

    /// The value of `key`, parsed by `read`, or `default`; without a default, a missing key is a
    /// problem. After a problem, the result is a substitute, and [`Self::known`] detects it.
    pub(super) fn value<T: Default>(
        &mut self,
        key: &'static str,
        expected: &str,
        default: Option<T>,
        read: impl FnOnce(&'t DeValue<'i>) -> Option<T>,
    ) -> T {
        let required = default.is_none();
        let substitute = default.unwrap_or_default();
        if !required && !self.entries.contains_key(key) {
            self.asked.push(key);
            return substitute;
        }
        let Some(given) = self.required(key, expected, read) else {
            self.unknown += 1;
            return substitute;
        };
        given.value
    }

    /// A whole number in `range`, as [`Self::value`].
    pub(super) fn integer(
        &mut self,
        key: &'static str,
        range: RangeInclusive<i64>,
        default: Option<i64>,
    ) -> i64 {
        let expected = format!("a whole number from {} to {}", range.start(), range.end());
        self.value(key, &expected, default, |value| integer(value).filter(|v| range.contains(v)))
    }

    /// As [`Self::integer`], for ranges from 0.
    pub(super) fn size(
        &mut self,
        key: &'static str,
        range: RangeInclusive<i64>,
        default: Option<i64>,
    ) -> usize {
        self.integer(key, range, default) as usize
    }

    /// A number above 0 that `fits` accepts.
    pub(super) fn positive(&mut self, key: &'static str, fits: impl FnOnce(f64) -> bool) -> f64 {
        let read = |value: &DeValue<'_>| number(value).filter(|&v| v > 0.0 && fits(v));
        self.value(key, "a finite number above 0", None, read)
    }

    /// `true` or `false`; `default` if the key is missing or was reported.
    pub(super) fn boolean(&mut self, key: &'static str, default: bool) -> bool {
        self.optional(key, "true or false", DeValue::as_bool).map_or(default, |given| given.value)
    }

    /// A freely chosen name, if there is one.
    pub(super) fn text(&mut self, key: &'static str, expected: &str) -> Option<String> {
        self.optional(key, expected, name).map(|given| given.value)
    }

    /// One of `choices` by its word; `None` if a problem was reported.
    pub(super) fn choice<T: Copy>(&mut self, key: &'static str, choices: &[(&str, T)]) -> Option<T> {
        self.required(key, &words(choices), |value| chosen(choices, value)).map(|given| given.value)
    }

    /// One of `choices` by its word; the first if the key is missing or was reported.
    pub(super) fn option<T: Copy>(&mut self, key: &'static str, choices: &[(&str, T)]) -> T {
        let given = self.optional(key, &words(choices), |value| chosen(choices, value));
        given.map_or(choices[0].1, |given| given.value)
    }

    /// Accepts `keys` with any value, or missing.
    pub(super) fn ignore(&mut self, keys: &[&'static str]) {
        self.asked.extend(keys);
    }

    /// Reports `key`, if the table has it, as a key that is valid only `with` other values.
    pub(super) fn inapplicable(&mut self, key: &'static str, with: &'static str) {
        self.asked.push(key);
        if let Some(line) = self.line_of(key) {
            self.report(line, ProblemKind::Inapplicable { key, with });
        }
    }

    /// Reports every key that was not read; returns the problems.
    pub(super) fn finish(mut self) -> &'t mut Problems {
        self.asked.sort_unstable();
        self.asked.dedup();
        let expected = self.asked.join(", ");
        for key in self.entries.keys().filter(|key| !self.asked.contains(&key.get_ref().as_ref())) {
            let line = self.lines.of(key.span().start);
            let kind = ProblemKind::UnknownKey { key: cut(key.get_ref()), expected: expected.clone() };
            self.problems.add(line, self.layer.as_deref(), kind);
        }
        self.problems
    }
}

/// The words of `choices` as a list for messages.
fn words<T>(choices: &[(&str, T)]) -> String {
    let words: Vec<String> = choices.iter().map(|(word, _)| format!("{word:?}")).collect();
    words.join(" or ")
}

fn chosen<T: Copy>(choices: &[(&str, T)], value: &DeValue<'_>) -> Option<T> {
    let found = value.as_str()?;
    choices.iter().find(|(word, _)| *word == found).map(|&(_, choice)| choice)
}

/// A name that messages and tables can show: see [`NAME`].
pub(super) fn name(value: &DeValue<'_>) -> Option<String> {
    let name = value.as_str()?;
    let fits = (1..=MAX_NAME).contains(&name.chars().count()) && !name.chars().any(char::is_control);
    fits.then(|| name.to_owned())
}

pub(super) fn integer(value: &DeValue<'_>) -> Option<i64> {
    let value = value.as_integer()?;
    i64::from_str_radix(value.as_str(), value.radix()).ok()
}

/// The finite number that `value` holds, whole or not.
pub(super) fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(_) => integer(value).map(|v| v as f64),
        DeValue::Float(v) => v.as_str().parse().ok().filter(|v: &f64| v.is_finite()),
        _ => None,
    }
}

/// `value` as quoted in a message.
pub(super) fn shown(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(v) => format!("{:?}", cut(v)),
        DeValue::Integer(v) => cut(&v.to_string()),
        DeValue::Float(v) => cut(&v.to_string()),
        DeValue::Boolean(v) => v.to_string(),
        DeValue::Datetime(v) => v.to_string(),
        // To a depth of 2, which is the deepest expected nesting.
        DeValue::Array(v) if v.len() <= 8 => list(v, |entry| match entry {
            DeValue::Array(v) if v.len() <= 8 => list(v, |entry| match entry {
                DeValue::Array(_) => "an array".to_owned(),
                entry => shown(entry),
            }),
            entry => shown(entry),
        }),
        DeValue::Array(v) => format!("an array of {}", v.len()),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// The part of `text` that a message quotes.
fn cut(text: &str) -> String {
    text.chars().take(60).collect()
}

fn list(entries: &DeArray<'_>, shown: impl Fn(&DeValue<'_>) -> String) -> String {
    let entries: Vec<String> = entries.iter().map(|entry| shown(entry.get_ref())).collect();
    format!("[{}]", entries.join(", "))
}
