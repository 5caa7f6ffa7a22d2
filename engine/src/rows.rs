//! Sets of rows, rows in cells, and the changes of a graph's rows.
//!
//! A row is in at most one cell; a cell's rows are in order of arrival and linked both ways, so the
//! number of rows alone determines the memory.

use crate::memory::{FixedVec, Memory};

/// A set of rows below a fixed bound: O(1) to insert, remove, test and clear, O(members) to
/// iterate, in an order that results must not depend on.
#[derive(Clone, Debug)]
pub(crate) struct RowSet {
    members: FixedVec<u32>,
    /// For each row, its index in `members` if it is a member.
    index: Vec<u32>,
}

impl RowSet {
    pub(crate) fn new(bound: usize) -> Self {
        Self::within(bound, &mut Memory::default())
    }

    /// The same set, as a part of an engine.
    pub(crate) fn within(bound: usize, memory: &mut Memory) -> Self {
        Self { members: memory.room(bound), index: memory.copies(0, bound) }
    }

    #[inline]
    pub(crate) fn contains(&self, row: u32) -> bool {
        self.members.get(self.index[row as usize] as usize) == Some(&row)
    }

    #[inline]
    pub(crate) fn insert(&mut self, row: u32) {
        if !self.contains(row) {
            self.index[row as usize] = self.members.len() as u32;
            self.members.push(row);
        }
    }

    #[inline]
    pub(crate) fn remove(&mut self, row: u32) {
        if self.contains(row) {
            let at = self.index[row as usize];
            self.members.swap_remove(at as usize);
            if let Some(&moved) = self.members.get(at as usize) {
                self.index[moved as usize] = at;
            }
        }
    }

    #[inline]
    pub(crate) fn clear(&mut self) {
        self.members.clear();
    }

    #[inline]
    pub(crate) fn as_slice(&self) -> &[u32] {
        &self.members
    }

    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.members.len()
    }
}

/// A mostly empty set of rows below a fixed bound: O(1) operations, one byte per row.
#[derive(Clone, Debug)]
pub(crate) struct FewRows {
    marked: Vec<bool>,
    len: usize,
}

impl FewRows {
    pub(crate) fn new(bound: usize, memory: &mut Memory) -> Self {
        Self { marked: memory.copies(false, bound), len: 0 }
    }

    pub(crate) fn insert(&mut self, row: u32) {
        self.len += usize::from(!std::mem::replace(&mut self.marked[row as usize], true));
    }

    #[inline]
    pub(crate) fn remove(&mut self, row: u32) {
        if self.len > 0 {
            self.len -= usize::from(std::mem::take(&mut self.marked[row as usize]));
        }
    }

    /// O(rows) if there are members.
    pub(crate) fn clear(&mut self) {
        if self.len > 0 {
            self.marked.fill(false);
            self.len = 0;
        }
    }

    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.len
    }
}

/// A set of rows that only grows until cleared. A test reads one byte, which matters when each of a
/// thousand rows is inserted by twenty others.
#[derive(Clone, Debug, Default)]
pub(crate) struct GrowingSet {
    /// The members, then undefined entries; one entry more than the largest number of members.
    members: Vec<u32>,
    len: usize,
    marked: Vec<bool>,
}

impl GrowingSet {
    pub(crate) fn new(bound: usize, memory: &mut Memory) -> Self {
        Self { members: memory.copies(0, bound + 1), len: 0, marked: memory.copies(false, bound) }
    }

    /// Inserts `rows`. Rows that are members already are also written, and overwritten next: no
    /// unpredictable branch.
    #[inline]
    pub(crate) fn insert(&mut self, rows: &[u32]) {
        let (members, marked) = (&mut self.members[..], &mut self.marked[..]);
        let mut len = self.len;
        for &row in rows {
            let marked = &mut marked[row as usize];
            members[len] = row;
            len += usize::from(!*marked);
            *marked = true;
        }
        self.len = len;
    }

    /// O(members).
    pub(crate) fn clear(&mut self) {
        for &row in &self.members[..self.len] {
            self.marked[row as usize] = false;
        }
        self.len = 0;
    }

    #[inline]
    pub(crate) fn as_slice(&self) -> &[u32] {
        &self.members[..self.len]
    }
}

/// Doubly linked lists of the rows of each cell.
#[derive(Clone, Debug)]
pub(crate) struct Members {
    cell_of: Vec<u32>,
    /// Each member's next older and younger ones in its cell; undefined at the ends.
    older: Vec<u32>,
    younger: Vec<u32>,
    cells: Vec<Ends>,
}

/// First and last row of a cell, and their number.
#[derive(Clone, Copy, Debug, Default)]
struct Ends {
    oldest: u32,
    youngest: u32,
    count: u32,
}

