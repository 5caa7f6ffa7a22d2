//! The event graph: every node's neighbourhood, kept up to date as the window moves.
//!
//! Input: insertions and expiries. Output: the [`Delta`] of each. Invariant: a node's neighbourhood
//! is the first `most` candidates of the rule in the order (d2 ascending, then later arrival) with
//! d2 within the limit; with `frozen`, as of its arrival.
//!
//! An insertion finds the rows that it joins by a reverse search, pruned by the largest d2 at which
//! a node of a cell still takes a neighbour. An expiry finds its readers in the reverse lists; the
//! replacement is the first candidate after the old list's last, as all earlier ones are members.

use std::ops::Range;

use meissner_kernels::{GraphRow, Isa, Neighbour, Simd, Task};

use crate::Sensor;
use crate::edges::EdgeStore;
use crate::grid::{Grid, Reader, Times};
use crate::memory::Memory;
use crate::metric::{Metric, Node};
use crate::nearest::Nearest;
use crate::network::{Candidates, GraphRule, Level, Lifetime};
use crate::readers::Readers;
use crate::rows::Delta;
use crate::window::Window;

/// The graph of a level, as its layers read it.
pub(crate) trait Adjacency {
    /// In-edges of `row` with their stored data; `own` and `skip` are empty.
    fn edges(&self, row: u32) -> GraphRow<'_>;
    /// Calls `visit` with batches, in any order, of the rows that have an in-edge from one of
    /// `rows`; a row may come once per in-edge.
    fn for_readers(&self, rows: impl Iterator<Item = u32> + Clone, visit: impl FnMut(&[u32]));
}

#[derive(Clone, Debug)]
pub(crate) struct EventGraph {
    rule: GraphRule,
    metric: Metric,
    grid: Grid,
    most: usize,
    count: Vec<u16>,
    /// `most` in-edges per slot, the first `count` valid. With `frozen`, only of the [`WAVE`]
    /// newest nodes: a row is computed once, soon after its arrival.
    edges: EdgeStore,
    /// With `frozen`, each slot's index in `edges`, and its sources in order; some may have left.
    places: Vec<u8>,
    sources: Vec<u32>,
    next: u8,
    /// Largest d2 at which each slot would accept a later neighbour, if it may accept one.
    bounds: Vec<f64>,
    /// For each grid cell, an upper bound of the bounds of its nodes.
    reach: Vec<f64>,
    /// Rows that read each slot; stored only if needed.
    readers: Readers,
    keeps_readers: bool,
    found: Nearest,
    /// For each grid cell, the d2 of the last neighbour of the last node that entered it.
    extents: Vec<f64>,
}

/// log2 of the smallest side of a cell in pixels. Chosen by measurement: larger cells fill blocks
/// of nodes.
pub(crate) const SIDE_LOG2: u32 = 4;

/// Maximum number of nodes with `frozen` in-edges whose edges are kept: enough to share weights and
/// hide latencies, few enough for the caches.
pub(crate) const WAVE: usize = 64;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) d2: f64,
    pub(crate) slot: u32,
}

impl Candidate {
    /// Whether `self` is before `other` in a neighbourhood; `arrival` is larger for later slots.
    #[inline]
    pub(crate) fn precedes(&self, other: &Self, arrival: impl Fn(u32) -> u32) -> bool {
        self.d2 < other.d2 || (self.d2 == other.d2 && arrival(self.slot) > arrival(other.slot))
    }
}

impl EventGraph {
    /// An empty graph. Reverse lists exist if expiries change rows or `pooled` levels read edges.
    pub(crate) fn new(
        rule: GraphRule,
        sensor: Sensor,
        span_us: i64,
        level: &Level,
        slots: usize,
        pooled: bool,
        memory: &mut Memory,
    ) -> Self {
        let grid = Grid::new(sensor, SIDE_LOG2, slots, memory);
        let most = rule.reach.most();
        let keeps_readers = pooled || !rule.is_frozen();
        let (listed, edges) = if keeps_readers { (slots, slots * most) } else { (0, 0) };
        let (kept, frozen) = if rule.is_frozen() { (WAVE, slots) } else { (slots, 0) };
        let accepting = if rule.candidates == Candidates::All { slots } else { 0 };
        Self {
            rule,
            metric: Metric::new(sensor, span_us, level.scale, memory),
            bounds: memory.copies(0.0, accepting),
            reach: memory.copies(0.0, grid.cells()),
            extents: memory.copies(MIN, grid.cells()),
            grid,
            most,
            count: memory.copies(0, slots),
            edges: EdgeStore::new(kept * most, level.edge_reads(), memory),
            places: memory.copies(0, frozen),
            sources: memory.copies(0, frozen * most),
            next: 0,
            readers: Readers::new(listed, edges, memory),
            keeps_readers,
            found: Nearest::new(most, memory),
        }
    }

