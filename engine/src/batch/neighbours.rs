//! The neighbourhoods of all nodes of a window at once.
//!
//! Input: nodes in order of arrival. Output: for each node the `most` nearest others, in the
//! graph's order. Each grid cell lists the nodes of its rings in order of arrival. A node filters
//! the entries near in time, many at once in f32, and sorts the remaining ones by exact distance.
//! If the last neighbour is as far as the next ring can be, the grid is searched instead.

use std::ops::Range;

use bumpalo::Bump;
use meissner_kernels::{Isa, Nearby, Portable};

use crate::batch::setup::{Batch, Places, Propose};
use crate::graph::Candidate;
use crate::grid::{Grid, Times};
use crate::memory::Memory;
use crate::metric::{Metric, Node};
use crate::network::Candidates;
use crate::{Event, Sensor};

/// Rings of cells around a cell whose nodes are listed with it.
const RINGS: usize = 2;
/// log2 of the smallest side of a grid cell in pixels.
const SIDE_LOG2: u32 = 3;
/// Factors by which a guess is widened before the grid is searched.
const WIDER: [f64; 3] = [1.0, 3.0, 9.0];
/// Largest time up to which all whole numbers are exact in f32.
const MAX_US: i64 = 1 << 24;

/// The nodes to search, and their distances.
#[derive(Clone, Copy)]
pub(super) struct Space<'a> {
    /// In order of arrival; the first has time 0.
    pub(super) nodes: &'a [Node],
    pub(super) metric: &'a Metric,
    pub(super) sensor: Sensor,
    pub(super) span_us: i64,
}

impl Space<'_> {
    /// Whether the nodes are close enough in time for [`Self::nearest`].
    pub(super) fn is_short(&self) -> bool {
        self.nodes.last().is_none_or(|last| last.t <= MAX_US)
    }

    /// The `most` nearest others of every node, if nodes are [close in time](Self::is_short).
    ///
    /// Cost: each node is listed up to 25 times, and filters about 4 `most` entries of its list.
    pub(super) fn nearest(&self, most: usize, isa: Isa) -> Lists {
        let mut grid = Grid::new(self.sensor, SIDE_LOG2, self.nodes.len(), &mut Memory::default());
        self.nodes.iter().enumerate().for_each(|(i, &node)| grid.push(i as u32, node));
        let scratch = Bump::new();
        let listed = Listed::new(self.nodes, &grid, &scratch);
        let extents = [f64::from(self.sensor.width), f64::from(self.sensor.height), self.span_us as f64];
        let mut nearby = Nearby::new(extents.map(|extent| (1.0 / (extent * extent)) as f32));
        let mut lists = Lists::new(self.nodes.len(), self.nodes.len() * most);
        let mut found = Vec::with_capacity(most + 1);
        // The last neighbourhood of this cell gives the distance to search.
        let mut guess = 0.0;
        for cell in 0..grid.cells() {
            let mut part = listed.starts[cell]..listed.starts[cell];
            for slot in grid.slots(cell) {
                let node = self.nodes[slot as usize];
                let enough = WIDER.iter().any(|wider| {
                    found.clear();
                    let guess = guess * wider;
                    listed.narrow(cell, slot, self.reach(guess), &mut part);
                    let (points, at) = listed.points(&part, slot);
                    let place = points.map(|p| p[at]);
                    let near = nearby.find(isa, points, place, at, most, guess as f32).unwrap_or_default();
                    for &place in near {
                        let other = listed.slots[part.start + place as usize];
                        let d2 = self.metric.distance2(node, self.nodes[other as usize]);
                        take(&mut found, most, Candidate { d2, slot: other }, |slot| slot);
                    }
                    !near.is_empty()
                });
                let bound = if enough { found[most - 1].d2 } else { f64::INFINITY };
                if bound >= grid.ring2(self.metric, node, RINGS + 1) {
                    found.clear();
                    grid.search(Portable, self.metric, node, Times::All, bound, |d2, other| {
                        if other != slot {
                            take(&mut found, most, Candidate { d2, slot: other }, |slot| slot);
                        }
                        if found.len() == most { found[most - 1].d2 } else { bound }
                    });
                }
                guess = found.get(most - 1).map_or(guess, |last| last.d2);
                lists.set(slot, found.iter().map(|c| c.slot));
            }
        }
        lists
    }

    /// Largest time difference (us, rounded up) of a node within every bound of a guess.
    fn reach(&self, guess: f64) -> f32 {
        // Covers the filter's slack and the rounding of times to f32.
        const GENEROUS: f64 = 1.0 + 1e-6;
        const ROUNDED_US: f32 = 4.0;
        (self.span_us as f64 * (f64::from(Nearby::MAX_BOUND) * guess).sqrt() * GENEROUS) as f32 + ROUNDED_US
    }
}

