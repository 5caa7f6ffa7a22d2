//! Reads one TOML table key by key.
//!
//! Enters: a parsed table with the spans of its keys and values. Leaves: typed values, and a problem for each key that
//! is missing, unknown, of another type or out of range. Invariant: `None` for a required or mistyped value always comes
//! with a problem, so `None` never has to be reported again.

use std::ops::RangeInclusive;

use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

use super::problem::{ProblemKind, Problems};

/// A value and the line it stands on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Given<T> {
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
    problems: &'t mut Problems,
}

impl<'t, 'i> Table<'t, 'i> {
    pub(super) fn new(
        entries: &'t DeTable<'i>,
        lines: &'t Lines,
        line: usize,
        layer: Option<String>,
        problems: &'t mut Problems,
    ) -> Self {
        Self { entries, lines, line, layer, asked: Vec::new(), problems }
    }

    /// Reports `kind` at `line`.
    pub(super) fn report(&mut self, line: usize, kind: ProblemKind) {
        self.problems.add(line, self.layer.as_deref(), kind);
    }

    /// Reports that the value of `key` at `line` is not as expected.
    pub(super) fn refuse(
        &mut self,
        line: usize,
        key: &'static str,
        expected: impl Into<String>,
        found: String,
    ) {
        self.report(line, ProblemKind::Value { key, expected: expected.into(), found });
    }

    fn value(&mut self, key: &'static str) -> Option<(&'t DeValue<'i>, usize)> {
        self.asked.push(key);
        let value: &Spanned<DeValue<'i>> = self.entries.get(key)?;
        Some((value.get_ref(), self.lines.of(value.span().start)))
    }

    /// Whether the table has `key`, and on which line.
    pub(super) fn line_of(&self, key: &str) -> Option<usize> {
        self.entries.get(key).map(|value| self.lines.of(value.span().start))
    }

    /// The value of `key` as `read` understands it; absent without a problem.
    pub(super) fn optional<T>(
        &mut self,
        key: &'static str,
        expected: &str,
        read: impl FnOnce(&DeValue<'_>) -> Option<T>,
    ) -> Option<Given<T>> {
        let (value, line) = self.value(key)?;
        let read = read(value);
        if read.is_none() {
            self.refuse(line, key, expected, shown(value));
        }
        read.map(|value| Given { value, line })
    }

    /// As [`Self::optional`], but absence is a problem.
    pub(super) fn required<T>(
        &mut self,
        key: &'static str,
        expected: &str,
        read: impl FnOnce(&DeValue<'_>) -> Option<T>,
    ) -> Option<Given<T>> {
        if !self.entries.contains_key(key) {
            self.asked.push(key);
            self.report(self.line, ProblemKind::MissingKey { key, expected: expected.to_owned() });
        }
        self.optional(key, expected, read)
    }

    /// A whole number in `range`; `default` where the key is absent, a problem where there is no default.
    pub(super) fn integer(
        &mut self,
        key: &'static str,
        range: RangeInclusive<i64>,
        default: Option<i64>,
    ) -> Option<i64> {
        let expected = format!("a whole number from {} to {}", range.start(), range.end());
        let read = |value: &DeValue<'_>| integer(value).filter(|v| range.contains(v));
        self.defaulted(key, &expected, default, read)
    }

    /// As [`Self::integer`], for ranges from 0.
    pub(super) fn size(
        &mut self,
        key: &'static str,
        range: RangeInclusive<i64>,
        default: Option<i64>,
    ) -> Option<usize> {
        self.integer(key, range, default).map(|size| size as usize)
    }

    /// A number above 0 that `fits` accepts.
    pub(super) fn positive(&mut self, key: &'static str, fits: impl FnOnce(f64) -> bool) -> Option<f64> {
        let expected = "a finite number above 0";
        self.required(key, expected, |v| number(v).filter(|&v| v > 0.0 && fits(v))).map(|v| v.value)
    }

    /// `true` or `false`; `default` where the key is absent.
    pub(super) fn boolean(&mut self, key: &'static str, default: bool) -> bool {
        let read = |value: &DeValue<'_>| value.as_bool();
        self.defaulted(key, "true or false", Some(default), read).unwrap_or(default)
    }

    /// One of `choices` by its word; `default` where the key is absent, a problem where there is no default.
    pub(super) fn choice<T: Copy>(
        &mut self,
        key: &'static str,
        choices: &[(&str, T)],
        default: Option<T>,
    ) -> Option<T> {
        let words: Vec<String> = choices.iter().map(|(word, _)| format!("{word:?}")).collect();
        self.defaulted(key, &words.join(" or "), default, |value| {
            let found = value.as_str()?;
            choices.iter().find(|(word, _)| *word == found).map(|&(_, choice)| choice)
        })
    }

    /// The value of `key` as `read` understands it; `default` where the key is absent, a problem where there is no default.
    pub(super) fn defaulted<T>(
        &mut self,
        key: &'static str,
        expected: &str,
        default: Option<T>,
        read: impl FnOnce(&DeValue<'_>) -> Option<T>,
    ) -> Option<T> {
        match default {
            Some(default) if !self.entries.contains_key(key) => {
                self.asked.push(key);
                Some(default)
            }
            _ => self.required(key, expected, read).map(|given| given.value),
        }
    }

    /// Accepts `keys` with any value, or absent.
    pub(super) fn ignore(&mut self, keys: &[&'static str]) {
        self.asked.extend(keys);
    }

    /// Reports `key`, where the table has it, as a key that belongs only `with` other values.
    pub(super) fn inapplicable(&mut self, key: &'static str, with: &'static str) {
        self.asked.push(key);
        if let Some(line) = self.line_of(key) {
            self.report(line, ProblemKind::Inapplicable { key, with });
        }
    }

    /// Reports every key that was not read.
    pub(super) fn finish(mut self) {
        self.asked.sort_unstable();
        self.asked.dedup();
        let expected = self.asked.join(", ");
        for key in self.entries.keys().filter(|key| !self.asked.contains(&key.get_ref().as_ref())) {
            let line = self.lines.of(key.span().start);
            let kind = ProblemKind::UnknownKey { key: cut(key.get_ref()), expected: expected.clone() };
            self.problems.add(line, self.layer.as_deref(), kind);
        }
    }
}

/// The whole number that `value` holds.
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

/// `value` as a message quotes it.
pub(super) fn shown(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(v) => {
            format!("{:?}", cut(v))
        }
        DeValue::Integer(v) => cut(&v.to_string()),
        DeValue::Float(v) => cut(&v.to_string()),
        DeValue::Boolean(v) => v.to_string(),
        DeValue::Datetime(v) => v.to_string(),
        // To a depth of 2: the deepest that is ever expected.
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

/// As much of `text` as a message quotes.
fn cut(text: &str) -> String {
    text.chars().take(60).collect()
}

fn list(entries: &DeArray<'_>, shown: impl Fn(&DeValue<'_>) -> String) -> String {
    let entries: Vec<String> = entries.iter().map(|entry| shown(entry.get_ref())).collect();
    format!("[{}]", entries.join(", "))
}