    /// Whether edge changes are reported to the levels above.
    pub(crate) fn tells_edges(&self) -> bool {
        self.keeps_readers
    }

    pub(crate) fn clear(&mut self, window: &Window) {
        self.grid.clear();
        self.reach.fill(0.0);
        self.extents.fill(MIN);
        if self.keeps_readers {
            window.slots().for_each(|slot| self.readers.clear(slot));
        }
    }

    fn span(&self, slot: u32) -> Range<usize> {
        let place = self.places.get(slot as usize).map_or(slot as usize, |&place| place.into());
        let start = place * self.most;
        start..start + usize::from(self.count[slot as usize])
    }

    pub(crate) fn degree(&self, slot: u32) -> usize {
        self.count[slot as usize].into()
    }

    /// Sources of the in-edges of `slot`, in order. With `frozen`, some may have left.
    pub(crate) fn sources(&self, slot: u32) -> impl Iterator<Item = u32> + '_ {
        let frozen = self.rule.is_frozen();
        let start = slot as usize * self.most;
        let sources = if frozen { &self.sources[start..start + self.degree(slot)] } else { &[] };
        let neighbours = if frozen { &[] } else { &self.edges.neighbours[self.span(slot)] };
        sources.iter().copied().chain(neighbours.iter().map(|n| n.row))
    }

    /// In-edges of `slot` from nodes still in `window`, in order. With `frozen`, the other in-edges
    /// name slots that are free or hold a later node: both rank after the reader.
    pub(crate) fn present<'a>(
        &'a self,
        window: &'a Window,
        slot: u32,
    ) -> impl Iterator<Item = Neighbour> + 'a {
        let (own, reader) = (window.age_rank(slot), window.node(slot));
        let end = if self.rule.is_frozen() { own } else { window.len() as u32 };
        let sources = self.sources(slot).filter(move |&row| window.age_rank(row) < end);
        sources.map(move |row| Neighbour { row, u: self.metric.attributes(window.node(row), reader) })
    }

    /// Updates the bound of `slot`, a node in grid cell `cell`, after its in-edges changed.
    fn set_bound(&mut self, slot: u32, cell: usize) {
        let span = self.span(slot);
        let full = span.len() == self.most;
        let bound = if full { self.edges.d2[span.end - 1] } else { self.rule.reach.limit() };
        self.bounds[slot as usize] = bound;
        self.reach[cell] = self.reach[cell].max(bound);
    }

    /// Connects `slot`, the newest of `window`, to the first `known` nodes of its neighbourhood.
    pub(crate) fn insert(&mut self, window: &Window, slot: u32, known: usize, isa: Isa, delta: &mut Delta) {
        let node = window.node(slot);
        self.find(window, node, isa);
        let found = || self.found.iter().take(known);
        self.count[slot as usize] = found().count() as u16;
        if let Some(place) = self.places.get_mut(slot as usize) {
            *place = self.next;
            self.next = (self.next + 1) % WAVE as u8;
        }
        let start = self.span(slot).start;
        for (kept, (_, source)) in self.sources.iter_mut().skip(slot as usize * self.most).zip(found()) {
            *kept = source;
        }
        for (i, (d2, source)) in found().enumerate() {
            self.edges.set(start + i, &self.metric, (source, window.node(source)), node, d2);
            if self.keeps_readers {
                self.readers.push(source, slot);
                delta.added.push((source, slot));
            }
        }
        delta.rewired.push(slot);
        if self.rule.candidates == Candidates::All {
            isa.run(Offer { graph: self, window, slot, node, delta });
            self.set_bound(slot, self.grid.cell(node.x, node.y));
        }
        self.grid.push(slot, node);
    }

    /// Writes the neighbourhood of `node`, which is newer than all nodes of the grid, to `found`.
    fn find(&mut self, window: &Window, node: Node, isa: Isa) {
        let Self { grid, metric, found, rule, extents, .. } = self;
        let (limit, arrival) = (rule.reach.limit(), |slot| window.age_rank(slot));
        let others = window.len() as u32 - 1;
        if others <= FEW {
            found.begin(limit);
            scan(metric, window, 0..others, node, limit, |d2, slot| {
                found.add(d2, slot, arrival);
                found.bound()
            });
            found.select(arrival);
            return;
        }
        // The extent of the last neighbourhood in this cell is mostly the right distance to search.
        let extent = &mut extents[grid.cell(node.x, node.y)];
        let mut bound = limit.min(GENEROUS * *extent);
        loop {
            found.begin(bound);
            isa.run(Find { grid, metric, window, node, found });
            if found.len() == rule.reach.most() || bound >= MAX.min(limit) {
                break;
            }
            bound = limit.min(bound * WIDER);
        }
        *extent = found.bound().max(MIN);
    }

    /// Removes the `leaving` oldest nodes from the search. Joint removal costs less: leaving nodes
    /// need no repair, and no replacement is about to leave.
    pub(crate) fn hide(&mut self, window: &Window, leaving: u32) {
        window.slots().take(leaving as usize).for_each(|slot| self.grid.pop(slot, window.node(slot)));
    }

    /// Removes the edges of `slot`, one of the `leaving` oldest, hidden nodes. Records the changes
    /// if levels above read edges or rows change.
    pub(crate) fn disconnect(
        &mut self,
        window: &Window,
        leaving: u32,
        slot: u32,
        isa: Isa,
        delta: &mut Delta,
    ) {
        if !self.keeps_readers {
            return;
        }
        let stays = |slot: u32| window.age_rank(slot) >= leaving;
        // Only under `all` can a leaving node be a reader of nodes that stay.
        if self.rule.candidates == Candidates::All {
            for edge in self.span(slot) {
                let source = self.edges.neighbours[edge].row;
                if stays(source) {
                    self.readers.remove(source, slot);
                    delta.removed.push((source, slot));
                }
            }
        }
        let start = delta.removed.len();
        self.readers.for_each(slot, |reader| delta.removed.push((slot, reader)));
        self.readers.clear(slot);
        for i in start..delta.removed.len() {
            let reader = delta.removed[i].1;
            if stays(reader) && !self.rule.is_frozen() {
                self.replace(window, leaving, slot, reader, isa, delta);
                delta.rewired.push(reader);
            }
        }
    }

    /// Replaces `gone`, one of the `leaving` oldest, in the neighbourhood of `reader` by the next
    /// candidate.
    fn replace(
        &mut self,
        window: &Window,
        leaving: u32,
        gone: u32,
        reader: u32,
        isa: Isa,
        delta: &mut Delta,
    ) {
        let span = self.span(reader);
        let slot = self.edges.neighbours[span.end - 1].row;
        let last = Candidate { d2: self.edges.d2[span.end - 1], slot };
        let at = span.clone().find(|&e| self.edges.neighbours[e].row == gone);
        let at = at.expect("a reader reads what it is listed for");
        self.edges.shift(at + 1..span.end, at);
        let kept = span.len() - 1;
        let next = isa.run(NextAfter { graph: self, window, leaving, reader, kept, last });
        if let Some(next) = next {
            let (source, node) = ((next.slot, window.node(next.slot)), window.node(reader));
            self.edges.set(span.end - 1, &self.metric, source, node, next.d2);
            self.readers.push(next.slot, reader);
            delta.added.push((next.slot, reader));
        } else {
            self.count[reader as usize] -= 1;
        }
        if self.rule.candidates == Candidates::All {
            let node = window.node(reader);
            self.set_bound(reader, self.grid.cell(node.x, node.y));
        }
    }
}

