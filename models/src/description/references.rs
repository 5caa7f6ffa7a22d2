//! References between the layers of a file, of both kinds of networks.

use std::collections::BTreeMap;

use super::document::ParsedLayer;
use super::problem::{ProblemKind, Problems};
use super::table::Spanned;

/// The nodes that a layer reads: its two inputs; `None` if there is none or it was reported.
pub(super) type Reads = [Option<usize>; 2];

/// The names that layers can refer to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scope<'a> {
    pub(super) input: &'a str,
    /// The key of a second input.
    pub(super) second: &'static str,
    /// Description of the position of layers in messages.
    pub(super) place: &'static str,
    /// Whether a layer can refer only to layers above it.
    pub(super) above: bool,
}

/// Resolves the references of `layers`. A second layer with the same name is reported; the first
/// keeps it.
///
/// A layer reads *nodes*: 0 is the network's input, i + 1 layer i. A reference to nothing is
/// reported.
pub(super) fn references<K>(
    layers: &[ParsedLayer<K>],
    scope: Scope<'_>,
    problems: &mut Problems,
) -> Vec<Reads> {
    let mut names = BTreeMap::new();
    for (i, layer) in layers.iter().enumerate().filter(|(_, layer)| !layer.name.is_empty()) {
        let first = *names.entry(layer.name.as_str()).or_insert(i);
        if first != i {
            let kind = ProblemKind::DuplicateName { first: layers[first].line };
            problems.add(layer.line, Some(&layer.name), kind);
        }
    }
    let mut reads = Vec::new();
    for (i, layer) in layers.iter().enumerate() {
        let mut find = |key: &'static str, given: &Spanned<String>| {
            let found = given.value.clone();
            let kind = match names.get(found.as_str()) {
                _ if found == scope.input => return Some(0),
                Some(&read) if read < i || !scope.above => return Some(read + 1),
                Some(&read) => ProblemKind::ForwardReference { key, found, line: layers[read].line },
                None => {
                    let (input, place) = (scope.input.to_owned(), scope.place);
                    ProblemKind::UnknownReference { key, input, place, found }
                }
            };
            problems.add(given.line, Some(&layer.name), kind);
            None
        };
        // The node before layer i is node i.
        let from = layer.from.as_ref().map_or(Some(i), |given| find("from", given));
        let second = layer.second.as_ref().and_then(|given| find(scope.second, given));
        reads.push([from, second]);
    }
    reads
}

/// Reports the layers that `prediction` does not depend on, unless they are `exempt`.
pub(super) fn report_unused<K>(
    layers: &[ParsedLayer<K>],
    reads: &[Reads],
    prediction: usize,
    exempt: impl Fn(usize) -> bool,
    problems: &mut Problems,
) {
    let mut used = vec![false; layers.len() + 1];
    let mut open = vec![prediction + 1];
    while let Some(node) = open.pop() {
        if !std::mem::replace(&mut used[node], true) && node > 0 {
            open.extend(reads[node - 1].iter().flatten());
        }
    }
    for (i, layer) in layers.iter().enumerate() {
        if !used[i + 1] && !exempt(i) {
            problems.add(layer.line, Some(&layer.name), ProblemKind::Unused);
        }
    }
}

/// Reports if the predicting layer `name` writes another number of values than `names`.
pub(super) fn check_names(
    names: Option<&Spanned<Vec<String>>>,
    name: &str,
    expected: usize,
    problems: &mut Problems,
) {
    if let Some(names) = names.filter(|names| names.value.len() != expected) {
        let (layer, found) = (name.to_owned(), names.value.len());
        problems.add(names.line, None, ProblemKind::OutputNames { layer, expected, found });
    }
}
