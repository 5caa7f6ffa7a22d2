//! Channel-wise sums over cells with changing members.
//!
//! Input: members with cells and times, their features, and which changed. Output: one row of sums
//! per cell, and the cells whose row changed. Addition is not associative, so the order is defined
//! ([`Network::sum_part_us`](crate::Network::sum_part_us)): over the members of each part of time
//! in order of arrival, then over the parts in order, each from zero. A new member is the last of
//! its part and is added to the part's row. When one leaves or changes, its part alone is summed
//! again. Invariant after [`Sums::update`]: each row is this sum, or zeros for an empty cell.

use meissner_kernels::{Isa, Lanes, Matrix, Simd, Task, add};

use crate::counters::LayerLog;
use crate::maxima::store;
use crate::members::Members;
use crate::memory::Memory;
use crate::network::SUM_PARTS;
use crate::rows::RowSet;

/// Parts that a window can touch: uncut, it begins and ends in the same place of one.
const RING: usize = SUM_PARTS as usize + 1;

#[derive(Clone, Debug)]
pub(crate) struct Sums {
    /// Duration of a part.
    part_us: i64,
    /// The part of the newest member.
    newest: i64,
    /// Members of each part of each cell; part p is at p modulo [`RING`] of its [`RING`] places.
    members: Members,
    /// Sums over them.
    rows: Matrix,
    /// Places that had members since the last `clear`.
    used: RowSet,
    /// Members that entered since the last `update`.
    fresh: RowSet,
    /// Places to sum from all members.
    dirty: RowSet,
    /// Places to whose row fresh members are added.
    grown: RowSet,
    /// Cells with a place whose row changed.
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

    /// Removes `row` from its cell.
    pub(crate) fn leave(&mut self, row: u32) {
        let place = self.members.remove(row);
        if self.fresh.contains(row) {
            self.fresh.remove(row);
        } else {
            self.dirty.insert(place);
        }
    }

    /// Brings `values` up to date; calls `moved` with the cells whose row changed. Per changed
    /// part: O(channels x (parts + n)), n its new members, or all if one left or changed.
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
        // The place after that of the newest part is that of the oldest one.
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

    #[allow(clippy::inline_always, reason = "compiled for the instruction set that runs it")]
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        for row in self.rows {
            add(self.out, self.of.row(row as usize));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use meissner_kernels::same_bits;
    use proptest::prelude::*;

    const ROWS: usize = 12;
    const CELLS: usize = 3;
    const PART_US: i64 = 3;
    const SPAN_US: i64 = SUM_PARTS * PART_US;

    proptest! {
        /// Features of very different sizes: a sum in another order has other bits.
        #[test]
        fn sums_are_those_of_plain_loops_over_parts_and_their_members_in_order_of_arrival(
            steps in proptest::collection::vec(
                (0u8..8, 0..ROWS as u32, 0..CELLS as u32, -1e8f32..1e8, any::<bool>(), 0..12i64),
                0..200,
            ),
        ) {
            let mut sums = Sums::new(PART_US, ROWS, CELLS, 2, &mut Memory::default());
            let (mut values, mut features) = (Matrix::zeros(CELLS, 2), Matrix::zeros(ROWS, 2));
            let mut changed = RowSet::new(ROWS);
            let mut lists: Vec<Vec<(u32, i64)>> = vec![Vec::new(); CELLS];
            let mut now = 0;
            for (step, row, cell, value, small, later) in steps {
                let held = lists.iter().position(|list| list.iter().any(|&(r, _)| r == row));
                let value = if small { value * 1e-8 } else { value };
                match (step, held) {
                    (0, _) => {
                        sums.clear(&mut values);
                        lists.iter_mut().for_each(Vec::clear);
                        changed.clear();
                    }
                    (1 | 2, Some(of)) => {
                        sums.leave(row);
                        changed.remove(row);
                        lists[of].retain(|&(r, _)| r != row);
                    }
                    (_, Some(_)) => {
                        features.row_mut(row as usize)[0] = Lanes::splat(value);
                        changed.insert(row);
                    }
                    (_, None) => {
                        now += later;
                        for (left, _) in lists.iter().flatten().filter(|&&(_, t)| t < now - SPAN_US) {
                            sums.leave(*left);
                            changed.remove(*left);
                        }
                        lists.iter_mut().for_each(|list| list.retain(|&(_, t)| t >= now - SPAN_US));
                        features.row_mut(row as usize)[0] = Lanes::splat(value);
                        sums.enter(row, cell, now);
                        lists[cell as usize].push((row, now));
                    }
                }
                if step < 6 {
                    let before = values.clone();
                    let mut log = LayerLog::default();
                    let mut moved = Vec::new();
                    sums.update(Isa::best(), &features, &changed, &mut values, &mut log, |cell| moved.push(cell));
                    moved.sort_unstable();
                    changed.clear();
                    let differ = (0..CELLS as u32).filter(|&c| !same_bits(values.row(c as usize), before.row(c as usize)));
                    let differ: Vec<_> = differ.collect();
                    prop_assert_eq!(log.counters.recomputed - log.counters.unchanged, differ.len() as u64);
                    prop_assert_eq!(moved, differ);
                    for (cell, list) in lists.iter().enumerate() {
                        let parts = list.chunk_by(|&(_, a), &(_, b)| a / PART_US == b / PART_US);
                        let of = |row: u32| features.row(row as usize)[0].0[0];
                        let sum = parts.fold(0.0f32, |sum, part| sum + part.iter().fold(0.0, |sum, &(r, _)| sum + of(r)));
                        prop_assert_eq!(values.row(cell)[0].0[0].to_bits(), sum.to_bits());
                    }
                }
            }
        }
    }
}