struct Find<'a> {
    grid: &'a Grid,
    metric: &'a Metric,
    window: &'a Window,
    node: Node,
    found: &'a mut Nearest,
}

impl Task for Find<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { grid, metric, window, node, found } = self;
        let arrival = |slot| window.age_rank(slot);
        grid.find(simd, metric, node, found, arrival);
        found.select(arrival);
    }
}

/// Offers the newest node to all others; nodes near enough take it as a neighbour.
struct Offer<'a> {
    graph: &'a mut EventGraph,
    window: &'a Window,
    slot: u32,
    node: Node,
    delta: &'a mut Delta,
}

impl Task for Offer<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { graph, window, slot, node, delta } = self;
        let EventGraph { grid, metric, bounds, reach, count, edges, readers, most, rule, .. } = graph;
        let (most, limit) = (*most, rule.reach.limit());
        grid.search_reverse(simd, metric, node, reach, |d2, reader| {
            let bound = &mut bounds[reader as usize];
            if d2 > *bound {
                return Reader { bound: *bound };
            }
            let start = reader as usize * most;
            let n = usize::from(count[reader as usize]);
            // At equal distances the later node comes first, and this node is the latest.
            let at = edges.d2[start..start + n].iter().rposition(|&d| d < d2).map_or(0, |i| i + 1);
            let n = if n == most {
                let lost = edges.neighbours[start + most - 1].row;
                readers.remove(lost, reader);
                delta.removed.push((lost, reader));
                most
            } else {
                count[reader as usize] += 1;
                n + 1
            };
            edges.shift(start + at..start + n - 1, start + at + 1);
            edges.set(start + at, metric, (slot, node), window.node(reader), d2);
            readers.push(slot, reader);
            delta.added.push((slot, reader));
            delta.rewired.push(reader);
            *bound = if n == most { edges.d2[start + n - 1] } else { limit };
            Reader { bound: *bound }
        });
    }
}

