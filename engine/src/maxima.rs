//! Channel-wise maxima over cells whose members come and go.
//!
//! Enters: members with the cell they are in, features of the members and which of them changed. Leaves: one row of
//! maxima per cell, and the cells whose row changed. A new member is merged into its cell's row; a member that leaves
//! or changes makes the row be taken again from all members, unless it was below the maximum in every channel.
//! Invariant after [`Maxima::settle`]: each row is the settled maximum over the cell's members, or zeros for a cell
//! without any.

use std::collections::VecDeque;

use meissner_kernels::{Isa, LANES, Lanes, Matrix, Task, maximum, same_bits, settle};

use crate::counters::LayerLog;
use crate::rows::RowSet;

#[derive(Clone, Debug)]
pub(crate) struct Maxima {
    /// Cell of each row that is a member.
    cell_of: Vec<u32>,
    /// Rows of each cell.
    members: Vec<VecDeque<u32>>,
    /// Whether the cell's row is the maximum over its members but for the fresh ones.
    filled: Vec<bool>,
    /// Members that entered since the last `settle`.
    fresh: RowSet,
    /// Cells to take again.
    dirty: RowSet,
    /// Cells that fresh members are merged into.
    merged: RowSet,
    row: Vec<Lanes>,
}

impl Maxima {
    /// No members, `rows` possible ones, `cells` cells.
    pub(crate) fn new(rows: usize, cells: usize, channels: usize) -> Self {
        Self {
            cell_of: vec![0; rows],
            members: vec![VecDeque::new(); cells],
            filled: vec![false; cells],
            fresh: RowSet::new(rows),
            dirty: RowSet::new(cells),
            merged: RowSet::new(cells),
            row: vec![Lanes::ZERO; Lanes::count(channels)],
        }
    }

    pub(crate) fn bytes(rows: usize, cells: usize) -> usize {
        rows * 6 * size_of::<u32>() + cells * (size_of::<VecDeque<u32>>() + 4 * size_of::<u32>())
    }

    /// Forgets all members; every cell is zeros after the next `settle` over `values`.
    pub(crate) fn clear(&mut self, values: &mut Matrix) {
        for (cell, members) in self.members.iter_mut().enumerate() {
            members.clear();
            values.row_mut(cell).fill(Lanes::ZERO);
        }
        self.filled.fill(false);
        self.fresh.clear();
        self.dirty.clear();
    }

    #[inline]
    pub(crate) fn cell_of(&self, row: u32) -> u32 {
        self.cell_of[row as usize]
    }

    pub(crate) fn members(&self, cell: u32) -> &VecDeque<u32> {
        &self.members[cell as usize]
    }

    /// `row` joins `cell`.
    pub(crate) fn enter(&mut self, row: u32, cell: u32) {
        self.cell_of[row as usize] = cell;
        self.members[cell as usize].push_back(row);
        self.fresh.insert(row);
    }

    /// `row`, with the features it had at the last `settle`, leaves its cell. `values` are the maxima.
    pub(crate) fn leave(&mut self, row: u32, features: &Matrix, values: &Matrix) {
        let cell = self.remove(row);
        if self.fresh.contains(row) {
            self.fresh.remove(row);
        } else if !below(features.row(row as usize), values.row(cell as usize), values.columns()) {
            self.dirty.insert(cell);
        }
    }

    /// `row` moves to another cell.
    pub(crate) fn relocate(&mut self, row: u32, cell: u32) {
        let old = self.remove(row);
        self.dirty.insert(old);
        self.enter(row, cell);
    }

    fn remove(&mut self, row: u32) -> u32 {
        let cell = self.cell_of[row as usize];
        let members = &mut self.members[cell as usize];
        // The oldest member leaves first, except where members are cells themselves.
        let at = members.iter().position(|&m| m == row).expect("a member stands in its cell");
        members.remove(at);
        cell
    }

    /// Brings every row of `values` up to date; `moved` is told the cells whose row changed, and whether they have
    /// members.
    pub(crate) fn settle(
        &mut self,
        isa: Isa,
        features: &Matrix,
        changed: &RowSet,
        values: &mut Matrix,
        log: &mut LayerLog,
        mut moved: impl FnMut(u32, bool),
    ) {
        for &row in changed.as_slice() {
            if !self.fresh.contains(row) {
                self.dirty.insert(self.cell_of[row as usize]);
            }
        }
        self.merged.clear();
        for &row in self.fresh.as_slice() {
            let cell = self.cell_of[row as usize];
            if self.filled[cell as usize] && !self.dirty.contains(cell) {
                self.merged.insert(cell);
            } else {
                self.dirty.insert(cell);
            }
        }
        for &cell in self.merged.as_slice() {
            self.row.copy_from_slice(values.row(cell as usize));
            // Fresh members stand at the end of their cell.
            let newest = self.members[cell as usize].iter().rev();
            let members = newest.take_while(|&&m| self.fresh.contains(m));
            isa.run(Over { members, features, out: &mut self.row });
            let changed = store(&self.row, values, cell);
            log.note(cell, !changed);
            if changed {
                moved(cell, true);
            }
        }
        for &cell in self.dirty.as_slice() {
            let members = &self.members[cell as usize];
            self.filled[cell as usize] = !members.is_empty();
            if members.is_empty() {
                self.row.fill(Lanes::ZERO);
            } else {
                self.row.fill(Lanes::splat(f32::NEG_INFINITY));
                isa.run(Over { members: members.iter(), features, out: &mut self.row });
            }
            let changed = store(&self.row, values, cell);
            log.note(cell, !changed);
            if changed {
                moved(cell, !members.is_empty());
            }
        }
        self.fresh.clear();
        self.dirty.clear();
    }
}

/// Writes `row` where it differs; whether it did.
fn store(row: &[Lanes], values: &mut Matrix, cell: u32) -> bool {
    let stored = values.row_mut(cell as usize);
    let differs = !same_bits(row, stored);
    if differs {
        stored.copy_from_slice(row);
    }
    differs
}

/// Whether `row` is below `maximum` in every of its `columns` channels: its loss cannot move it.
fn below(row: &[Lanes], maximum: &[Lanes], columns: usize) -> bool {
    let mut reaches = false;
    for (i, (row, maximum)) in row.iter().zip(maximum).enumerate() {
        let counts = (columns - i * LANES).min(LANES);
        for (v, m) in row.0[..counts].iter().zip(&maximum.0[..counts]) {
            // NaN counts as reaching: it never took part, but whatever did must be found again.
            reaches |= v >= m || v.is_nan();
        }
    }
    !reaches
}

/// Takes the maximum of `out` and the members' rows.
struct Over<'a, I> {
    members: I,
    features: &'a Matrix,
    out: &'a mut [Lanes],
}

impl<'a, I: Iterator<Item = &'a u32>> Task for Over<'_, I> {
    type Output = ();

    #[allow(clippy::inline_always, reason = "compiled for the instruction set that runs it")]
    #[inline(always)]
    fn run(self) {
        for &member in self.members {
            maximum(self.out, self.features.row(member as usize));
        }
        settle(self.out);
    }
}
