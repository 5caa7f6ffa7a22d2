//! Channel-wise maxima over cells with changing members.
//!
//! Input: members with their cells, their features, and which changed. Output: one row of maxima
//! per cell, and the cells whose row changed. A new member is merged into its cell's row. When a
//! member leaves or changes, the row is recomputed from all members, unless the member was below
//! the maximum in every channel. Members that never change and leave in order of arrival form a
//! queue with two partial maxima: for each member of the front, the maximum from it to the front's
//! end; and the maximum of the back. A removal then costs one row, plus a pass over the members
//! when the front is used up. Invariant after [`Maxima::update`]: each row is the maximum over the
//! cell's members, or zeros without any.

use meissner_kernels::{Isa, LANES, Lanes, Matrix, Simd, Task, clear_negative_zero, maximum, same_bits};

use crate::counters::LayerLog;
use crate::memory::Memory;
use crate::rows::{Members, RowSet};

#[derive(Clone, Debug)]
pub(crate) struct Maxima {
    pub(crate) members: Members,
    /// Whether the cell's row is the maximum over its members except the fresh ones.
    filled: Vec<bool>,
    /// Members that entered since the last `update`.
    fresh: RowSet,
    /// Cells to recompute from all members.
    pub(crate) dirty: RowSet,
    /// Cells into which fresh members are merged.
    merged: RowSet,
    queue: Option<Queue>,
    row: Vec<Lanes>,
}

/// Partial maxima of cells whose members form queues.
#[derive(Clone, Debug)]
struct Queue {
    /// For each member of a front, the maximum from it to the end of the front.
    suffix: Matrix,
    /// For each cell, the maximum of its settled members after the front.
    back: Matrix,
    /// Number of members in each cell's front: the first members of the cell.
    front: Vec<u32>,
}

impl Maxima {
    /// Room for `rows` members in `cells` cells. `queues`: members never change and leave in order
    /// of arrival.
    pub(crate) fn new(rows: usize, cells: usize, channels: usize, queues: bool, memory: &mut Memory) -> Self {
        Self {
            queue: queues.then(|| Queue {
                suffix: memory.matrix(rows, channels),
                back: memory.matrix(cells, channels),
                front: memory.copies(0, cells),
            }),
            members: Members::new(rows, cells, memory),
            filled: memory.copies(false, cells),
            fresh: RowSet::within(rows, memory),
            dirty: RowSet::within(cells, memory),
            merged: RowSet::within(cells, memory),
            row: memory.copies(Lanes::ZERO, Lanes::count(channels)),
        }
    }

    /// Removes all members; every cell is zeros after the next `update` over `values`.
    pub(crate) fn clear(&mut self, values: &mut Matrix) {
        self.members.clear();
        values.lanes_mut().fill(Lanes::ZERO);
        self.filled.fill(false);
        self.fresh.clear();
        self.dirty.clear();
        if let Some(queue) = &mut self.queue {
            queue.front.fill(0);
        }
    }

    #[inline]
    pub(crate) fn cell_of(&self, row: u32) -> u32 {
        self.members.cell_of(row)
    }

    pub(crate) fn enter(&mut self, row: u32, cell: u32) {
        self.members.push(row, cell);
        self.fresh.insert(row);
    }

    /// Removes `row`, unchanged since the last `update`, from its cell. `values` are the maxima.
    pub(crate) fn leave(&mut self, row: u32, features: &Matrix, values: &Matrix) {
        let cell = self.members.remove(row);
        if self.fresh.contains(row) {
            self.fresh.remove(row);
            return;
        }
        if let Some(queue) = &mut self.queue {
            // The maximum of a back is never read without a front: both are recomputed together.
            let front = &mut queue.front[cell as usize];
            *front = front.saturating_sub(1);
        }
        if !below(features.row(row as usize), values.row(cell as usize), values.columns()) {
            self.dirty.insert(cell);
        }
    }

    pub(crate) fn relocate(&mut self, row: u32, cell: u32) {
        let old = self.members.remove(row);
        self.dirty.insert(old);
        self.enter(row, cell);
    }