/// Finds the first candidate of `reader` after `last`; `reader` has `kept` neighbours left, and the
/// `leaving` oldest nodes are none.
struct NextAfter<'a> {
    graph: &'a EventGraph,
    window: &'a Window,
    leaving: u32,
    reader: u32,
    kept: usize,
    last: Candidate,
}

impl Task for NextAfter<'_> {
    type Output = Option<Candidate>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Candidate> {
        let Self { graph, window, leaving, reader, kept, last } = self;
        let EventGraph { grid, metric, most, rule, .. } = graph;
        let limit = rule.reach.limit();
        let past = rule.candidates == Candidates::Past(Lifetime::Window);
        let end = if past { window.age_rank(reader) } else { window.len() as u32 };
        let others = end - leaving - u32::from(!past);
        // A list that was not full contained every candidate.
        if kept + 1 < *most {
            return None;
        }
        let node = window.node(reader);
        let times = if past { Times::Past } else { Times::All };
        let mut bound = limit.min(GENEROUS * last.d2.max(MIN));
        loop {
            let mut best: Option<Candidate> = None;
            let visit = |d2, slot| {
                let candidate = Candidate { d2, slot };
                let arrival = |slot| window.age_rank(slot);
                if arrival(slot) < end
                    && slot != reader
                    && last.precedes(&candidate, arrival)
                    && best.as_ref().is_none_or(|best| candidate.precedes(best, arrival))
                {
                    best = Some(candidate);
                }
                best.map_or(bound, |best| best.d2)
            };
            if others <= FEW {
                scan(metric, window, leaving..end, node, bound, visit);
            } else {
                grid.search(simd, metric, node, times, bound, visit);
            }
            if best.is_some() || bound >= limit.min(MAX) {
                return best;
            }
            bound = limit.min(bound * WIDER);
        }
    }
}

/// Factor on an extent within which the next neighbourhood mostly has enough nodes. Measured.
const GENEROUS: f64 = 1.5;
/// Factor by which a search that did not find enough nodes is widened.
const WIDER: f64 = 4.0;
/// The extent from which searches are widened at first: 1/64 of the sensor or of the span.
const MIN: f64 = 1.0 / 4096.0;
/// No d2 of two nodes of a window is larger: each of its three terms is at most 1.
const MAX: f64 = 3.0;

/// Candidates up to this number are compared one by one: a grid search visits most of its cells.
const FEW: u32 = 64;

/// Calls `visit` with d2 and slot of the nodes at `places` with d2 to `query` within the bound.
/// Each call returns the next bound.
fn scan(
    metric: &Metric,
    window: &Window,
    places: Range<u32>,
    query: Node,
    mut bound: f64,
    mut visit: impl FnMut(f64, u32) -> f64,
) {
    for slot in window.slots_of(places) {
        let d2 = metric.distance2(query, window.node(slot));
        if d2 <= bound {
            bound = visit(d2, slot);
        }
    }
}

impl Adjacency for EventGraph {
    #[inline]
    fn edges(&self, row: u32) -> GraphRow<'_> {
        let EdgeStore { neighbours, basis, offsets, .. } = &self.edges;
        let span = self.span(row);
        GraphRow {
            neighbours: &neighbours[span.clone()],
            basis: basis.get(span.clone()).unwrap_or_default(),
            offsets: offsets.get(span).unwrap_or_default(),
            ..GraphRow::default()
        }
    }

    #[inline]
    fn for_readers(&self, rows: impl Iterator<Item = u32> + Clone, mut visit: impl FnMut(&[u32])) {
        rows.clone().for_each(|row| self.readers.prefetch(row));
        rows.for_each(|row| self.readers.for_blocks(row, &mut visit));
    }
}
