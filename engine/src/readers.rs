//! Reverse neighbour lists: for each slot, the rows that read it.
//!
//! A list is a chain of blocks of one cache line: the first belongs to the slot, the others come
//! from a store for all edges of a graph, so nothing is allocated later. Order does not matter:
//! rows are only marked dirty.

use meissner_kernels::prefetch;

use crate::memory::Memory;

const ROWS: usize = 15;

#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Block {
    rows: [u32; ROWS],
    /// The next block of the chain or of the free blocks; undefined for the last one.
    next: u32,
}

#[derive(Clone, Debug)]
pub(crate) struct Readers {
    /// The first block of each slot, then the store.
    blocks: Vec<Block>,
    /// Number of rows that read each slot.
    count: Vec<u32>,
    /// Last block of each slot's chain.
    last: Vec<u32>,
    /// First free block of the store; undefined if none is free.
    free: u32,
}

impl Readers {
    /// Empty lists for `slots` slots and at most `edges` rows in total.
    pub(crate) fn new(slots: usize, edges: usize, memory: &mut Memory) -> Self {
        Self {
            blocks: memory.values(slots + edges / ROWS, |i| Block { rows: [0; ROWS], next: i as u32 + 1 }),
            count: memory.copies(0, slots),
            last: memory.values(slots, |slot| slot as u32),
            free: slots as u32,
        }
    }

    #[inline]
    pub(crate) fn for_each(&self, slot: u32, mut visit: impl FnMut(u32)) {
        self.for_blocks(slot, |rows| rows.iter().for_each(|&row| visit(row)));
    }

    /// Prepares a visit of the rows that read `slot`.
    #[inline]
    pub(crate) fn prefetch(&self, slot: u32) {
        prefetch(&self.blocks[slot as usize..][..1]);
    }

    /// Calls `visit` with the rows that read `slot`, a block at a time.
    #[inline]
    pub(crate) fn for_blocks(&self, slot: u32, mut visit: impl FnMut(&[u32])) {
        let mut left = self.count[slot as usize] as usize;
        let mut block = slot;
        while left > 0 {
            let Block { rows, next } = &self.blocks[block as usize];
            let here = left.min(ROWS);
            visit(&rows[..here]);
            left -= here;
            block = *next;
        }
    }

    #[inline]
    pub(crate) fn push(&mut self, slot: u32, row: u32) {
        let at = self.count[slot as usize] as usize;
        if at > 0 && at.is_multiple_of(ROWS) {
            let block = self.free;
            self.free = self.blocks[block as usize].next;
            self.blocks[self.last[slot as usize] as usize].next = block;
            self.last[slot as usize] = block;
        }
        self.blocks[self.last[slot as usize] as usize].rows[at % ROWS] = row;
        self.count[slot as usize] += 1;
    }

    #[inline]
    pub(crate) fn remove(&mut self, slot: u32, row: u32) {
        let last = self.last[slot as usize];
        let at = self.count[slot as usize] as usize - 1;
        let moved = self.blocks[last as usize].rows[at % ROWS];
        let mut block = slot;
        loop {
            let Block { rows, next } = &mut self.blocks[block as usize];
            // Stale entries after the end of the last block come after the row.
            if let Some(found) = rows.iter_mut().find(|found| **found == row) {
                *found = moved;
                break;
            }
            debug_assert_ne!(block, last, "every edge stands in its source's list");
            block = *next;
        }
        self.count[slot as usize] = at as u32;
        if at > 0 && at.is_multiple_of(ROWS) {
            self.release_last(slot);
        }
    }

    #[inline]
    pub(crate) fn clear(&mut self, slot: u32) {
        while self.last[slot as usize] != slot {
            self.release_last(slot);
        }
        self.count[slot as usize] = 0;
    }

    /// Returns the last block of a chain, which is not its first, to the store.
    fn release_last(&mut self, slot: u32) {
        let last = self.last[slot as usize];
        let mut before = slot;
        while self.blocks[before as usize].next != last {
            before = self.blocks[before as usize].next;
        }
        self.last[slot as usize] = before;
        self.blocks[last as usize].next = self.free;
        self.free = last;
    }
}
