//! The inputs of layers: names are resolved, the graph is acyclic, and there is an order of evaluation.
//!
//! Enters: a [`File`]. Leaves: a [`Wiring`] over the file's layers by index. Invariant: `order` holds every layer that
//! no cycle leads to, each after those it reads, ties in the order of the file.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use petgraph::Direction;
use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};
use petgraph::visit::{Dfs, Reversed};

use super::document::by_name;
use super::file::{EVENTS, File, FileKind};
use super::problem::{ProblemKind, Problems};

/// An input of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// The network's input.
    Events,
    /// A layer, by its place in the file.
    Layer(usize),
    /// A reference that was reported.
    Unknown,
}

/// The graph of a file's layers.
#[derive(Debug)]
pub(super) struct Wiring {
    /// The input of each layer.
    pub(super) from: Vec<Source>,
    /// The skip of each layer.
    pub(super) skip: Vec<Option<Source>>,
    /// Layers in an order of evaluation.
    pub(super) order: Vec<usize>,
    /// The dense layer that predicts; with a head, the readout, which it reads.
    pub(super) prediction: Option<usize>,
}

/// Node 0 is the input, node i + 1 is layer i.
type Graph = DiGraph<(), ()>;

/// Resolves the references of `file`.
pub(super) fn wire(file: &File, problems: &mut Problems) -> Wiring {
    let before = problems.0.len();
    let names = by_name(file.layers.iter().map(|layer| (layer.name.as_str(), layer.line)), problems);
    let (from, skip) = sources(file, &names, problems);
    let mut graph = Graph::new();
    for _ in 0..=file.layers.len() {
        graph.add_node(());
    }
    for (layer, (from, skip)) in from.iter().zip(&skip).enumerate() {
        for source in [Some(*from), *skip].into_iter().flatten() {
            let node = match source {
                Source::Events => 0,
                Source::Layer(read) => read + 1,
                Source::Unknown => continue,
            };
            graph.add_edge(NodeIndex::new(node), NodeIndex::new(layer + 1), ());
        }
    }
    report_cycles(file, &graph, &from, &skip, problems);
    let order = order(&graph);
    // A layer of an unknown kind may be the one that is missing; where a reference failed, what nothing reads may be
    // meant to be read.
    let known = file.layers.iter().all(|layer| !matches!(layer.kind, FileKind::Unknown));
    let certain = known && problems.0.len() == before && file.layers.iter().all(|l| !l.name.is_empty());
    let readout = readout(file, known, problems);
    let prediction = if file.head.is_empty() {
        prediction(file, &graph, known, certain, problems)
    } else {
        let beside = report_dense(file, problems);
        readout.filter(|_| certain && !beside)
    };
    if let Some(prediction) = prediction
        && certain
    {
        report_unused(file, &graph, prediction, readout, problems);
    }
    Wiring { from, skip, order, prediction }
}

/// The input and the skip of each layer.
fn sources(
    file: &File,
    names: &BTreeMap<&str, usize>,
    problems: &mut Problems,
) -> (Vec<Source>, Vec<Option<Source>>) {
    let (mut from, mut skip) = (Vec::new(), Vec::new());
    for (i, layer) in file.layers.iter().enumerate() {
        let place = if file.head.is_empty() { "in this file" } else { "of a table [[layer]]" };
        let mut find = |key: &'static str, name: &str, line: usize| {
            if name == EVENTS {
                return Source::Events;
            }
            names.get(name).map_or_else(
                || {
                    let (input, found) = (EVENTS.to_owned(), name.to_owned());
                    let kind = ProblemKind::UnknownReference { key, input, place, found };
                    problems.add(line, Some(&layer.name), kind);
                    Source::Unknown
                },
                |&i| Source::Layer(i),
            )
        };
        from.push(match &layer.from {
            Some(given) => find("from", &given.value, given.line),
            None if i == 0 => Source::Events,
            None => Source::Layer(i - 1),
        });
        skip.push(match &layer.kind {
            FileKind::Block { skip: Some(given), .. } => Some(find("skip", &given.value, given.line)),
            _ => None,
        });
    }
    (from, skip)
}

