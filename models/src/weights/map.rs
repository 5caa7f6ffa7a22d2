//! Maps of names: from the names of tensors in a file to their names in the network.
//!
//! Input: lines `name in the file = name in the network`. Output: [`Weights`] with other names.
//! Invariant: all lines apply at once, so that their order and cycles do not matter; no tensor is
//! lost, and no line is without effect.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::Weights;
use crate::ModelError;
use crate::error;

/// Longest file of a map in bytes.
const MAX_FILE: u64 = 1 << 20;
/// Longest part of a line in a message, in characters.
const MAX_SHOWN: usize = 80;
/// The form of a line.
const PAIR: &str = "a line \"name in the file = name in the network\"";

/// A map from the names of tensors in a file of weights to their names in the network: a text with
/// a line `name in the file = name in the network` for each.
///
/// A name with a dot at its end means all names that start with it: `encoder. = blocks.`, or
/// `encoder. =` to leave it out. A whole name has priority over a start, and a longer start over a
/// shorter one. All lines apply at once: `a = b` and `b = a` exchange two tensors. Lines without
/// text and those that start with `#` are skipped.
///
/// The new name of a whole name is exactly that of the network. Names without a line are found by
/// the habits of `PyTorch`, as without a map.
///
/// ```
/// use meissner_models::{Description, NameMap, Weights, draw};
///
/// let description = Description::shipped("tactigraph-past").expect("a shipped network");
/// let own = draw(&description, 1);
/// let others = own.renamed(&NameMap::parse("hidden. = mlp.0.")?)?;
/// assert!(description.network(&others).is_err());
///
/// let map = NameMap::parse("mlp.0. = hidden.")?;
/// assert!(description.network(&others.renamed(&map)?).is_ok());
/// # Ok::<(), meissner_models::ModelError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NameMap {
    /// New name and place of the line by old name.
    whole: BTreeMap<String, Line>,
    /// The same for starts of names, which end with a dot.
    starts: BTreeMap<String, Line>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Line {
    new: String,
    place: String,
}

impl NameMap {
    /// The map in `text`.
    ///
    /// # Errors
    /// [`ModelError::Map`] with the line that is not a pair of names, or that repeats a name.
    pub fn parse(text: &str) -> Result<Self, ModelError> {
        Self::of(text, |number, _| format!("line {number}"))
    }

    /// The map of one line, which errors show.
    ///
    /// # Errors
    /// As [`Self::parse`].
    pub fn entry(line: &str) -> Result<Self, ModelError> {
        Self::of(line, |_, line| shown(line))
    }

