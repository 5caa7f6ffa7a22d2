//! The event graph's search structure: square cells of pixels, larger on sensors with too many
//! cells, each a queue of nodes in order of time. All queues share one store; its size depends on
//! the number of nodes, not on their positions.
//!
//! Inserting and expiring are O(1). A search with a guessed bound visits the cells within it; any
//! other search goes in rings around the query, and in each cell outwards from the query's time.
//! Skipped nodes have a lower bound of d2 above the search's bound, by the same rounded operations
//! as d2. Rounding is monotone, so a pruned node is never a result, not even by a tie.

use std::ops::Range;

use meissner_kernels::{Portable, Simd};

use crate::Sensor;
use crate::memory::Memory;
use crate::metric::{Metric, Node};
use crate::nearest::Nearest;
use crate::queues::{Block, Cursor, Entry, NODES, Place, Queue, Queues};

/// Largest number of cells. A search may visit all, and on a large sensor most would be empty.
const MAX_CELLS: usize = 1 << 15;

#[derive(Clone, Debug)]
pub(crate) struct Grid {
    side_log2: u32,
    columns: usize,
    rows: usize,
    cells: Queues,
    nodes: usize,
}

/// The nodes of a cell that a search visits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Times {
    All,
    /// Not later than the query.
    Past,
}
impl Grid {
    /// A grid for at most `capacity` nodes with cells of at least 2^`least_log2` pixels a side.
    pub(crate) fn new(sensor: Sensor, least_log2: u32, capacity: usize, memory: &mut Memory) -> Self {
        let (side_log2, [columns, rows]) = Self::extent(sensor, least_log2);
        Self { side_log2, columns, rows, cells: Queues::new(columns * rows, capacity, memory), nodes: 0 }
    }

    /// log2 of a cell's side, and the numbers of columns and rows of cells on a sensor.
    fn extent(sensor: Sensor, least_log2: u32) -> (u32, [usize; 2]) {
        let cells = |side_log2| {
            [sensor.width, sensor.height].map(|extent| usize::from(extent).div_ceil(1_usize << side_log2))
        };
        let fits = |&side_log2: &u32| cells(side_log2).iter().product::<usize>() <= MAX_CELLS;
        let side_log2 = (least_log2..u16::BITS).find(fits).unwrap_or(u16::BITS);
        (side_log2, cells(side_log2))
    }

    #[inline]
    pub(crate) fn cell(&self, x: u16, y: u16) -> usize {
        (usize::from(y) >> self.side_log2) * self.columns + (usize::from(x) >> self.side_log2)
    }

    pub(crate) fn cells(&self) -> usize {
        self.columns * self.rows
    }

    #[inline]
    pub(crate) fn len(&self, cell: usize) -> usize {
        self.cells.queue(cell).len()
    }

