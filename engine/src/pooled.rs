//! The graph of a pooled level: cells of a fixed grid, their positions and their merged edges.
//!
//! Enters: the delta of the level below. Leaves: the delta of this level, and attributed neighbourhoods in the order
//! of cell indices. Invariants: a cell is a node while it has a member; an edge exists while at least one edge of the
//! level below joins members of its two cells, counted; no cell has an edge to itself; after [`PooledGraph::settle`],
//! positions and attributes are those of the present members.

use meissner_kernels::{Lanes, Matrix, Neighbour, attribute, spline_basis};

use crate::cells::{CellGrid, EventSums, Key, key, mean_position};
use crate::counters::PredictionCounters;
use crate::delta::Delta;
use crate::graph::Adjacency;
use crate::maxima::Maxima;
use crate::network::{Level, Position};
use crate::rows::RowSet;
use crate::window::Window;

/// Edge attributes of a source at `source` for a reader at `reader`.
fn attributes(source: [f64; 3], reader: [f64; 3], scale: f32) -> [f32; 3] {
    [0, 1, 2].map(|d| attribute(source[d] - reader[d], scale))
}

/// The level that a pooling reads.
#[derive(Clone, Copy)]
pub(crate) enum Below<'a> {
    Events(&'a Window),
    Cells(&'a PooledGraph),
}

#[derive(Clone, Copy, Debug)]
struct InEdge {
    source: u32,
    /// Edges of the level below that it stands for.
    count: u32,
}

#[derive(Clone, Debug)]
pub(crate) struct PooledGraph {
    grid: CellGrid,
    scale: f32,
    /// The cell in each slot.
    keys: Vec<Key>,
    sums: Vec<EventSums>,
    alive: usize,
    positions: Vec<[f64; 3]>,
    /// In-edges of each slot, in the order of their sources' keys.
    in_edges: Vec<Vec<InEdge>>,
    readers: Vec<Vec<u32>>,
    /// `in_edges` with attributes, as of the last `settle`.
    neighbours: Vec<Vec<Neighbour>>,
    /// The basis of each of `neighbours`, where a block reads it.
    basis: Vec<Vec<Lanes>>,
    keeps_basis: bool,
    pub(crate) maxima: Maxima,
    /// Cells whose members, or a member's position, changed.
    moved: RowSet,
    /// Cells whose in-edges or attributes may have changed.
    stale: RowSet,
    /// Cells whose position changed since `finish`.
    shifted: RowSet,
    order: Vec<(Key, u32)>,
}

impl PooledGraph {
    /// The graph over `grid` that `level` reads. `queues`: whether the rows below never change and leave in the order in
    /// which they come.
    pub(crate) fn new(
        grid: CellGrid,
        level: &Level,
        rows_below: usize,
        channels: usize,
        queues: bool,
    ) -> Self {
        let slots = grid.slots();
        let keeps_basis = level.reads_basis();
        Self {
            scale: level.scale,
            keys: vec![[0; 3]; slots],
            sums: vec![EventSums::default(); slots],
            alive: 0,
            positions: vec![[0.0; 3]; slots],
            in_edges: vec![Vec::new(); slots],
            readers: vec![Vec::new(); slots],
            neighbours: vec![Vec::new(); slots],
            basis: vec![Vec::new(); slots],
            keeps_basis,
            maxima: Maxima::new(rows_below, slots, channels, queues),
            moved: RowSet::new(slots),
            stale: RowSet::new(slots),
            shifted: RowSet::new(slots),
            order: Vec::new(),
            grid,
        }
    }

    pub(crate) fn bytes(slots: usize, rows_below: usize, channels: usize, queues: bool) -> usize {
        Maxima::bytes(rows_below, slots, channels, queues) + slots * 900
    }

    pub(crate) fn grid(&self) -> &CellGrid {
        &self.grid
    }

    pub(crate) fn clear(&mut self, values: &mut Matrix) {
        self.maxima.clear(values);
        self.sums.fill(EventSums::default());
        self.alive = 0;
        self.in_edges.iter_mut().for_each(Vec::clear);
        self.readers.iter_mut().for_each(Vec::clear);
        self.neighbours.iter_mut().for_each(Vec::clear);
        self.basis.iter_mut().for_each(Vec::clear);
        self.moved.clear();
        self.stale.clear();
        self.shifted.clear();
    }

    pub(crate) fn position(&self, cell: u32) -> [f64; 3] {
        self.positions[cell as usize]
    }

    /// Index along t of a node's cell.
    pub(crate) fn time_cell(&self, cell: u32) -> i64 {
        self.keys[cell as usize][0]
    }

    pub(crate) fn is_alive(&self, cell: u32) -> bool {
        self.maxima.members().count(cell) > 0
    }

    /// Number of cells with members.
    pub(crate) fn nodes(&self) -> usize {
        self.alive
    }

    /// Slots of the cells with members, in the order of cells.
    pub(crate) fn cells(&self) -> Vec<u32> {
        let mut cells: Vec<u32> = (0..self.keys.len() as u32).filter(|&c| self.is_alive(c)).collect();
        cells.sort_unstable_by_key(|&c| self.keys[c as usize]);
        cells
    }

    fn keeps_sums(&self) -> bool {
        self.grid.position() == Position::Mean
    }

    /// Applies the delta of the level below, whose pooled feature is `features`; `values` are this level's maxima.
    pub(crate) fn apply(
        &mut self,
        below: Below<'_>,
        features: &Matrix,
        values: &Matrix,
        from: &Delta,
        to: &mut Delta,
    ) {
        to.clear();
        for &row in &from.entered {
            self.enter(below, row, to);
        }
        for &(source, reader) in &from.removed {
            self.disconnect(self.maxima.cell_of(source), self.maxima.cell_of(reader), to);
        }
        for &(source, reader) in &from.added {
            self.connect(self.maxima.cell_of(source), self.maxima.cell_of(reader), to);
        }
        for &row in &from.left {
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
            self.neighbours[cell as usize].clear();
            self.basis[cell as usize].clear();
        }
        debug_assert_eq!(self.keys[cell as usize], key(index), "two cells of a window never share a slot");
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
            debug_assert!(self.in_edges[cell as usize].is_empty() && self.readers[cell as usize].is_empty());
            self.moved.remove(cell);
            self.stale.remove(cell);
            self.shifted.remove(cell);
            self.alive -= 1;
            to.left.push(cell);
        }
    }

    /// Where an in-edge from the cell with `key` stands, or would stand.
    fn find(&self, reader: u32, key: Key) -> Result<usize, usize> {
        self.in_edges[reader as usize].binary_search_by_key(&key, |e| self.keys[e.source as usize])
    }

    fn connect(&mut self, source: u32, reader: u32, to: &mut Delta) {
        if source == reader {
            return;
        }
        match self.find(reader, self.keys[source as usize]) {
            Ok(at) => self.in_edges[reader as usize][at].count += 1,
            Err(at) => {
                self.in_edges[reader as usize].insert(at, InEdge { source, count: 1 });
                self.readers[source as usize].push(reader);
                self.stale.insert(reader);
                to.added.push((source, reader));
            }
        }
    }

    fn disconnect(&mut self, source: u32, reader: u32, to: &mut Delta) {
        if source == reader {
            return;
        }
        let at =
            self.find(reader, self.keys[source as usize]).expect("an edge that goes was merged when it came");
        let edges = &mut self.in_edges[reader as usize];
        edges[at].count -= 1;
        if edges[at].count == 0 {
            edges.remove(at);
            let readers = &mut self.readers[source as usize];
            let at =
                readers.iter().position(|&r| r == reader).expect("every edge stands in its source's list");
            readers.swap_remove(at);
            self.stale.insert(reader);
            to.removed.push((source, reader));
        }
    }

    /// Notes that a row of the level below changed its position.
    pub(crate) fn member_shifted(&mut self, row: u32) {
        if self.keeps_sums() {
            self.moved.insert(self.maxima.cell_of(row));
        }
    }

    /// Cells whose position changed since `finish`.
    pub(crate) fn shifted(&self) -> &RowSet {
        &self.shifted
    }

    /// Brings positions and attributes up to date; `rewired` is told each cell whose neighbourhood changed.
    pub(crate) fn settle(
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
                for &reader in &self.readers[cell as usize] {
                    self.stale.insert(reader);
                }
            }
        }
        self.moved.clear();
        for &cell in self.stale.as_slice() {
            let own = self.positions[cell as usize];
            let (edges, list) = (&self.in_edges[cell as usize], &mut self.neighbours[cell as usize]);
            let basis = &mut self.basis[cell as usize];
            let mut changed = edges.len() != list.len();
            list.resize(edges.len(), Neighbour { row: u32::MAX, u: [0.0; 3] });
            if self.keeps_basis {
                basis.resize(edges.len(), Lanes::ZERO);
            }
            for (i, edge) in edges.iter().enumerate() {
                let u = attributes(self.positions[edge.source as usize], own, self.scale);
                let neighbour = Neighbour { row: edge.source, u };
                if list[i] != neighbour {
                    list[i] = neighbour;
                    changed = true;
                    if self.keeps_basis {
                        basis[i] = spline_basis(u);
                    }
                }
            }
            counters.neighbourhoods_checked += 1;
            if changed {
                rewired(cell);
            } else {
                counters.neighbourhoods_unchanged += 1;
            }
        }
        self.stale.clear();
    }

    /// Mean of the members' positions, in cell order.
    fn mean_of_cells(&mut self, below: &Self, cell: u32) -> [f64; 3] {
        self.order.clear();
        let members = self.maxima.members().from_oldest(cell);
        self.order.extend(members.map(|m| (below.keys[m as usize], m)));
        self.order.sort_unstable();
        mean_position(self.order.iter().map(|&(_, m)| below.positions[m as usize]))
    }

    /// Everything downstream has seen the changes.
    pub(crate) fn finish(&mut self) {
        self.shifted.clear();
    }
}

impl Adjacency for PooledGraph {
    #[inline]
    fn neighbours(&self, row: u32) -> &[Neighbour] {
        &self.neighbours[row as usize]
    }

    #[inline]
    fn basis(&self, row: u32) -> &[Lanes] {
        &self.basis[row as usize]
    }

    #[inline]
    fn for_readers(&self, row: u32, mut visit: impl FnMut(&[u32])) {
        visit(&self.readers[row as usize]);
    }
}