/// For each non-empty cell, the nodes of its rings in order of arrival; one f32 array per axis.
struct Listed<'s> {
    /// Start of each cell's list, and the end of the last one.
    starts: &'s [usize],
    slots: &'s [u32],
    points: [&'s [f32]; 3],
    /// Index of each node in its own cell's list.
    places: &'s [usize],
}

impl<'s> Listed<'s> {
    fn new(nodes: &[Node], grid: &Grid, scratch: &'s Bump) -> Self {
        let starts = scratch.alloc_slice_fill_copy(grid.cells() + 1, 0);
        let mut total = 0;
        for (cell, start) in starts[..grid.cells()].iter_mut().enumerate() {
            *start = total;
            if grid.len(cell) > 0 {
                // Points at infinity pad each list, so that ranges in it can be rounded up.
                total +=
                    grid.about(cell, RINGS).map(|about| grid.len(about)).sum::<usize>() + Nearby::TOGETHER;
            }
        }
        starts[grid.cells()] = total;
        let ends = scratch.alloc_slice_copy(starts);
        let slots = scratch.alloc_slice_fill_copy(total, 0);
        let [x, y, t] = [0, 1, 2].map(|_| scratch.alloc_slice_fill_copy(total, f32::INFINITY));
        let places = scratch.alloc_slice_fill_copy(nodes.len(), 0);
        for (slot, node) in nodes.iter().enumerate() {
            let own = grid.cell(node.x, node.y);
            places[slot] = ends[own];
            for cell in grid.about(own, RINGS) {
                if grid.len(cell) > 0 {
                    let end = ends[cell];
                    ends[cell] += 1;
                    slots[end] = slot as u32;
                    (x[end], y[end], t[end]) = (node.x.into(), node.y.into(), node.t as f32);
                }
            }
        }
        Self { starts, slots, points: [x, y, t], places }
    }

    /// Moves `part` of a cell's list to the nodes at most `reach` in time from a node of the cell.
    fn narrow(&self, cell: usize, slot: u32, reach: f32, part: &mut Range<usize>) {
        let t = self.points[2];
        let (first, end) = (self.starts[cell], self.starts[cell + 1] - Nearby::TOGETHER);
        let place = self.places[slot as usize];
        let (earliest, latest) = (t[place] - reach, t[place] + reach);
        let Range { start, end: stop } = part;
        *start = (*start).min(place);
        while t[*start] < earliest {
            *start += 1;
        }
        while *start > first && t[*start - 1] >= earliest {
            *start -= 1;
        }
        *stop = (*stop).max(place + 1);
        while *stop < end && t[*stop] <= latest {
            *stop += 1;
        }
        while t[*stop - 1] > latest {
            *stop -= 1;
        }
    }

    /// A range of a list, rounded up, and the index of a node in it.
    fn points(&self, part: &Range<usize>, slot: u32) -> ([&[f32]; 3], usize) {
        let length = part.len().next_multiple_of(Nearby::TOGETHER);
        (self.points.each_ref().map(|p| &p[part.start..][..length]), self.places[slot as usize] - part.start)
    }
}

/// Inserts `candidate` into `list`, the first `most` so far; `arrival` as in `precedes`.
#[inline]
pub(super) fn take(
    list: &mut Vec<Candidate>,
    most: usize,
    candidate: Candidate,
    arrival: impl Fn(u32) -> u32,
) {
    if list.len() < most {
        list.push(candidate);
    } else if !candidate.precedes(&list[most - 1], &arrival) {
        return;
    }
    let mut at = list.len() - 1;
    while at > 0 && candidate.precedes(&list[at - 1], &arrival) {
        list[at] = list[at - 1];
        at -= 1;
    }
    list[at] = candidate;
}

#[derive(Clone, Debug)]
pub(super) struct Lists {
    /// Start index and number of each row's neighbours.
    spans: Vec<(usize, usize)>,
    sources: Vec<u32>,
}