impl Members {
    /// No members yet; at most `rows` members in `cells` cells.
    pub(crate) fn new(rows: usize, cells: usize, memory: &mut Memory) -> Self {
        Self {
            cell_of: memory.copies(0, rows),
            older: memory.copies(0, rows),
            younger: memory.copies(0, rows),
            cells: memory.copies(Ends::default(), cells),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.cells.fill(Ends::default());
    }

    pub(crate) fn clear_cell(&mut self, cell: u32) {
        self.cells[cell as usize] = Ends::default();
    }

    #[inline]
    pub(crate) fn cell_of(&self, row: u32) -> u32 {
        self.cell_of[row as usize]
    }

    #[inline]
    pub(crate) fn count(&self, cell: u32) -> u32 {
        self.cells[cell as usize].count
    }

    /// Oldest member of a cell; undefined for an empty cell.
    #[inline]
    pub(crate) fn oldest(&self, cell: u32) -> u32 {
        self.cells[cell as usize].oldest
    }

    /// Adds `row`, which is in no cell, to `cell`.
    #[inline]
    pub(crate) fn push(&mut self, row: u32, cell: u32) {
        self.cell_of[row as usize] = cell;
        let ends = &mut self.cells[cell as usize];
        if ends.count == 0 {
            ends.oldest = row;
        } else {
            self.younger[ends.youngest as usize] = row;
            self.older[row as usize] = ends.youngest;
        }
        ends.youngest = row;
        ends.count += 1;
    }

    /// Removes `row`, a member, from its cell; returns the cell.
    #[inline]
    pub(crate) fn remove(&mut self, row: u32) -> u32 {
        let cell = self.cell_of[row as usize];
        let ends = &mut self.cells[cell as usize];
        let (older, younger) = (self.older[row as usize], self.younger[row as usize]);
        match (row == ends.oldest, row == ends.youngest) {
            (true, true) => {}
            (true, false) => ends.oldest = younger,
            (false, true) => ends.youngest = older,
            (false, false) => {
                self.younger[older as usize] = younger;
                self.older[younger as usize] = older;
            }
        }
        ends.count -= 1;
        cell
    }

    #[inline]
    pub(crate) fn oldest_first(&self, cell: u32) -> Walk<'_> {
        let ends = self.cells[cell as usize];
        Walk { links: &self.younger, next: ends.oldest, left: ends.count }
    }

    /// The `count` youngest of a cell's members, oldest first. O(count) before the first.
    #[inline]
    pub(crate) fn youngest(&self, cell: u32, count: u32) -> Walk<'_> {
        let first = self.youngest_first(cell).take(count as usize).last();
        Walk { links: &self.younger, next: first.unwrap_or(0), left: count }
    }

    #[inline]
    pub(crate) fn youngest_first(&self, cell: u32) -> Walk<'_> {
        let ends = self.cells[cell as usize];
        Walk { links: &self.older, next: ends.youngest, left: ends.count }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Walk<'a> {
    links: &'a [u32],
    next: u32,
    left: u32,
}

impl Iterator for Walk<'_> {
    type Item = u32;

    #[inline]
    fn next(&mut self) -> Option<u32> {
        self.left = self.left.checked_sub(1)?;
        let row = self.next;
        self.next = self.links[row as usize];
        Some(row)
    }
}

/// Changes of a level's graph by an insertion or expiries: insert rows first, remove them last.
#[derive(Clone, Debug)]
pub(crate) struct Delta {
    pub(crate) entered: FixedVec<u32>,
    /// Removed edges (source, reader).
    pub(crate) removed: FixedVec<(u32, u32)>,
    /// New edges (source, reader).
    pub(crate) added: FixedVec<(u32, u32)>,
    /// Removed rows; their slots still hold their positions.
    pub(crate) left: FixedVec<u32>,
    /// Rows whose neighbourhood changed, including the entered rows. A row may occur twice.
    pub(crate) rewired: FixedVec<u32>,
}

/// Number of removed edges at which a joint expiry passes on its changes so far.
pub(crate) const PART: usize = 256;

impl Delta {
    /// No changes yet, for `capacity` events with at most `most` neighbours; records edges if
    /// `edges` is true. An event changes its own edges, and at most one in-edge and one out-edge of
    /// any other event.
    pub(crate) fn new(capacity: usize, most: usize, edges: bool, memory: &mut Memory) -> Self {
        let pairs = if edges { PART + capacity + most } else { 0 };
        Self {
            entered: memory.room(1),
            removed: memory.room(pairs),
            added: memory.room(pairs),
            left: memory.room(capacity),
            rewired: memory.room(PART + capacity),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.entered.clear();
        self.removed.clear();
        self.added.clear();
        self.left.clear();
        self.rewired.clear();
    }
}
