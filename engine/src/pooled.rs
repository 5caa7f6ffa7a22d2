//! The graph of a pooled level: cells of a fixed grid, their positions and their merged edges.
//!
//! Input: the delta of the level below. Output: this level's delta, and neighbourhoods with
//! attributes in the order of cells. Invariants: a cell is a node while it has a member; an edge
//! exists while an edge below joins members of its two cells (counted), never to itself; after
//! [`PooledGraph::update_positions`], positions and attributes are those of the present members.

use std::iter;

use meissner_kernels::{GraphRow, Matrix};

use crate::Sensor;
use crate::cells::{CellGrid, CellIndex, EventSums, Key, key, mean_position};
use crate::convolution::EdgeReads;
use crate::counters::PredictionCounters;
use crate::graph::Adjacency;
use crate::maxima::Maxima;
use crate::memory::{FixedVec, Memory};
use crate::merged::{Extent, Merged};
use crate::network::{Level, Network, Position};
use crate::rows::{Delta, RowSet};
use crate::window::Window;

#[derive(Clone, Copy)]
pub(crate) enum Below<'a> {
    Events(&'a Window),
    Cells(&'a PooledGraph),
}

/// Sizes of one level, which determine its memory.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    grid: CellGrid,
    rows_below: usize,
    /// Merged edges; `None` if no block of this level or above reads edges.
    edges: Option<Extent>,
    channels: usize,
    /// Whether the rows below never change and leave in order of arrival.
    queues: bool,
    /// Whether members' positions are summed in cell order.
    orders: bool,
    reads: EdgeReads,
}

impl Shape {
    /// Shapes of the pooled levels, lowest first, as long as rows fit 32 bits; and whether these
    /// are all levels.
    pub(crate) fn all(network: &Network, sensor: Sensor) -> (Vec<Self>, bool) {
        let parts = network.parts();
        let mut shapes: Vec<Self> = Vec::with_capacity(parts.pooled.len());
        let (mut rows, mut alive) = (Window::slots_for(parts.capacity), parts.capacity);
        let mut edges = parts.capacity * parts.graph.reach.most();
        for (i, (pooling, level)) in parts.pooled.iter().enumerate() {
            let below = shapes.last().map(|shape| &shape.grid);
            let grid = CellGrid::new(pooling.clone(), below, sensor, parts.span_us);
            let slots = grid.slots();
            if u32::try_from(slots).is_err() {
                return (shapes, false);
            }
            alive = alive.min(slots);
            let extent = Extent::new(slots, alive, edges);
            let follows = parts.pooled[i..].iter().any(|(_, level)| !level.blocks.is_empty());
            shapes.push(Self {
                rows_below: rows,
                edges: follows.then_some(extent),
                channels: network.channels(i + 1)[0],
                queues: i == 0 && parts.graph.is_frozen(),
                orders: i > 0 && grid.position() == Position::Mean,
                reads: level.edge_reads(),
                grid,
            });
            (rows, edges) = (slots, extent.edges);
        }
        (shapes, true)
    }

    pub(crate) fn slots(&self) -> usize {
        self.grid.slots()
    }

    pub(crate) fn most(&self) -> usize {
        self.edges.map_or(0, |extent| extent.most)
    }
}

#[derive(Clone, Debug)]
pub(crate) struct PooledGraph {
    grid: CellGrid,
    scale: f32,
    keys: Vec<Key>,
    sums: Vec<EventSums>,
    alive: usize,
    positions: Vec<[f64; 3]>,
    /// In-edges of each slot, in the order of their sources' keys; stored only if they are read.
    edges: Option<Merged>,
    pub(crate) maxima: Maxima,
    /// Cells whose members, or the position of a member, changed.
    moved: RowSet,
    /// Cells whose in-edges or attributes may have changed.
    stale: RowSet,
    /// Cells whose position changed since `finish`.
    pub(crate) shifted: RowSet,
    order: FixedVec<(Key, u32)>,
}