    pub(crate) fn slots(&self, cell: usize) -> impl Iterator<Item = u32> + '_ {
        self.cells.queue(cell).iter().map(|e| e.slot)
    }

    /// A cell and the cells of the rings around it.
    #[inline]
    pub(crate) fn about(&self, cell: usize, rings: usize) -> impl Iterator<Item = usize> + use<> {
        let (row, column, columns) = (cell / self.columns, cell % self.columns, self.columns);
        let across = column.saturating_sub(rings)..(column + rings + 1).min(columns);
        let down = row.saturating_sub(rings)..(row + rings + 1).min(self.rows);
        down.flat_map(move |row| across.clone().map(move |column| row * columns + column))
    }

    /// Adds a node that is not earlier than any other node of its cell.
    pub(crate) fn push(&mut self, slot: u32, node: Node) {
        let cell = self.cell(node.x, node.y);
        self.cells.push(cell, Entry { t: node.t, slot, x: node.x, y: node.y });
        self.nodes += 1;
    }

    /// Removes the oldest node of a cell. Panics if `node` is not the first that entered its cell.
    pub(crate) fn pop(&mut self, slot: u32, node: Node) {
        let first = self.cells.pop(self.cell(node.x, node.y));
        assert_eq!(first.map(|e| e.slot), Some(slot), "nodes expire in order of arrival");
        self.nodes -= 1;
    }

    /// Removes all nodes. O(cells).
    pub(crate) fn clear(&mut self) {
        self.cells.clear();
        self.nodes = 0;
    }

    /// Lower bound of the squared distance in the plane from a pixel to cell (`column`, `row`).
    #[inline(always)]
    fn plane2(&self, metric: &Metric, x: u16, y: u16, column: usize, row: usize) -> f64 {
        let gap = |p: u16, cell: usize| {
            let (p, low) = (usize::from(p), cell << self.side_log2);
            let high = low + (1 << self.side_log2) - 1;
            low.saturating_sub(p).max(p.saturating_sub(high))
        };
        metric.x2(gap(x, column)) + metric.y2(gap(y, row))
    }

    /// Calls `visit` with d2 and slot of every node within the bound. The bound starts as `bound`;
    /// each call returns the next bound, which must not grow.
    #[inline(always)]
    pub(crate) fn search<S: Simd>(
        &self,
        simd: S,
        metric: &Metric,
        query: Node,
        times: Times,
        bound: f64,
        visit: impl FnMut(f64, u32) -> f64,
    ) {
        self.search_from((simd, metric), query, times, bound, None, visit);
    }

    /// The same for queries in order of time on an unchanging grid: `cursors`, one per cell, store
    /// the position of the query's time.
    #[inline(always)]
    pub(crate) fn search_onwards(
        &self,
        metric: &Metric,
        query: Node,
        cursors: &mut [Cursor],
        bound: f64,
        visit: impl FnMut(f64, u32) -> f64,
    ) {
        self.search_from((Portable, metric), query, Times::All, bound, Some(cursors), visit);
    }

    /// [`Self::search`], or [`Self::search_onwards`] if there are `cursors`.
    #[inline(always)]
    fn search_from<S: Simd>(
        &self,
        (simd, metric): (S, &Metric),
        query: Node,
        times: Times,
        mut bound: f64,
        mut cursors: Option<&mut [Cursor]>,
        mut visit: impl FnMut(f64, u32) -> f64,
    ) {
        let (column, row) = (usize::from(query.x) >> self.side_log2, usize::from(query.y) >> self.side_log2);
        let mut left = self.nodes;
        for ring in 0.. {
            if left == 0 || self.ring2(metric, query, ring) > bound {
                return;
            }
            let (top, bottom) = (row.checked_sub(ring), row + ring);
            for r in row.saturating_sub(ring)..=bottom.min(self.rows - 1) {
                let edge = Some(r) == top || r == bottom;
                let step = if edge || ring == 0 { 1 } else { 2 * ring };
                let mut c = column as isize - ring as isize;
                while c <= (column + ring) as isize {
                    if c >= 0 && (c as usize) < self.columns {
                        let index = r * self.columns + c as usize;
                        let cell = self.cells.queue(index);
                        left -= cell.len();
                        if cell.len() > 0 {
                            let plane = self.plane2(metric, query.x, query.y, c as usize, r);
                            if plane <= bound {
                                let later = match &mut cursors {
                                    Some(cursors) => cell.later_than_onwards(query.t, &mut cursors[index]),
                                    None => cell.later_than(query.t),
                                };
                                let cell = (cell, later, plane);
                                bound = scan((simd, metric), query, times, cell, bound, &mut visit);
                            }
                        }
                    }
                    c += step as isize;
                }
            }
        }
    }

    /// Lower bound of d2 for all cells of ring `ring` and beyond.
    #[inline(always)]
    pub(crate) fn ring2(&self, metric: &Metric, query: Node, ring: usize) -> f64 {
        if ring == 0 {
            return 0.0;
        }
        let gap = |p: u16| {
            let (p, cell) = (usize::from(p), usize::from(p) >> self.side_log2);
            let after = ((cell + ring) << self.side_log2) - p;
            // No cells exist to the left of cell 0, so this side does not limit the search.
            let before =
                (cell + 1).checked_sub(ring).map_or(usize::MAX, |c| p - (c << self.side_log2).min(p) + 1);
            after.min(before)
        };
        metric.x2(gap(query.x)).min(metric.y2(gap(query.y)))
    }

    /// Adds to `found` every node within its bound that no other node of the same d2 precedes. No
    /// node is later than the query.
    #[inline(always)]
    pub(crate) fn find<S: Simd>(
        &self,
        simd: S,
        metric: &Metric,
        query: Node,
        found: &mut Nearest,
        arrival: impl Fn(u32) -> u32 + Copy,
    ) {
        let [columns, rows] = self.within(metric, query, found.bound());
        for row in rows.clone() {
            for column in columns.clone() {
                let cell = self.cells.queue(row * self.columns + column);
                cell.prefetch(cell.end());
            }
        }
        for row in rows {
            for column in columns.clone() {
                let cell = self.cells.queue(row * self.columns + column);
                if cell.len() == 0 {
                    continue;
                }
                let plane = self.plane2(metric, query.x, query.y, column, row);
                let mut next = (plane <= found.bound()).then(|| cell.end());
                while let Some(place) = next {
                    let (block, nodes) = (cell.block(place), cell.nodes_before(place));
                    let [d2, t2] = distances2(simd, metric, query, block);
                    let oldest = plane + t2[nodes.start];
                    found.add_all(&d2, &block.slots, nodes, arrival);
                    next = cell
                        .previous(place)
                        .filter(|&before| !found.excludes(oldest, || cell.latest_before(before), arrival));
                }
            }
        }
    }

    /// Columns and rows of the cells whose lower bound of d2 along that single axis is at most
    /// `bound`.
    #[inline(always)]
    fn within(&self, metric: &Metric, query: Node, bound: f64) -> [Range<usize>; 2] {
        [
            self.reached(query.x, self.columns, |d| metric.x2(d) <= bound),
            self.reached(query.y, self.rows, |d| metric.y2(d) <= bound),
        ]
    }

    /// Range of `cells` along a direction with a pixel that is `near` pixel `p` by its distance.
    #[inline(always)]
    fn reached(&self, p: u16, cells: usize, near: impl Fn(usize) -> bool) -> Range<usize> {
        let (p, cell) = (usize::from(p), usize::from(p) >> self.side_log2);
        let (mut start, mut end) = (cell, cell + 1);
        while start > 0 && near(p + 1 - (start << self.side_log2)) {
            start -= 1;
        }
        while end < cells && near((end << self.side_log2) - p) {
            end += 1;
        }
        start..end
    }

    /// Calls `visit` with d2 and slot of every node `n` with d2 at most `reach[cell of n]`, and of
    /// some others. `query` is not earlier than any node.
    #[inline(always)]
    pub(crate) fn search_reverse<S: Simd>(
        &self,
        simd: S,
        metric: &Metric,
        query: Node,
        reach: &mut [f64],
        mut visit: impl FnMut(f64, u32) -> Reader,
    ) {
        for row in 0..self.rows {
            for column in 0..self.columns {
                let index = row * self.columns + column;
                let cell = self.cells.queue(index);
                if cell.len() == 0 {
                    continue;
                }
                let plane = self.plane2(metric, query.x, query.y, column, row);
                if plane > reach[index] {
                    continue;
                }
                // A visited cell is read completely, so its reach becomes exact again.
                let mut widest = 0.0f64;
                let mut next = Some(cell.start());
                while let Some(place) = next {
                    next = cell.next(place);
                    next.iter().for_each(|&place| cell.prefetch(place));
                    let block = cell.block(place);
                    let [d2, _] = distances2(simd, metric, query, block);
                    for at in cell.nodes_from(place) {
                        widest = widest.max(visit(d2[at], block.slots[at]).bound);
                    }
                }
                reach[index] = widest;
            }
        }
    }
}

