//! Sets of row indices.

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
    /// An empty set of rows below `bound`.
    pub(crate) fn new(bound: usize) -> Self {
        Self::within(bound, &mut Memory::default())
    }

    /// The same, as a part of an engine.
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
    /// An empty set of rows below `bound`.
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
    /// The members, then undefined entries; one longer than the largest number of members.
    members: Vec<u32>,
    len: usize,
    /// Whether each row is a member.
    marked: Vec<bool>,
}

impl GrowingSet {
    /// An empty set of rows below `bound`.
    pub(crate) fn new(bound: usize, memory: &mut Memory) -> Self {
        Self { members: memory.copies(0, bound + 1), len: 0, marked: memory.copies(false, bound) }
    }

    /// Inserts `rows`. Members are written too, and overwritten next: no unpredictable branch.
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn a_row_set_holds_what_a_tree_set_holds(steps in proptest::collection::vec((0u8..3, 0u32..20), 0..200)) {
            let (mut rows, mut tree) = (RowSet::new(20), BTreeSet::new());
            let mut few = FewRows::new(20, &mut Memory::default());
            let (mut growing, mut grown) = (GrowingSet::new(20, &mut Memory::default()), BTreeSet::new());
            for (step, row) in steps {
                match step {
                    0 => { rows.insert(row); few.insert(row); tree.insert(row); }
                    1 => { rows.remove(row); few.remove(row); tree.remove(&row); }
                    _ if row == 0 => { rows.clear(); few.clear(); tree.clear(); }
                    _ => prop_assert_eq!(rows.contains(row), tree.contains(&row)),
                }
                prop_assert_eq!(rows.as_slice().iter().copied().collect::<BTreeSet<_>>(), tree.clone());
                prop_assert_eq!([rows.len(), few.len()], [tree.len(); 2]);
                if step == 2 && row == 0 {
                    growing.clear();
                    grown.clear();
                } else {
                    growing.insert(&[row]);
                    grown.insert(row);
                }
                prop_assert_eq!(growing.as_slice().len(), grown.len());
                prop_assert_eq!(growing.as_slice().iter().copied().collect::<BTreeSet<_>>(), grown.clone());
            }
        }
    }
}