impl PooledGraph {
    pub(crate) fn new(shape: Shape, level: &Level, memory: &mut Memory) -> Self {
        let slots = shape.grid.slots();
        memory.add((size_of::<Self>() + shape.grid.bytes()) as u128);
        Self {
            scale: level.scale,
            keys: memory.copies([0; 3], slots),
            sums: memory.copies(EventSums::default(), slots),
            alive: 0,
            positions: memory.copies([0.0; 3], slots),
            edges: shape.edges.map(|extent| Merged::new(extent, shape.reads, memory)),
            maxima: Maxima::new(shape.rows_below, slots, shape.channels, shape.queues, memory),
            moved: RowSet::within(slots, memory),
            stale: RowSet::within(slots, memory),
            shifted: RowSet::within(slots, memory),
            order: memory.room(if shape.orders { shape.rows_below } else { 0 }),
            grid: shape.grid,
        }
    }

    pub(crate) fn clear(&mut self, values: &mut Matrix) {
        self.maxima.clear(values);
        self.sums.fill(EventSums::default());
        self.alive = 0;
        if let Some(edges) = &mut self.edges {
            edges.clear();
        }
        self.moved.clear();
        self.stale.clear();
    }

    pub(crate) fn position(&self, cell: u32) -> [f64; 3] {
        self.positions[cell as usize]
    }

    /// Index of the cell in slot `cell` along x, y and t.
    pub(crate) fn index(&self, cell: u32) -> CellIndex {
        let [t, y, x] = self.keys[cell as usize];
        [x, y, t]
    }

    /// Index along t of the cell in slot `cell`.
    pub(crate) fn time_cell(&self, cell: u32) -> i64 {
        self.keys[cell as usize][0]
    }

    pub(crate) fn is_alive(&self, cell: u32) -> bool {
        self.maxima.members.count(cell) > 0
    }

    pub(crate) fn nodes(&self) -> usize {
        self.alive
    }

    /// Slots of the cells with members, in cell order.
    pub(crate) fn cells(&self) -> Vec<u32> {
        let mut cells: Vec<u32> = (0..self.keys.len() as u32).filter(|&c| self.is_alive(c)).collect();
        cells.sort_unstable_by_key(|&c| self.keys[c as usize]);
        cells
    }

    fn keeps_sums(&self) -> bool {
        self.grid.position() == Position::Mean
    }

    /// Applies the delta of the level below with its pooled feature `features`; `values`: maxima.
    pub(crate) fn apply(
        &mut self,
        below: Below<'_>,
        features: &Matrix,
        values: &Matrix,
        from: &Delta,
        to: &mut Delta,
    ) {
        to.clear();
        for &row in from.entered.iter() {
            self.enter(below, row, to);
        }
        // If an edge replaces another one between the same cells, the cells stay joined.
        let edges = self.edges.as_ref();
        if edges.is_none_or(|edges| edges.has_room(from.added.len())) {
            self.connect_all(&from.added, to);
            self.disconnect_all(&from.removed, to);
        } else {
            self.disconnect_all(&from.removed, to);
            self.connect_all(&from.added, to);
        }
        for &row in from.left.iter() {
            self.leave(below, row, features, values, to);
        }
    }

    fn enter(&mut self, below: Below<'_>, row: u32, to: &mut Delta) {
        let index = match below {
            Below::Events(window) => {
                let node = window.node(row);
                self.grid.of_event(node.x, node.y, node.t)
            }
            Below::Cells(graph) => {
                let [t, y, x] = graph.keys[row as usize];
                self.grid.of_cell(&graph.grid, [x, y, t])
            }
        };
        let cell = self.grid.slot(index);
        if !self.is_alive(cell) {
            self.alive += 1;
            self.keys[cell as usize] = key(index);
            self.positions[cell as usize] = self.grid.centre(index);
            to.entered.push(cell);
            to.rewired.push(cell);
        }
        assert_eq!(self.keys[cell as usize], key(index), "two cells of a window never share a slot");
        self.maxima.enter(row, cell);
        if self.keeps_sums() {
            if let Below::Events(window) = below {
                let node = window.node(row);
                self.sums[cell as usize].add(node.x, node.y, node.t);
            }
            self.moved.insert(cell);
        }
    }

    fn leave(&mut self, below: Below<'_>, row: u32, features: &Matrix, values: &Matrix, to: &mut Delta) {
        let cell = self.maxima.cell_of(row);
        self.maxima.leave(row, features, values);
        if self.keeps_sums() {
            if let Below::Events(window) = below {
                let node = window.node(row);
                self.sums[cell as usize].subtract(node.x, node.y, node.t);
            }
            self.moved.insert(cell);
        }
        if !self.is_alive(cell) {
            assert!(self.edges(cell).neighbours.is_empty(), "edges go before their ends");
            self.moved.remove(cell);
            self.stale.remove(cell);
            self.alive -= 1;
            to.left.push(cell);
        }
    }