/// Answer of a visited reader to the search.
pub(crate) struct Reader {
    /// Largest d2 at which it would still accept a neighbour.
    pub(crate) bound: f64,
}

/// d2 of a query to each node of a block, and its term of time; undefined for entries without a
/// node.
#[inline(always)]
fn distances2<S: Simd>(simd: S, metric: &Metric, query: Node, block: &Block) -> [[f64; NODES]; 2] {
    let (mut d2, mut t2) = ([0.0; NODES], [0.0; NODES]);
    for at in 0..NODES {
        t2[at] = metric.t2(simd, query.t.wrapping_sub(block.times[at]));
        let apart = [query.x.abs_diff(block.x[at]), query.y.abs_diff(block.y[at])];
        d2[at] = metric.plane2(simd, apart) + t2[at];
    }
    [d2, t2]
}

/// Visits a cell from the query's time outwards; later nodes start at `later`, and `plane` is the
/// lower bound of d2 in the plane. Returns the new bound.
#[inline(always)]
fn scan<S: Simd>(
    (simd, metric): (S, &Metric),
    query: Node,
    times: Times,
    (cell, later, plane): (Queue<'_>, Place, f64),
    mut bound: f64,
    visit: &mut impl FnMut(f64, u32) -> f64,
) -> f64 {
    for onwards in [false, true] {
        let mut next = (!onwards || times == Times::All).then_some(later);
        while let Some(place) = next {
            let nodes = if onwards { cell.nodes_from(place) } else { cell.nodes_before(place) };
            next = if onwards { cell.next(place) } else { cell.previous(place) };
            if nodes.is_empty() {
                continue;
            }
            let block = cell.block(place);
            let [d2, t2] = distances2(simd, metric, query, block);
            let [nearest, farthest] =
                if onwards { [nodes.start, nodes.end - 1] } else { [nodes.end - 1, nodes.start] };
            if plane + t2[nearest] > bound {
                break;
            }
            for i in 0..nodes.len() {
                let at = if onwards { nodes.start + i } else { nodes.end - 1 - i };
                if d2[at] <= bound {
                    bound = visit(d2[at], block.slots[at]);
                }
            }
            if plane + t2[farthest] > bound {
                break;
            }
        }
    }
    bound
}
