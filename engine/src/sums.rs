//! Channel-wise sums over cells with changing members.
//!
//! Input: members with cells and times, their features, and which changed. Output: one row of sums
//! per cell, and the cells whose row changed. Addition is not associative, so the order is defined
//! ([`Network::sum_part_us`](crate::Network::sum_part_us)): over the members of each part of time
//! in order of arrival, then over the parts in order, each from zero. A new member is the last of
//! its part and is added to the part's row. When a member leaves or changes, only its part is
//! summed again. Invariant after [`Sums::update`]: each row is this sum, or zeros for an empty
//! cell.

use meissner_kernels::{Isa, Lanes, Matrix, Simd, Task, add};

use crate::counters::LayerLog;
use crate::maxima::store;
use crate::memory::Memory;
use crate::network::SUM_PARTS;
use crate::rows::{Members, RowSet};

/// Number of parts that a window can touch: if it cuts no part, it begins and ends at the same
/// position in a part.
const RING: usize = SUM_PARTS as usize + 1;

#[derive(Clone, Debug)]
pub(crate) struct Sums {
    part_us: i64,
    /// The part of the newest member.
    newest: i64,
    /// Members of each part of each cell; part p is at p modulo [`RING`] of its [`RING`] places.
    members: Members,
    rows: Matrix,
    /// Places that had members since the last `clear`.
    used: RowSet,
    /// Members that entered since the last `update`.
    fresh: RowSet,
    /// Places to sum from all members.
    dirty: RowSet,
    /// Places to whose row fresh members are added.
    grown: RowSet,
    /// Cells that have a place whose row changed.
    moved: RowSet,
    row: Vec<Lanes>,
}

impl Sums {
    /// No members yet; at most `rows` members in `cells` cells.
    pub(crate) fn new(part_us: i64, rows: usize, cells: usize, channels: usize, memory: &mut Memory) -> Self {
        let places = cells * RING;
        Self {
            part_us,
            newest: 0,
            members: Members::new(rows, places, memory),
            rows: memory.matrix(places, channels),
            used: RowSet::within(places, memory),
            fresh: RowSet::within(rows, memory),
            dirty: RowSet::within(places, memory),
            grown: RowSet::within(places, memory),
            moved: RowSet::within(cells, memory),
            row: memory.copies(Lanes::ZERO, Lanes::count(channels)),
        }
    }

    /// Removes all members; every cell is zeros after the next `update` over `values`.
    pub(crate) fn clear(&mut self, values: &mut Matrix) {
        for &place in self.used.as_slice() {
            self.members.clear_cell(place);
            self.rows.row_mut(place as usize).fill(Lanes::ZERO);
            values.row_mut(place as usize / RING).fill(Lanes::ZERO);
        }
        self.used.clear();
        self.fresh.clear();
        self.dirty.clear();
    }

    /// Adds `row`, which arrived last at `t`, to `cell`. Members older than the window have left.
    pub(crate) fn enter(&mut self, row: u32, cell: u32, t: i64) {
        self.newest = t / self.part_us;
        let place = cell * RING as u32 + (self.newest % RING as i64) as u32;
        self.members.push(row, place);
        self.used.insert(place);
        self.fresh.insert(row);
    }

    pub(crate) fn leave(&mut self, row: u32) {
        let place = self.members.remove(row);
        if self.fresh.contains(row) {
            self.fresh.remove(row);
        } else {
            self.dirty.insert(place);
        }
    }

    /// Brings `values` up to date; calls `moved` with the cells whose row changed. Per changed
    /// part: O(channels x (parts + n)), where n is the number of its new members, or of all members
    /// if one left or changed.
    pub(crate) fn update(
        &mut self,
        isa: Isa,
        features: &Matrix,
        changed: &RowSet,
        values: &mut Matrix,
        log: &mut LayerLog,
        mut moved: impl FnMut(u32),
    ) {
        self.grown.clear();
        for &row in self.fresh.as_slice() {
            self.grown.insert(self.members.cell_of(row));
        }
        for &row in changed.as_slice() {
            if !self.fresh.contains(row) {
                self.dirty.insert(self.members.cell_of(row));
            }
        }
        for &place in self.grown.as_slice() {
            if !self.dirty.contains(place) {
                // Fresh members are at the end of their part.
                let fresh =
                    self.members.youngest_first(place).take_while(|&m| self.fresh.contains(m)).count();
                let members = self.members.youngest(place, fresh as u32);
                isa.run(Over { rows: members, of: features, out: self.rows.row_mut(place as usize) });
                self.moved.insert(place / RING as u32);
            }
        }
        for &place in self.dirty.as_slice() {
            let (members, out) = (self.members.oldest_first(place), self.rows.row_mut(place as usize));
            out.fill(Lanes::ZERO);
            isa.run(Over { rows: members, of: features, out });
            self.moved.insert(place / RING as u32);
        }
        // The place after that of the newest part belongs to the oldest one.
        let (ring, oldest) = (RING as u32, ((self.newest % RING as i64 + 1) % RING as i64) as u32);
        for &cell in self.moved.as_slice() {
            let first = cell * ring;
            let places = (first + oldest..first + ring).chain(first..first + oldest);
            self.row.fill(Lanes::ZERO);
            // An empty part is zeros, and a sum from +0 stays the same if +0 is added.
            isa.run(Over { rows: places, of: &self.rows, out: &mut self.row });
            if store(&self.row, values, cell, log) {
                moved(cell);
            }
        }
        self.fresh.clear();
        self.dirty.clear();
        self.moved.clear();
    }
}

/// Adds `rows` of a matrix to `out`, one after the other.
struct Over<'a, I> {
    rows: I,
    of: &'a Matrix,
    out: &'a mut [Lanes],
}

impl<I: Iterator<Item = u32>> Task for Over<'_, I> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        for row in self.rows {
            add(self.out, self.of.row(row as usize));
        }
    }
}