    fn connect_all(&mut self, added: &[(u32, u32)], to: &mut Delta) {
        let Self { edges: Some(edges), keys, maxima, stale, .. } = self else { return };
        for &(source, reader) in added {
            let (source, reader) = (maxima.cell_of(source), maxima.cell_of(reader));
            if source == reader {
                continue;
            }
            match find(edges, keys, source, reader) {
                Ok(at) => edges.count_up(reader, at),
                Err(at) => {
                    edges.insert(reader, at, source);
                    stale.insert(reader);
                    to.added.push((source, reader));
                }
            }
        }
    }

    fn disconnect_all(&mut self, removed: &[(u32, u32)], to: &mut Delta) {
        let Self { edges: Some(edges), keys, maxima, stale, .. } = self else { return };
        for &(source, reader) in removed {
            let (source, reader) = (maxima.cell_of(source), maxima.cell_of(reader));
            if source == reader {
                continue;
            }
            let at = find(edges, keys, source, reader);
            if edges.count_down(reader, at.expect("an edge that goes was merged when it came")) {
                stale.insert(reader);
                to.removed.push((source, reader));
            }
        }
    }

    /// Marks that a row of the level below changed its position.
    pub(crate) fn member_shifted(&mut self, row: u32) {
        if self.keeps_sums() {
            self.moved.insert(self.maxima.cell_of(row));
        }
    }

    /// Updates positions and attributes; calls `rewired` with cells of changed neighbourhoods.
    pub(crate) fn update_positions(
        &mut self,
        below: Below<'_>,
        counters: &mut PredictionCounters,
        mut rewired: impl FnMut(u32),
    ) {
        for i in 0..self.moved.len() {
            let cell = self.moved.as_slice()[i];
            let position = match below {
                Below::Events(_) => self.sums[cell as usize].mean(&self.grid),
                Below::Cells(graph) => self.mean_of_cells(graph, cell),
            };
            if position.map(f64::to_bits) != self.positions[cell as usize].map(f64::to_bits) {
                self.positions[cell as usize] = position;
                self.shifted.insert(cell);
                self.stale.insert(cell);
                if let Some(edges) = &self.edges {
                    edges.for_readers(iter::once(cell), |rows| {
                        rows.iter().for_each(|&row| self.stale.insert(row));
                    });
                }
            }
        }
        self.moved.clear();
        for &cell in self.stale.as_slice() {
            let Some(edges) = &mut self.edges else { break };
            let own = self.positions[cell as usize];
            let shifts = self.shifted.contains(cell);
            let moved = |source: u32| shifts || self.shifted.contains(source);
            let difference = |source: u32| [0, 1, 2].map(|d| self.positions[source as usize][d] - own[d]);
            let changed = edges.update_attributes(cell, self.scale, moved, difference);
            counters.neighbourhoods_checked += 1;
            if changed {
                rewired(cell);
            } else {
                counters.neighbourhoods_unchanged += 1;
            }
        }
        self.stale.clear();
    }

    fn mean_of_cells(&mut self, below: &Self, cell: u32) -> [f64; 3] {
        self.order.clear();
        let members = self.maxima.members.oldest_first(cell);
        self.order.extend(members.map(|m| (below.keys[m as usize], m)));
        self.order.sort_unstable();
        mean_position(self.order.iter().map(|&(_, m)| below.positions[m as usize]))
    }

    /// Clears the sets of changes, after everything downstream has processed them.
    pub(crate) fn finish(&mut self) {
        self.shifted.clear();
    }
}

/// Index of an in-edge of `reader` from `source`, or its insertion index.
fn find(edges: &Merged, keys: &[Key], source: u32, reader: u32) -> Result<usize, usize> {
    let key = keys[source as usize];
    edges.neighbours(reader).binary_search_by_key(&key, |n| keys[n.row as usize])
}

impl Adjacency for PooledGraph {
    #[inline]
    fn edges(&self, row: u32) -> GraphRow<'_> {
        self.edges.as_ref().map_or_else(GraphRow::default, |edges| edges.edges(row))
    }

    #[inline]
    fn for_readers(&self, rows: impl Iterator<Item = u32> + Clone, visit: impl FnMut(&[u32])) {
        if let Some(edges) = &self.edges {
            edges.for_readers(rows, visit);
        }
    }
}