impl Lists {
    /// `rows` rows without neighbours, with a capacity of `room` neighbours in total.
    pub(super) fn new(rows: usize, room: usize) -> Self {
        Self { spans: vec![(0, 0); rows], sources: Vec::with_capacity(room) }
    }

    pub(super) fn set(&mut self, row: u32, sources: impl IntoIterator<Item = u32>) {
        let start = self.sources.len();
        self.sources.extend(sources);
        self.spans[row as usize] = (start, self.sources.len() - start);
    }

    pub(super) fn edges(&self) -> usize {
        self.sources.len()
    }

    pub(super) fn rows(&self) -> impl Iterator<Item = &[u32]> {
        self.spans.iter().map(|&(start, count)| &self.sources[start..][..count])
    }
}

/// Range of event indices that event `i` may read from; it may include `i`.
pub(super) fn candidates(batch: &Batch, events: &[Event], i: usize) -> Range<usize> {
    let parts = batch.network.parts();
    match parts.graph.candidates {
        Candidates::All => 0..events.len(),
        Candidates::Past(_) if !parts.graph.is_frozen() => 0..i,
        Candidates::Past(_) => {
            // The window at the event's arrival, after evictions.
            let oldest = events[i].t_us.saturating_sub(parts.span_us);
            let in_time = events[..i].partition_point(|e| e.t_us < oldest);
            in_time.max((i + 1).saturating_sub(parts.capacity))..i
        }
    }
}

/// Neighbour indices of each event, by comparing it with every candidate.
pub(super) fn exhaustive(batch: &Batch, events: &[Event], extents: [f64; 3]) -> Lists {
    let mut lists = Lists::new(events.len(), 0);
    for i in 0..events.len() {
        lists.set(i as u32, first_of(batch, events, extents, i, candidates(batch, events, i)));
    }
    lists
}

/// Neighbour indices of each event, by comparing it with the candidates that `propose` gives.
pub(super) fn proposed(batch: &Batch, events: &[Event], extents: [f64; 3], propose: Propose) -> Lists {
    let position = |e: &Event| {
        let first_us = events.first().map_or(e.t_us, |first| first.t_us);
        [f64::from(e.x) / extents[0], f64::from(e.y) / extents[1], (e.t_us - first_us) as f64 / extents[2]]
    };
    let positions: Vec<[f64; 3]> = events.iter().map(position).collect();
    let candidates: Vec<Range<usize>> = (0..events.len()).map(|i| candidates(batch, events, i)).collect();
    let places =
        Places { positions: &positions, candidates: &candidates, reach: batch.network.parts().graph.reach };
    let mut lists = Lists::new(events.len(), 0);
    let mut i = 0;
    propose(&places, &mut |proposals| {
        let among = proposals.iter().map(|&j| j as usize).filter(|j| candidates[i].contains(j));
        lists.set(i as u32, first_of(batch, events, extents, i, among));
        i += 1;
    });
    assert_eq!(i, events.len(), "neighbours of every event must be proposed");
    lists
}

/// The first `most` of event `i`'s candidates in `among`: smaller distance, then later event.
fn first_of(
    batch: &Batch,
    events: &[Event],
    extents: [f64; 3],
    i: usize,
    among: impl Iterator<Item = usize>,
) -> impl Iterator<Item = u32> {
    let reach = batch.network.parts().graph.reach;
    let a = events[i];
    // Without `take`, which the searches that are compared with this one call.
    let mut first: Vec<(f64, usize)> = Vec::new();
    for j in among.filter(|&j| j != i) {
        let b = events[j];
        let [x, y, t] = [
            f64::from(a.x.abs_diff(b.x)) / extents[0],
            f64::from(a.y.abs_diff(b.y)) / extents[1],
            (a.t_us - b.t_us) as f64 / extents[2],
        ];
        let d2 = x * x + y * y + t * t;
        let bound = if first.len() < reach.most() { reach.limit() } else { first[reach.most() - 1].0 };
        if d2 <= bound {
            let at = first.partition_point(|&(nearer, k)| nearer.total_cmp(&d2).then(j.cmp(&k)).is_lt());
            first.insert(at, (d2, j));
            first.truncate(reach.most());
        }
    }
    first.into_iter().map(|(_, j)| j as u32)
}
