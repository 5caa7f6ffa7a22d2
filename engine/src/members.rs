//! Membership of rows in cells: a row is in at most one; a cell's rows are in order of arrival.
//!
//! Rows of a cell are linked both ways, so the number of rows alone determines the memory.

use crate::memory::Memory;

/// Doubly linked lists of the rows of each cell.
#[derive(Clone, Debug)]
pub(crate) struct Members {
    /// Cell of each row that is a member.
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

    /// Removes all members of a cell.
    pub(crate) fn clear_cell(&mut self, cell: u32) {
        self.cells[cell as usize] = Ends::default();
    }

    /// The cell of a member.
    #[inline]
    pub(crate) fn cell_of(&self, row: u32) -> u32 {
        self.cell_of[row as usize]
    }

    /// Number of members of a cell.
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

    /// Removes `row`, a member, from its cell, which is returned.
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

    /// Members of a cell from the oldest to the youngest.
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

    /// Members of a cell from the youngest to the oldest.
    #[inline]
    pub(crate) fn youngest_first(&self, cell: u32) -> Walk<'_> {
        let ends = self.cells[cell as usize];
        Walk { links: &self.older, next: ends.youngest, left: ends.count }
    }
}

/// Iterator over members of a cell.
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn linked_members_are_those_of_plain_lists(
            steps in proptest::collection::vec((0u8..50, 0u32..20, 0u32..3), 0..300),
        ) {
            let mut members = Members::new(20, 3, &mut Memory::default());
            let mut lists = vec![Vec::new(); 3];
            for (step, row, cell) in steps {
                if step == 0 {
                    members.clear();
                    lists.iter_mut().for_each(Vec::clear);
                } else if let Some(at) = lists.iter().position(|list| list.contains(&row)) {
                    prop_assert_eq!(members.cell_of(row), at as u32);
                    prop_assert_eq!(members.remove(row), at as u32);
                    lists[at].retain(|&r| r != row);
                } else {
                    members.push(row, cell);
                    lists[cell as usize].push(row);
                }
                for (cell, list) in (0..).zip(&lists) {
                    prop_assert_eq!(members.count(cell) as usize, list.len());
                    prop_assert!(list.is_empty() || members.oldest(cell) == list[0]);
                    prop_assert!(members.oldest_first(cell).eq(list.iter().copied()));
                    prop_assert!(members.youngest_first(cell).eq(list.iter().rev().copied()));
                    for count in 0..=list.len() {
                        let last = &list[list.len() - count..];
                        prop_assert!(members.youngest(cell, count as u32).eq(last.iter().copied()));
                    }
                }
            }
        }
    }
}
