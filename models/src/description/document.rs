//! The parts of a description file that every kind of network has: TOML, tables, names, the list of layers.
//!
//! Enters: a file or its text. Leaves: a [`Document`], whose tables are read key by key.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::problem::{DescriptionError, ProblemKind, Problems};
use super::table::{Given, Lines, Table, shown};
use crate::bounded;
use crate::error::ModelError;

/// Largest description file that is read: the most layers that a network may have, at 256 bytes each. One wrong byte can
/// take 700 bytes of messages, most of them from the TOML parser.
const LARGEST_FILE: u64 = 1 << 18;
/// The table that marks a frame network.
pub(super) const INPUT: &str = "input";
/// The names of the two kinds of networks in messages.
pub(super) const EVENT_NETWORK: &str = "a network over events, with a table [graph]";
pub(super) const FRAME_NETWORK: &str = "a frame network, with a table [input]";
/// The unit of the outputs of classes: a softmax makes probabilities of such values.
pub(super) const LOGIT: &str = "logit";

/// Most layers of a network; it bounds drawings and searches.
const MOST_LAYERS: usize = 1024;
/// Longest name of a network, a layer or an output.
const LONGEST_NAME: usize = 80;
/// The tables of layers.
pub(super) const LAYER: &str = "layer";
/// The values that [`name`] accepts.
pub(super) const NAME: &str = "a name of 1 to 80 printable characters";

/// A parsed file.
pub(super) struct Document<'i> {
    root: Spanned<DeTable<'i>>,
    pub(super) lines: Lines,
}

/// A table that starts on `line`.
#[derive(Clone, Copy)]
pub(super) struct Entries<'d, 'i> {
    entries: &'d DeTable<'i>,
    line: usize,
}

/// The `[output]` table.
#[derive(Debug)]
pub(super) struct Output {
    pub(super) names: Option<Given<Vec<String>>>,
    pub(super) unit: String,
}

/// The text of the file at `path`.
pub(super) fn text(path: &Path) -> Result<String, ModelError> {
    String::from_utf8(bounded::read(path, LARGEST_FILE)?).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let found = format!("expected text in UTF-8, found other bytes at byte {at}");
        ModelError::Read { path: path.to_owned(), source: io::Error::new(io::ErrorKind::InvalidData, found) }
    })
}

/// The result of `check` for a file without problems.
pub(super) fn checked<T>(
    text: &str,
    check: impl FnOnce(&Document<'_>, &mut Problems) -> Option<T>,
) -> Result<T, DescriptionError> {
    let mut problems = Problems::default();
    let checked = Document::parse(text, &mut problems).and_then(|document| check(&document, &mut problems));
    match checked {
        Some(checked) if problems.0.is_empty() => Ok(checked),
        _ => Err(DescriptionError::new(problems.0)),
    }
}

/// Layers by name, each with its index. A second layer of a name is reported, and the first keeps the name.
pub(super) fn by_name<'f>(
    layers: impl Iterator<Item = (&'f str, usize)>,
    problems: &mut Problems,
) -> BTreeMap<&'f str, usize> {
    let (mut names, mut lines) = (BTreeMap::new(), Vec::new());
    for (i, (name, line)) in layers.enumerate() {
        lines.push(line);
        let first = if name.is_empty() { i } else { *names.entry(name).or_insert(i) };
        if first != i {
            problems.add(line, Some(name), ProblemKind::DuplicateName { first: lines[first] });
        }
    }
    names
}

impl<'i> Document<'i> {
    /// `None`, with problems, where `text` is not TOML.
    pub(super) fn parse(text: &'i str, problems: &mut Problems) -> Option<Self> {
        let lines = Lines::new(text);
        let (root, errors) = DeTable::parse_recoverable(text);
        for error in &errors {
            let line = error.span().map_or(1, |span| lines.of(span.start));
            problems.add(line, None, ProblemKind::Syntax(error.message().to_owned()));
        }
        errors.is_empty().then_some(Self { root, lines })
    }

    /// The line of a table at the top, where the file has it.
    pub(super) fn line_of(&self, key: &str) -> Option<usize> {
        self.root.get_ref().get(key).map(|value| self.lines.of(value.span().start))
    }