    /// The map in the file at `path`.
    ///
    /// # Errors
    /// [`ModelError::Read`], [`ModelError::Large`] beyond 1 MiB, and as [`Self::parse`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self, ModelError> {
        let path = path.as_ref();
        let name = path.display();
        let text = String::from_utf8(error::read(path, MAX_FILE)?).map_err(|error| {
            let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
            let number = valid.split(|&byte| byte == b'\n').count();
            refused(format!("{name}, line {number}"), "text in UTF-8", "other bytes")
        })?;
        Self::of(text.trim_start_matches('\u{feff}'), |number, _| format!("{name}, line {number}"))
    }

    /// Both maps combined.
    ///
    /// # Errors
    /// [`ModelError::Map`] if both have a line for a name.
    pub fn and(mut self, other: Self) -> Result<Self, ModelError> {
        let lines = other.whole.into_iter().chain(other.starts);
        lines.into_iter().try_for_each(|(old, line)| self.insert(old, line))?;
        Ok(self)
    }

    /// The same with one more name: the file's `old` is the network's `new`.
    ///
    /// # Errors
    /// As [`Self::parse`].
    pub fn with(mut self, old: &str, new: &str) -> Result<Self, ModelError> {
        self.add(old, new, shown(&format!("{old} = {new}")))?;
        Ok(self)
    }

    fn of(text: &str, place: impl Fn(usize, &str) -> String) -> Result<Self, ModelError> {
        let mut map = Self::default();
        for (line, number) in text.lines().map(str::trim).zip(1..) {
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let place = place(number, line);
            let Some((old, new)) = line.split_once('=') else {
                return Err(refused(place, PAIR, shown(line)));
            };
            map.add(old.trim(), new.trim(), place)?;
        }
        Ok(map)
    }

    fn add(&mut self, old: &str, new: &str, place: String) -> Result<(), ModelError> {
        let (is_start, fits) = (old.ends_with('.'), new.is_empty() || new.ends_with('.'));
        if old.is_empty() || is_start != fits {
            let expected =
                if is_start { "a start of names, with a dot at its end, or nothing" } else { PAIR };
            return Err(refused(place, expected, shown(&format!("{old} = {new}"))));
        }
        self.insert(old.to_owned(), Line { new: new.to_owned(), place })
    }

    fn insert(&mut self, old: String, line: Line) -> Result<(), ModelError> {
        let is_start = old.ends_with('.');
        let lines = if is_start { &mut self.starts } else { &mut self.whole };
        if let Some(other) = lines.get(&old) {
            let expected = format!("one line for {}", shown(&old));
            return Err(refused(line.place, expected, format!("another, {}", other.place)));
        }
        lines.insert(old, line);
        Ok(())
    }

    /// The line for the name `old`, with the part of the name that it replaces.
    fn line(&self, old: &str) -> Option<(&str, &Line)> {
        let whole = self.whole.get_key_value(old);
        let starts = || old.rmatch_indices('.').find_map(|(dot, _)| self.starts.get_key_value(&old[..=dot]));
        whole.or_else(starts).map(|(part, line)| (part.as_str(), line))
    }
}

impl Weights {
    /// These weights with the names of `map`; all other names are unchanged.
    ///
    /// # Errors
    /// [`ModelError::Map`] for a line without a tensor, and for two tensors of one name.
    pub fn renamed(self, map: &NameMap) -> Result<Self, ModelError> {
        let lines = || map.whole.iter().chain(&map.starts);
        let mut unread: BTreeSet<&str> = lines().map(|(old, _)| old.as_str()).collect();
        let mut renamed = Self::new([]);
        let mut olds: BTreeMap<String, (String, Option<&str>)> = BTreeMap::new();
        for (old, tensor) in self.tensors {
            let line = map.line(&old);
            let (new, is_own) = match line {
                Some((part, line)) => {
                    unread.remove(part);
                    (format!("{}{}", line.new, &old[part.len()..]), part == old)
                }
                None => (old.clone(), self.mapped.contains(&old)),
            };
            let place = line.map(|(_, line)| line.place.as_str());
            if let Some((other, its_place)) = olds.get(&new) {
                let expected = format!("one tensor called {}", shown(&new));
                let found = format!("{} and {} of the file", shown(other), shown(&old));
                let place = place.or(*its_place).unwrap_or_default().to_owned();
                return Err(refused(place, expected, found));
            }
            if is_own {
                renamed.mapped.insert(new.clone());
            }
            olds.insert(new.clone(), (old, place));
            renamed.tensors.insert(new, tensor);
        }
        if let Some((old, line)) = lines().find(|(old, _)| unread.contains(old.as_str())) {
            let (expected, found) = if old.ends_with('.') {
                ("tensors of the file whose names start so and that have no line of their own", "none")
            } else {
                ("a tensor of the file", "none of this name")
            };
            return Err(refused(line.place.clone(), expected, format!("{}: {found}", shown(old))));
        }
        renamed.metadata = self.metadata;
        Ok(renamed)
    }
}

fn refused(place: String, expected: impl Into<String>, found: impl Into<String>) -> ModelError {
    ModelError::Map { place, expected: expected.into(), found: found.into() }
}

/// `text` in quotes, limited to one line.
fn shown(text: &str) -> String {
    let start: String = text.chars().take(MAX_SHOWN).collect();
    let more = if start.len() < text.len() { ".." } else { "" };
    format!("{start:?}{more}")
}
