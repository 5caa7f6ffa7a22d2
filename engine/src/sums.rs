//! Channel-wise sums over cells with changing members.
//!
//! Input: members with their cells, the features of the members, and which of them changed. Output: one row of sums per
//! cell, and the cells whose row changed. A sum is taken from zero over the members in order of arrival. Addition is not
//! associative, but a new member is the last of its cell, so that adding it to the cell's row gives the same bits. When a
//! member leaves or changes, the row is summed again from all members.
//! Invariant after [`Sums::update`]: each row is the sum over the cell's members in this order, or zeros for an empty cell.

use meissner_kernels::{Isa, Lanes, Matrix, Simd, Task, add};

use crate::counters::LayerLog;
use crate::maxima::store;
use crate::members::Members;
use crate::memory::Memory;
use crate::rows::RowSet;

#[derive(Clone, Debug)]
pub(crate) struct Sums {
    members: Members,
    /// Members that entered since the last `update`.
    fresh: RowSet,
    /// Cells to sum from all members.
    dirty: RowSet,
    /// Cells to whose row fresh members are added.
    grown: RowSet,
    row: Vec<Lanes>,
}

impl Sums {
    /// No members yet; at most `rows` members in `cells` cells.
    pub(crate) fn new(rows: usize, cells: usize, channels: usize, memory: &mut Memory) -> Self {
        Self {
            members: Members::new(rows, cells, memory),
            fresh: RowSet::within(rows, memory),
            dirty: RowSet::within(cells, memory),
            grown: RowSet::within(cells, memory),
            row: memory.copies(Lanes::ZERO, Lanes::count(channels)),
        }
    }

    /// Removes all members; every cell is zeros after the next `update` over `values`.
    pub(crate) fn clear(&mut self, values: &mut Matrix) {
        self.members.clear();
        values.lanes_mut().fill(Lanes::ZERO);
        self.fresh.clear();
        self.dirty.clear();
    }

    /// Adds `row`, which arrived after all members, to `cell`.
    pub(crate) fn enter(&mut self, row: u32, cell: u32) {
        self.members.push(row, cell);
        self.fresh.insert(row);
    }

    /// Removes `row` from its cell.
    pub(crate) fn leave(&mut self, row: u32) {
        let cell = self.members.remove(row);
        if self.fresh.contains(row) {
            self.fresh.remove(row);
        } else {
            self.dirty.insert(cell);
        }
    }

    /// Brings every row of `values` up to date; calls `moved` with the cells whose row changed. O(channels) for a cell with new
    /// members only and each of these, O(members x channels) for any other cell whose members changed.
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
        for &cell in self.grown.as_slice() {
            if self.dirty.contains(cell) {
                continue;
            }
            self.row.copy_from_slice(values.row(cell as usize));
            // Fresh members are at the end of their cell.
            let fresh = self.members.youngest_first(cell).take_while(|&m| self.fresh.contains(m)).count();
            let members = self.members.youngest(cell, fresh as u32);
            isa.run(Over { members, features, out: &mut self.row });
            if store(&self.row, values, cell, log) {
                moved(cell);
            }
        }
        for &cell in self.dirty.as_slice() {
            self.row.fill(Lanes::ZERO);
            isa.run(Over { members: self.members.oldest_first(cell), features, out: &mut self.row });
            if store(&self.row, values, cell, log) {
                moved(cell);
            }
        }
        self.fresh.clear();
        self.dirty.clear();
    }
}

/// Adds the members' rows to `out`, one after the other.
struct Over<'a, I> {
    members: I,
    features: &'a Matrix,
    out: &'a mut [Lanes],
}

impl<I: Iterator<Item = u32>> Task for Over<'_, I> {
    type Output = ();

    #[allow(clippy::inline_always, reason = "compiled for the instruction set that runs it")]
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        for member in self.members {
            add(self.out, self.features.row(member as usize));
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

    proptest! {
        /// Features of very different sizes: a sum in another order has other bits.
        #[test]
        fn sums_are_those_of_plain_loops_over_the_members_in_order_of_arrival(
            steps in proptest::collection::vec((0u8..8, 0..ROWS as u32, 0..CELLS as u32, -1e8f32..1e8, any::<bool>()), 0..200),
        ) {
            let mut sums = Sums::new(ROWS, CELLS, 2, &mut Memory::default());
            let (mut values, mut features) = (Matrix::zeros(CELLS, 2), Matrix::zeros(ROWS, 2));
            let mut changed = RowSet::new(ROWS);
            let mut lists: Vec<Vec<u32>> = vec![Vec::new(); CELLS];
            for (step, row, cell, value, small) in steps {
                let held = lists.iter().position(|list| list.contains(&row));
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
                        lists[of].retain(|&r| r != row);
                    }
                    (_, Some(_)) => {
                        features.row_mut(row as usize)[0] = Lanes::splat(value);
                        changed.insert(row);
                    }
                    (_, None) => {
                        features.row_mut(row as usize)[0] = Lanes::splat(value);
                        sums.enter(row, cell);
                        lists[cell as usize].push(row);
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
                        let sum = list.iter().fold(0.0f32, |sum, &r| sum + features.row(r as usize)[0].0[0]);
                        prop_assert_eq!(values.row(cell)[0].0[0].to_bits(), sum.to_bits());
                    }
                }
            }
        }
    }
}