    /// The tables at the top of the file, in the order of `tables`, which has the key and a description of each. A missing or
    /// unknown table is reported. `[[layer]]` must also be there, and the tables of `lists` may be there.
    pub(super) fn tables<const N: usize>(
        &self,
        tables: [(&'static str, &str); N],
        lists: &[&'static str],
        problems: &mut Problems,
    ) -> [Option<Entries<'_, 'i>>; N] {
        let mut root = Table::new(self.root.get_ref(), &self.lines, 1, None, problems);
        let found = tables.map(|(key, what)| {
            root.required(key, what, |value| value.is_table().then_some(()))?;
            let value = self.root.get_ref().get(key)?;
            let line = self.lines.of(value.span().start);
            value.get_ref().as_table().map(|entries| Entries { entries, line })
        });
        root.required(LAYER, "tables [[layer]]", |value| value.is_array().then_some(()));
        for list in lists {
            root.optional(list, &format!("tables [[{list}]]"), |value| value.is_array().then_some(()));
        }
        root.finish();
        found
    }

    /// A table, to be read key by key.
    pub(super) fn open<'t>(&'t self, table: Entries<'t, 'i>, problems: &'t mut Problems) -> Table<'t, 'i> {
        Table::new(table.entries, &self.lines, table.line, None, problems)
    }

    /// The tables of `list`, such as [`LAYER`], at most [`MOST_LAYERS`]. Anything else in their place is reported.
    pub(super) fn layers(&self, list: &'static str, problems: &mut Problems) -> Vec<Entries<'_, 'i>> {
        let layers = self.root.get_ref().get(list).and_then(|value| value.get_ref().as_array());
        let Some(layers) = layers else { return Vec::new() };
        let mut tables = Vec::new();
        for layer in layers.iter().take(MOST_LAYERS) {
            let line = self.lines.of(layer.span().start);
            if let Some(entries) = layer.get_ref().as_table() {
                tables.push(Entries { entries, line });
                continue;
            }
            let (expected, found) = (format!("a table [[{list}]]"), shown(layer.get_ref()));
            problems.add(line, None, ProblemKind::Value { key: list, expected, found });
        }
        if let Some(more) = layers.get(MOST_LAYERS) {
            let expected = format!("at most {MOST_LAYERS} layers");
            let kind = ProblemKind::Value { key: list, expected, found: layers.len().to_string() };
            problems.add(self.lines.of(more.span().start), None, kind);
        }
        tables
    }

    /// A layer's table and its name, which must differ from `input`.
    pub(super) fn layer<'t>(
        &'t self,
        layer: Entries<'t, 'i>,
        input: &str,
        problems: &'t mut Problems,
    ) -> (Table<'t, 'i>, String) {
        let known_name = layer.entries.get("name").and_then(|value| name(value.get_ref()));
        let mut table = Table::new(layer.entries, &self.lines, layer.line, known_name, problems);
        let given = table.required("name", NAME, name);
        if let Some(given) = given.as_ref().filter(|given| given.value == input) {
            let expected = "another name than that of the network's input";
            table.refuse(given.line, "name", expected, format!("{input:?}"));
        }
        (table, given.map(|given| given.value).unwrap_or_default())
    }

    /// Reads the `[output]` table.
    pub(super) fn output(&self, output: Option<Entries<'_, 'i>>, problems: &mut Problems) -> Output {
        let Some(output) = output else { return Output { names: None, unit: String::new() } };
        let mut table = self.open(output, problems);
        if table.line_of("classes").is_some() {
            return classes(table);
        }
        let expected = "the predicted values' names, such as [\"roll\", \"pitch\"], or classes in place of names and unit";
        let names = table.required("names", expected, |value| names(value).filter(|names| !names.is_empty()));
        let unit = table.required("unit", "the predicted values' unit, such as \"rad\"", name);
        table.ignore(&["classes"]);
        table.finish();
        Output { names, unit: unit.map(|given| given.value).unwrap_or_default() }
    }
}

/// Reads an `[output]` table with classes.
fn classes(mut table: Table<'_, '_>) -> Output {
    let expected = "at least two names of classes, each once, such as [\"left\", \"right\"]";
    let names = table.required("classes", expected, |value| {
        names(value)
            .filter(|names| names.len() > 1 && names.iter().collect::<BTreeSet<_>>().len() == names.len())
    });
    for key in ["names", "unit"] {
        table.inapplicable(key, "names in place of classes, whose values are logits");
    }
    table.finish();
    Output { names, unit: LOGIT.to_owned() }
}

/// A list of names.
fn names(value: &DeValue<'_>) -> Option<Vec<String>> {
    value.as_array()?.iter().map(|v| name(v.get_ref())).collect()
}

impl Entries<'_, '_> {
    /// The line that the table starts on.
    pub(super) fn line(&self) -> usize {
        self.line
    }
}

/// A name that messages and tables can show.
pub(super) fn name(value: &DeValue<'_>) -> Option<String> {
    let name = value.as_str()?;
    let fits = (1..=LONGEST_NAME).contains(&name.chars().count()) && !name.chars().any(char::is_control);
    fits.then(|| name.to_owned())
}
