//! Common parts of description files of every kind: text, layers, outputs.
//!
//! Input: a file or text. Output: [`ParsedLayer`]s and outputs; references are not resolved.

use std::collections::BTreeSet;
use std::io;
use std::path::Path;

use toml::de::{DeTable, DeValue};

use super::problem::{DescriptionError, ProblemKind, Problems};
use super::table::{self, Lines, NAME, Spanned, Table, name};
use crate::error::{self, ModelError};

/// Largest description file: the maximum number of layers, at 256 bytes each. One wrong byte can
/// cause 700 bytes of messages, most of them from the TOML parser.
const MAX_FILE: u64 = 1 << 18;
/// The table that marks a frame network.
pub(super) const INPUT: &str = "input";
pub(super) const EVENT_NETWORK: &str = "a network over events, with a table [graph]";
pub(super) const FRAME_NETWORK: &str = "a frame network, with a table [input]";
/// The unit of the outputs of classes: a softmax converts such values to probabilities.
pub(super) const LOGIT: &str = "logit";

/// Maximum number of layers of a network; it bounds drawings and searches.
const MAX_LAYERS: usize = 1024;
pub(super) const LAYER: &str = "layer";
/// The tables of a frame network that reads the readout.
pub(super) const HEAD: &str = "head";

/// A table `[[layer]]` or `[[head]]`, with the keys of its kind.
#[derive(Debug)]
pub(super) struct ParsedLayer<K> {
    pub(super) name: String,
    pub(super) line: usize,
    /// Its input; `None`: the layer before it.
    pub(super) from: Option<Spanned<String>>,
    /// Its second input: the summand of a skip, or the second part of a concatenation.
    pub(super) second: Option<Spanned<String>>,
    pub(super) weights: String,
    /// Its computation; `None` if a problem of it was reported.
    pub(super) kind: Option<K>,
}

impl<K> ParsedLayer<K> {
    /// Reads the prefix of the tensors; its default is the name.
    pub(super) fn read_weights(&mut self, table: &mut Table<'_, '_>) {
        let given = table.text("weights", "the prefix of the layer's tensor names");
        self.weights = given.unwrap_or_else(|| self.name.clone());
    }

    /// The line that names its input.
    pub(super) fn reading_line(&self) -> usize {
        self.from.as_ref().map_or(self.line, |given| given.line)
    }
}

/// The names of the predicted values, and the unit of each.
#[derive(Debug, Default)]
pub(super) struct Output {
    pub(super) names: Option<Spanned<Vec<String>>>,
    /// One unit per name.
    pub(super) units: Vec<String>,
}

pub(super) fn text(path: &Path) -> Result<String, ModelError> {
    String::from_utf8(error::read(path, MAX_FILE)?).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let found = format!("expected text in UTF-8, found other bytes at byte {at}");
        ModelError::Read { path: path.to_owned(), source: io::Error::new(io::ErrorKind::InvalidData, found) }
    })
}

/// The result of `check` for a file without problems.
pub(super) fn checked<T>(
    text: &str,
    check: impl FnOnce(Table<'_, '_>) -> Option<T>,
) -> Result<T, DescriptionError> {
    let (lines, mut problems) = (Lines::new(text), Problems::default());
    let (root, errors) = DeTable::parse_recoverable(text);
    for error in &errors {
        let line = error.span().map_or(1, |span| lines.of(span.start));
        problems.add(line, None, ProblemKind::Syntax(error.message().to_owned()));
    }
    let whole = errors.is_empty().then(|| Table::root(root.get_ref(), &lines, &mut problems));
    match whole.and_then(check) {
        Some(checked) if problems.0.is_empty() => Ok(checked),
        _ => Err(DescriptionError::new(problems.0)),
    }
}

/// The tables of `list`, at most [`MAX_LAYERS`], none named `input`; others are reported.
/// `reference` describes the references of a layer, `read` reads a layer of one of `kinds`.
pub(super) fn layers<K>(
    root: &mut Table<'_, '_>,
    list: &'static str,
    input: &str,
    reference: &str,
    kinds: &[&'static str],
    read: impl Fn(&'static str, Table<'_, '_>, &mut ParsedLayer<K>),
) -> Vec<ParsedLayer<K>> {
    let expected = format!("tables [[{list}]]");
    let tables = match list {
        LAYER => root.required(list, &expected, DeValue::as_array),
        _ => root.optional(list, &expected, DeValue::as_array),
    };
    let Some(Spanned { value: tables, .. }) = tables else { return Vec::new() };
    let kinds: Vec<_> = kinds.iter().map(|&word| (word, word)).collect();
    let mut layers = Vec::new();
    for value in tables.iter().take(MAX_LAYERS) {
        let Some(mut table) = root.layer(list, value) else { continue };
        let given = table.required("name", NAME, name);
        if let Some(given) = given.as_ref().filter(|given| given.value == input) {
            let expected = "another name than that of the network's input";
            table.refuse(given.line, "name", expected, format!("{input:?}"));
        }
        let name = given.map(|given| given.value).unwrap_or_default();
        let word = table.choice("kind", &kinds);
        let from = table.optional("from", reference, table::name);
        let (line, weights) = (table.line(), name.clone());
        let mut layer = ParsedLayer { name, line, from, second: None, weights, kind: None };
        // The keys of an unknown kind are unknown.
        if let Some(word) = word {
            read(word, table, &mut layer);
        }
        layers.push(layer);
    }
    if let Some(more) = tables.get(MAX_LAYERS) {
        let line = root.line_at(more);
        root.refuse(line, list, format!("at most {MAX_LAYERS} layers"), tables.len().to_string());
    }
    layers
}

pub(super) fn output(root: &mut Table<'_, '_>) -> Output {
    let Some(mut table) = root.table("output", "a table with the prediction's names and unit") else {
        return Output::default();
    };
    let output = if table.line_of("classes").is_some() {
        let expected = "at least two names of classes, each once, such as [\"left\", \"right\"]";
        let names = table.required("classes", expected, |value| {
            let once = |names: &Vec<String>| names.iter().collect::<BTreeSet<_>>().len() == names.len();
            names(value).filter(|names| names.len() > 1 && once(names))
        });
        for key in ["names", "unit"] {
            table.inapplicable(key, "names instead of classes, whose values are logits");
        }
        let units = names.iter().flat_map(|given| vec![LOGIT.to_owned(); given.value.len()]).collect();
        Output { names, units }
    } else {
        let expected = "the predicted values' names, such as [\"roll\", \"pitch\"], or classes instead of names and unit";
        let names = table.required("names", expected, |value| names(value).filter(|names| !names.is_empty()));
        let count = names.as_ref().map_or(0, |given| given.value.len());
        let expected = "the unit of all predicted values, such as \"rad\", or a list with that of each";
        let units = table.required("unit", expected, |value| match name(value) {
            Some(unit) => Some(vec![unit; count]),
            None => self::names(value).filter(|units| count == 0 || units.len() == count),
        });
        table.ignore(&["classes"]);
        Output { names, units: units.map(|given| given.value).unwrap_or_default() }
    };
    table.finish();
    output
}

fn names(value: &DeValue<'_>) -> Option<Vec<String>> {
    value.as_array()?.iter().map(|v| name(v.get_ref())).collect()
}