    /// Brings `values` up to date; calls `moved` with each cell whose row changed, and whether it
    /// has members.
    pub(crate) fn update(
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
                self.dirty.insert(self.members.cell_of(row));
            }
        }
        self.merged.clear();
        for &row in self.fresh.as_slice() {
            let cell = self.members.cell_of(row);
            if self.filled[cell as usize] && !self.dirty.contains(cell) {
                self.merged.insert(cell);
            } else {
                self.dirty.insert(cell);
            }
        }
        for &cell in self.merged.as_slice() {
            self.row.copy_from_slice(values.row(cell as usize));
            // Fresh members are at the end of their cell.
            let members = self.members.youngest_first(cell).take_while(|&m| self.fresh.contains(m));
            isa.run(Over { members: members.clone(), features, out: &mut self.row });
            if let Some(queue) = &mut self.queue {
                isa.run(Over { members, features, out: queue.back.row_mut(cell as usize) });
            }
            if store(&self.row, values, cell, log) {
                moved(cell, true);
            }
        }
        for &cell in self.dirty.as_slice() {
            let filled = self.members.count(cell) > 0;
            self.filled[cell as usize] = filled;
            if !filled {
                self.row.fill(Lanes::ZERO);
            } else if let Some(queue) = &mut self.queue {
                let members = &self.members;
                let fresh = members.youngest_first(cell).take_while(|&m| self.fresh.contains(m));
                isa.run(FromQueue { queue, cell, members, fresh, features, out: &mut self.row });
            } else {
                self.row.fill(Lanes::splat(f32::NEG_INFINITY));
                isa.run(Over { members: self.members.oldest_first(cell), features, out: &mut self.row });
            }
            if store(&self.row, values, cell, log) {
                moved(cell, filled);
            }
        }
        self.fresh.clear();
        self.dirty.clear();
    }
}

/// Writes the recomputed `row` if it differs, and notes both in `log`; returns whether it did.
pub(crate) fn store(row: &[Lanes], values: &mut Matrix, cell: u32, log: &mut LayerLog) -> bool {
    let stored = values.row_mut(cell as usize);
    let differs = !same_bits(row, stored);
    if differs {
        stored.copy_from_slice(row);
    }
    log.note(cell, !differs);
    differs
}

/// Whether `row` is below `maximum` in all `columns` channels: its removal changes nothing.
pub(crate) fn below(row: &[Lanes], maximum: &[Lanes], columns: usize) -> bool {
    let mut reaches = false;
    for (i, (row, maximum)) in row.iter().zip(maximum).enumerate() {
        let counts = (columns - i * LANES).min(LANES);
        for (v, m) in row.0[..counts].iter().zip(&maximum.0[..counts]) {
            // NaN counts as reaching the maximum: the members that reach it must be found again.
            reaches |= v >= m || v.is_nan();
        }
    }
    !reaches
}

struct Over<'a, I> {
    members: I,
    features: &'a Matrix,
    out: &'a mut [Lanes],
}

impl<I: Iterator<Item = u32> + Clone> Task for Over<'_, I> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { members, features, out } = self;
        maximum(simd, out, members.map(|member| features.row(member as usize)));
        clear_negative_zero(out);
    }
}

/// Computes the maximum of a queue of members.
struct FromQueue<'a, I> {
    queue: &'a mut Queue,
    cell: u32,
    members: &'a Members,
    /// Members that neither front nor back includes yet.
    fresh: I,
    features: &'a Matrix,
    out: &'a mut [Lanes],
}

impl<I: Iterator<Item = u32> + Clone> Task for FromQueue<'_, I> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { queue, cell, members, fresh, features, out } = self;
        let front = &mut queue.front[cell as usize];
        let back = queue.back.row_mut(cell as usize);
        if *front == 0 {
            // All members become the front, which ends with the newest.
            back.fill(Lanes::splat(f32::NEG_INFINITY));
            out.fill(Lanes::splat(f32::NEG_INFINITY));
            for member in members.youngest_first(cell) {
                maximum(simd, out, [features.row(member as usize)]);
                queue.suffix.row_mut(member as usize).copy_from_slice(out);
            }
            *front = members.count(cell);
        } else {
            maximum(simd, back, fresh.map(|member| features.row(member as usize)));
            out.copy_from_slice(queue.suffix.row(members.oldest(cell) as usize));
            maximum(simd, out, [&*back]);
        }
        clear_negative_zero(out);
    }
}
