//! The graph of the layers of a network over events: acyclic, with an order of evaluation.
//!
//! Input: a file. Output: a [`Wiring`]. Invariant: its `order` contains every layer to which no
//! cycle leads, after the layers that it reads, ties in the order of the file.

use petgraph::algo::kosaraju_scc;
use petgraph::graph::DiGraph;

use crate::description::document::ParsedLayer;
use crate::description::file::{EVENTS, File, FileKind};
use crate::description::layer::LayerKind;
use crate::description::problem::{ProblemKind, Problems};
use crate::description::references::{Reads, Scope, references, report_unused};

/// The graph of the layers of a network over events.
#[derive(Debug)]
pub(super) struct Wiring {
    pub(super) reads: Vec<Reads>,
    pub(super) order: Vec<usize>,
    /// The dense layer that predicts; with a head, the readout, which the head reads.
    pub(super) prediction: Option<usize>,
}

pub(super) fn wire(file: &File, problems: &mut Problems) -> Wiring {
    let before = problems.0.len();
    let place = if file.head.is_empty() { "in this file" } else { "of a table [[layer]]" };
    let scope = Scope { input: EVENTS, second: "skip", place, above: false };
    let reads = references(&file.layers, scope, problems);
    report_cycles(&file.layers, &reads, problems);
    // A layer of an unknown kind may be the missing one; a failed reference may refer to a layer
    // that no other layer reads.
    let known = file.layers.iter().all(|layer| layer.kind.is_some());
    let certain = known && problems.0.len() == before && file.layers.iter().all(|l| !l.name.is_empty());
    let readouts = indices(file, |kind| matches!(kind, LayerKind::Readout { .. }));
    let readout = report_missing(file, &readouts, known.then_some("a readout"), problems);
    if let Some(first) = readout {
        for second in readouts[1..].iter().map(|&i| &file.layers[i]) {
            let kind = ProblemKind::SecondReadout { first: file.layers[first].line };
            problems.add(second.line, Some(&second.name), kind);
        }
    }
    let prediction = prediction(file, &reads, readout, known, certain, problems);
    if let Some(prediction) = prediction {
        // A second readout was reported as such.
        let second = |i: usize| readouts.contains(&i) && readout != Some(i);
        report_unused(&file.layers, &reads, prediction, second, problems);
    }
    let order = order(&reads);
    Wiring { reads, order, prediction }
}

fn indices(file: &File, is: impl Fn(&LayerKind) -> bool) -> Vec<usize> {
    let is = |layer: &ParsedLayer<FileKind>| layer.kind.as_ref().is_some_and(|kind| is(&kind.kind));
    file.layers.iter().enumerate().filter(|(_, layer)| is(layer)).map(|(i, _)| i).collect()
}

/// The first of `found`; if none, `expected` is reported missing at the file's last layer.
fn report_missing(
    file: &File,
    found: &[usize],
    expected: Option<&'static str>,
    problems: &mut Problems,
) -> Option<usize> {
    if let Some(expected) = expected.filter(|_| found.is_empty()) {
        let line = file.layers.last().map_or(1, |layer| layer.line);
        problems.add(line, None, ProblemKind::MissingLayer { expected });
    }
    found.first().copied()
}

/// Reports one cycle of each set of layers that reach each other.
fn report_cycles(layers: &[ParsedLayer<FileKind>], reads: &[Reads], problems: &mut Problems) {
    let edges =
        |(i, reads): (usize, &Reads)| reads.iter().flatten().map(move |&read| (read, i + 1)).collect();
    let edges: Vec<(usize, usize)> = reads.iter().enumerate().flat_map::<Vec<_>, _>(edges).collect();
    for component in kosaraju_scc(&DiGraph::<(), (), usize>::from_edges(edges)) {
        let mut members: Vec<usize> = component.iter().filter_map(|n| n.index().checked_sub(1)).collect();
        members.sort_unstable();
        let mut path = Vec::from_iter(members.first().copied());
        let cycle = loop {
            let Some(&last) = path.last() else { break None };
            let within = |read: &usize| members.contains(read);
            let next = reads[last].iter().flatten().filter_map(|read| read.checked_sub(1)).find(within);
            let Some(next) = next else { break None };
            if let Some(at) = path.iter().position(|&p| p == next) {
                break Some(path.split_off(at));
            }
            path.push(next);
        };
        let Some(mut cycle) = cycle else { continue };
        // The path runs against the arrows; it is shown along the arrows, from the first layer in
        // the file.
        cycle.reverse();
        let first = cycle.iter().enumerate().min_by_key(|&(_, &layer)| layer).map_or(0, |(i, _)| i);
        cycle.rotate_left(first);
        let layer = &layers[cycle[0]];
        cycle.push(cycle[0]);
        let path: Vec<String> = cycle.iter().map(|&i| format!("{:?}", layers[i].name)).collect();
        problems.add(layer.line, Some(&layer.name), ProblemKind::Cycle(path.join(" -> ")));
    }
}

/// Layers to which no cycle leads, each after the layers that it reads, otherwise in the order of
/// the file. O(n^2).
fn order(reads: &[Reads]) -> Vec<usize> {
    let mut done = vec![false; reads.len() + 1];
    done[0] = true;
    let ready = |done: &[bool], i: usize| !done[i + 1] && reads[i].iter().flatten().all(|&read| done[read]);
    let mut order = Vec::new();
    while let Some(next) = (0..reads.len()).find(|&i| ready(&done, i)) {
        done[next + 1] = true;
        order.push(next);
    }
    order
}

/// The layer that predicts: with a head the readout, else the dense layer that no other layer
/// reads; `None` if not `certain`.
fn prediction(
    file: &File,
    reads: &[Reads],
    readout: Option<usize>,
    known: bool,
    certain: bool,
    problems: &mut Problems,
) -> Option<usize> {
    let mut dense = indices(file, |kind| matches!(kind, LayerKind::Dense { .. }));
    if let Some(head) = file.head.first() {
        for layer in dense.iter().map(|&i| &file.layers[i]) {
            problems.add(layer.line, Some(&layer.name), ProblemKind::BesideHead { head: head.line });
        }
        return readout.filter(|_| certain && dense.is_empty());
    }
    report_missing(file, &dense, known.then_some("a dense"), problems);
    dense.retain(|&i| !reads.iter().flatten().any(|&read| read == Some(i + 1)));
    let first = *dense.first().filter(|_| certain)?;
    for second in dense[1..].iter().map(|&i| &file.layers[i]) {
        let kind = ProblemKind::SecondPrediction { first: file.layers[first].line };
        problems.add(second.line, Some(&second.name), kind);
    }
    (dense.len() == 1).then_some(first)
}