/// Reports one cycle of each set of layers that reach each other.
fn report_cycles(
    file: &File,
    graph: &Graph,
    from: &[Source],
    skip: &[Option<Source>],
    problems: &mut Problems,
) {
    for component in kosaraju_scc(graph) {
        let mut members: Vec<usize> = component.iter().filter_map(|n| n.index().checked_sub(1)).collect();
        members.sort_unstable();
        let Some(&start) = members.first() else { continue };
        let within = |layer: usize| {
            [Some(from[layer]), skip[layer]].into_iter().flatten().find_map(|source| match source {
                Source::Layer(read) if members.binary_search(&read).is_ok() => Some(read),
                _ => None,
            })
        };
        let mut path = vec![start];
        let cycle = loop {
            let Some(next) = within(path[path.len() - 1]) else { break None };
            if let Some(at) = path.iter().position(|&p| p == next) {
                break Some(path.split_off(at));
            }
            path.push(next);
        };
        let Some(mut cycle) = cycle else { continue };
        // The path went against the arrows; it is shown along them, from the first in the file.
        cycle.reverse();
        let first = cycle.iter().enumerate().min_by_key(|&(_, &layer)| layer).map_or(0, |(i, _)| i);
        cycle.rotate_left(first);
        let layer = &file.layers[cycle[0]];
        cycle.push(cycle[0]);
        let path: Vec<String> = cycle.iter().map(|&i| format!("{:?}", file.layers[i].name)).collect();
        problems.add(layer.line, Some(&layer.name), ProblemKind::Cycle(path.join(" -> ")));
    }
}

/// Layers that no cycle leads to, each after those it reads; of several that could come next the first in the file.
fn order(graph: &Graph) -> Vec<usize> {
    let mut waits: Vec<usize> =
        graph.node_indices().map(|n| graph.neighbors_directed(n, Direction::Incoming).count()).collect();
    let ready = graph.node_indices().map(NodeIndex::index).filter(|&n| waits[n] == 0);
    let mut ready: BinaryHeap<Reverse<usize>> = ready.map(Reverse).collect();
    let mut order = Vec::new();
    while let Some(Reverse(node)) = ready.pop() {
        order.extend(node.checked_sub(1));
        for next in graph.neighbors(NodeIndex::new(node)) {
            waits[next.index()] -= 1;
            if waits[next.index()] == 0 {
                ready.push(Reverse(next.index()));
            }
        }
    }
    order
}

/// The line for problems of the whole file: that of its last layer.
fn end(file: &File) -> usize {
    file.layers.last().map_or(1, |layer| layer.line)
}

/// The readout, of which there must be one.
fn readout(file: &File, known: bool, problems: &mut Problems) -> Option<usize> {
    let is_readout = |i: &usize| matches!(file.layers[*i].kind, FileKind::Readout { .. });
    let mut readouts = (0..file.layers.len()).filter(is_readout);
    let first = readouts.next();
    if let Some(first) = first {
        for second in readouts {
            let kind = ProblemKind::SecondReadout { first: file.layers[first].line };
            problems.add(file.layers[second].line, Some(&file.layers[second].name), kind);
        }
    } else if known {
        problems.add(end(file), None, ProblemKind::MissingLayer { expected: "a readout" });
    }
    first
}

/// The dense layer that no other reads, of which there must be one.
fn prediction(
    file: &File,
    graph: &Graph,
    known: bool,
    certain: bool,
    problems: &mut Problems,
) -> Option<usize> {
    let is_dense = |i: &usize| matches!(file.layers[*i].kind, FileKind::Dense { .. });
    let is_read = |i: &usize| graph.neighbors(NodeIndex::new(i + 1)).next().is_some();
    let mut last = (0..file.layers.len()).filter(|i| is_dense(i) && !is_read(i));
    if known && !(0..file.layers.len()).any(|i| is_dense(&i)) {
        problems.add(end(file), None, ProblemKind::MissingLayer { expected: "a dense" });
    }
    let first = last.next()?;
    let mut only = true;
    for second in last.filter(|_| certain) {
        let kind = ProblemKind::SecondPrediction { first: file.layers[first].line };
        problems.add(file.layers[second].line, Some(&file.layers[second].name), kind);
        only = false;
    }
    (only && certain).then_some(first)
}

/// Reports the dense layers of a file that has a head; whether there are any.
fn report_dense(file: &File, problems: &mut Problems) -> bool {
    let head = file.head.first().map_or(1, |layer| layer.line);
    let before = problems.0.len();
    for layer in file.layers.iter().filter(|layer| matches!(layer.kind, FileKind::Dense { .. })) {
        problems.add(layer.line, Some(&layer.name), ProblemKind::BesideHead { head });
    }
    problems.0.len() > before
}

/// Reports the layers that `prediction` does not depend on.
fn report_unused(
    file: &File,
    graph: &Graph,
    prediction: usize,
    readout: Option<usize>,
    problems: &mut Problems,
) {
    let against = Reversed(graph);
    let mut search = Dfs::new(against, NodeIndex::new(prediction + 1));
    let mut used = vec![false; file.layers.len() + 1];
    while let Some(node) = search.next(against) {
        used[node.index()] = true;
    }
    for (i, layer) in file.layers.iter().enumerate().filter(|&(i, _)| !used[i + 1]) {
        // A second readout was reported as such.
        if !matches!(layer.kind, FileKind::Readout { .. }) || readout == Some(i) {
            problems.add(layer.line, Some(&layer.name), ProblemKind::Unused);
        }
    }
}
