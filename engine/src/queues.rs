//! Queues of nodes, one per grid cell, in blocks from one store.
//!
//! Nodes enter a queue at its end and leave at its start. A queue is a chain of blocks of two cache lines; only its
//! first and its last block can be partly filled. The store has as many blocks as its queues can need at once, however
//! a bounded number of nodes is spread over them: nothing is allocated after construction.

use crate::memory::{Memory, Room};

/// Nodes in a block.
const NODES: usize = 7;
const NONE: u32 = u32::MAX;

/// A node as stored in a queue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Entry {
    pub(crate) t: i64,
    pub(crate) slot: u32,
    pub(crate) x: u16,
    pub(crate) y: u16,
}

#[derive(Clone, Copy, Debug)]
#[repr(C, align(128))]
struct Block {
    entries: [Entry; NODES],
    /// The next older block of the queue; undefined for the first.
    before: u32,
    /// The next younger block of the queue, or the next free block.
    after: u32,
}

/// The chain of one queue. An empty queue has no blocks.
#[derive(Clone, Copy, Debug)]
struct Chain {
    first: u32,
    last: u32,
    nodes: u32,
    /// Index of the oldest node in the first block.
    start: u16,
    /// End of the nodes in the last block.
    end: u16,
}

const EMPTY: Chain = Chain { first: NONE, last: NONE, nodes: 0, start: 0, end: NODES as u16 };

/// Queues that share one store of blocks.
#[derive(Clone, Debug)]
pub(crate) struct Queues {
    chains: Vec<Chain>,
    /// The blocks that have been used: memory that the queues never needed at once is never touched.
    blocks: Room<Block>,
    most: usize,
    /// First free block; the number of blocks if none of them is free.
    free: u32,
}

/// A position in a queue: before node `at` of a block, or at the block's end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    block: u32,
    at: u32,
}

/// Last read position of a queue, for times that never decrease; initially none.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cursor(Option<Place>);

impl Queues {
    /// `queues` empty queues for at most `nodes` nodes in total.
    pub(crate) fn new(queues: usize, nodes: usize, memory: &mut Memory) -> Self {
        let most = Self::blocks(queues, nodes);
        Self { chains: memory.copies(EMPTY, queues), blocks: memory.room(most), most, free: 0 }
    }

    /// Largest number of blocks that `nodes` nodes need in `queues` queues. n nodes of one queue need at most 1 +
    /// ceil((n - 1) / `NODES`): the first and the second may each need a block, and then every `NODES`th one.
    fn blocks(queues: usize, nodes: usize) -> usize {
        let pairs = queues.saturating_mul(2);
        if nodes <= pairs { nodes } else { pairs + (nodes - pairs) / NODES }
    }

    #[inline]
    pub(crate) fn queue(&self, queue: usize) -> Queue<'_> {
        Queue { chain: &self.chains[queue], blocks: &self.blocks }
    }

    /// Appends a node.
    ///
    /// # Panics
    /// If the queues already hold as many nodes as they were made for, and no block has room.
    #[inline]
    pub(crate) fn push(&mut self, queue: usize, entry: Entry) {
        let chain = &mut self.chains[queue];
        if usize::from(chain.end) == NODES {
            let block = self.free;
            if block as usize == self.blocks.len() {
                assert!(self.blocks.len() < self.most, "queues hold as many nodes as they were made for");
                self.blocks.push(Block {
                    entries: [Entry::default(); NODES],
                    before: NONE,
                    after: block + 1,
                });
            }
            self.free = self.blocks[block as usize].after;
            if chain.nodes == 0 {
                (chain.first, chain.start) = (block, 0);
            } else {
                self.blocks[chain.last as usize].after = block;
                self.blocks[block as usize].before = chain.last;
            }
            (chain.last, chain.end) = (block, 0);
        }
        self.blocks[chain.last as usize].entries[usize::from(chain.end)] = entry;
        chain.end += 1;
        chain.nodes += 1;
    }

    /// Removes the oldest node of a queue.
    #[inline]
    pub(crate) fn pop(&mut self, queue: usize) -> Option<Entry> {
        let chain = &mut self.chains[queue];
        if chain.nodes == 0 {
            return None;
        }
        let block = &mut self.blocks[chain.first as usize];
        let entry = block.entries[usize::from(chain.start)];
        chain.start += 1;
        chain.nodes -= 1;
        if chain.nodes == 0 || usize::from(chain.start) == NODES {
            let (freed, after) = (chain.first, block.after);
            block.after = self.free;
            self.free = freed;
            if chain.nodes == 0 {
                *chain = EMPTY;
            } else {
                (chain.first, chain.start) = (after, 0);
            }
        }
        Some(entry)
    }

    /// Removes all nodes. O(queues).
    pub(crate) fn clear(&mut self) {
        for chain in self.chains.iter_mut().filter(|chain| chain.nodes > 0) {
            self.blocks[chain.last as usize].after = self.free;
            self.free = chain.first;
            *chain = EMPTY;
        }
    }
}

/// Read access to one queue.
#[derive(Clone, Copy)]
pub(crate) struct Queue<'a> {
    chain: &'a Chain,
    blocks: &'a [Block],
}

impl<'a> Queue<'a> {
    #[inline]
    pub(crate) fn len(self) -> usize {
        self.chain.nodes as usize
    }

    /// The part of a block that belongs to the queue, and its start in the block.
    #[inline]
    fn part(self, block: u32) -> (usize, &'a [Entry]) {
        let start = if block == self.chain.first { usize::from(self.chain.start) } else { 0 };
        let end = if block == self.chain.last { usize::from(self.chain.end) } else { NODES };
        (start, &self.blocks[block as usize].entries[start..end])
    }

    /// All nodes from the oldest to the newest.
    pub(crate) fn iter(self) -> impl Iterator<Item = &'a Entry> {
        let mut block = self.chain.first;
        let blocks = std::iter::from_fn(move || {
            let this = (block != NONE).then(|| self.part(block).1)?;
            block = if block == self.chain.last { NONE } else { self.blocks[block as usize].after };
            Some(this)
        });
        blocks.flatten()
    }

    /// Calls `visit` with each node from the oldest to the newest.
    #[inline]
    pub(crate) fn for_each(self, mut visit: impl FnMut(&Entry)) {
        if self.chain.nodes > 0 {
            self.visit_from(Place { block: self.chain.first, at: self.chain.start.into() }, |entry| {
                visit(entry);
                true
            });
        }
    }

    /// Start of the nodes later than `t`, in a queue ordered by time. O(1) if there is none; otherwise one step per
    /// block from the nearer end in time.
    #[inline]
    pub(crate) fn later_than(self, t: i64) -> Place {
        let last = &self.blocks[self.chain.last as usize].entries;
        let newest = last[usize::from(self.chain.end) - 1].t;
        if newest <= t { self.end() } else { self.walk_to(t, newest) }
    }

    #[inline]
    fn end(self) -> Place {
        Place { block: self.chain.last, at: self.chain.end.into() }
    }

    /// [`Self::later_than`] if the newest node, of time `newest`, is later than `t`.
    fn walk_to(self, t: i64, newest: i64) -> Place {
        let oldest = self.blocks[self.chain.first as usize].entries[usize::from(self.chain.start)].t;
        let mut block;
        if newest - t < t.saturating_sub(oldest) {
            block = self.chain.last;
            while block != self.chain.first && self.blocks[block as usize].entries[0].t > t {
                block = self.blocks[block as usize].before;
            }
        } else {
            block = self.chain.first;
            while block != self.chain.last && self.blocks[block as usize].entries[NODES - 1].t <= t {
                block = self.blocks[block as usize].after;
            }
        }
        let (start, part) = self.part(block);
        Place { block, at: (start + part.iter().take_while(|e| e.t <= t).count()) as u32 }
    }

    /// [`Self::later_than`] for times that never decrease, in an unchanging queue.
    #[inline]
    pub(crate) fn later_than_onwards(self, t: i64, cursor: &mut Cursor) -> Place {
        let Place { mut block, mut at } =
            cursor.0.unwrap_or(Place { block: self.chain.first, at: self.chain.start.into() });
        loop {
            let (start, part) = self.part(block);
            let end = (start + part.len()) as u32;
            while at < end && self.blocks[block as usize].entries[at as usize].t <= t {
                at += 1;
            }
            if at < end || block == self.chain.last {
                return *cursor.0.insert(Place { block, at });
            }
            (block, at) = (self.blocks[block as usize].after, 0);
        }
    }

    /// Calls `visit` with the nodes from `place` on, older to newer, while it returns true.
    #[inline]
    pub(crate) fn visit_from(self, Place { mut block, at }: Place, mut visit: impl FnMut(&Entry) -> bool) {
        let mut at = at as usize;
        loop {
            let end = if block == self.chain.last { usize::from(self.chain.end) } else { NODES };
            let Block { entries, after, .. } = &self.blocks[block as usize];
            for entry in &entries[at..end] {
                if !visit(entry) {
                    return;
                }
            }
            if block == self.chain.last {
                return;
            }
            (block, at) = (*after, 0);
        }
    }

    /// Calls `visit` with the nodes before `place`, newer to older, while it returns true.
    #[inline]
    pub(crate) fn visit_back_from(
        self,
        Place { mut block, at }: Place,
        mut visit: impl FnMut(&Entry) -> bool,
    ) {
        let mut at = at as usize;
        loop {
            let start = if block == self.chain.first { usize::from(self.chain.start) } else { 0 };
            let Block { entries, before, .. } = &self.blocks[block as usize];
            for entry in entries[start..at].iter().rev() {
                if !visit(entry) {
                    return;
                }
            }
            if block == self.chain.first {
                return;
            }
            (block, at) = (*before, NODES);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::VecDeque;

    fn all(queue: Queue<'_>) -> Vec<Entry> {
        let mut found = Vec::new();
        queue.for_each(|entry| found.push(*entry));
        found
    }

    /// Nodes before `place` and from it on, each in order of time.
    fn parts(queue: Queue<'_>, place: Place) -> [Vec<Entry>; 2] {
        let [mut before, mut after] = [Vec::new(), Vec::new()];
        queue.visit_back_from(place, |entry| {
            before.push(*entry);
            true
        });
        queue.visit_from(place, |entry| {
            after.push(*entry);
            true
        });
        before.reverse();
        [before, after]
    }

    proptest! {
        #[test]
        fn queues_in_blocks_are_plain_queues(
            queues in 1usize..5,
            capacity in 1usize..60,
            steps in proptest::collection::vec((0u8..40, 0usize..5, 0i64..4), 0..300),
        ) {
            let mut blocks = Queues::new(queues, capacity, &mut Memory::default());
            let mut plain = vec![VecDeque::new(); queues];
            let (mut t, mut nodes) = (0, 0);
            for (step, queue, later) in steps {
                let queue = queue % queues;
                t += later;
                if step == 0 {
                    blocks.clear();
                    plain.iter_mut().for_each(VecDeque::clear);
                    nodes = 0;
                } else if step < 24 && nodes < capacity {
                    let entry = Entry { t, slot: step.into(), x: queue as u16, y: 0 };
                    blocks.push(queue, entry);
                    plain[queue].push_back(entry);
                    nodes += 1;
                } else {
                    let popped = plain[queue].pop_front();
                    prop_assert_eq!(blocks.pop(queue), popped);
                    nodes -= usize::from(popped.is_some());
                }
                for (queue, plain) in plain.iter().enumerate() {
                    prop_assert_eq!(blocks.queue(queue).len(), plain.len());
                    prop_assert_eq!(plain, &all(blocks.queue(queue)));
                    prop_assert_eq!(plain, &blocks.queue(queue).iter().copied().collect::<Vec<_>>());
                }
            }
            for (queue, plain) in plain.iter().enumerate().filter(|(_, plain)| !plain.is_empty()) {
                let (queue, mut cursor) = (blocks.queue(queue), Cursor::default());
                for t in 0..=t + 1 {
                    let at = plain.partition_point(|e| e.t <= t);
                    let expected = [0..at, at..plain.len()].map(|r| plain.range(r).copied().collect::<Vec<_>>());
                    prop_assert_eq!(&parts(queue, queue.later_than(t)), &expected);
                    prop_assert_eq!(&parts(queue, queue.later_than_onwards(t, &mut cursor)), &expected);
                }
            }
        }

        #[test]
        fn as_many_nodes_as_were_declared_fit_however_they_are_spread(
            queues in 1usize..9,
            capacity in 1usize..200,
            spread in proptest::collection::vec((0usize..9, 0usize..9), 500),
        ) {
            let mut blocks = Queues::new(queues, capacity, &mut Memory::default());
            let mut order = VecDeque::new();
            for (low, high) in spread {
                if order.len() == capacity {
                    blocks.pop(order.pop_front().expect("a node"));
                }
                let queue = low.min(high) % queues;
                blocks.push(queue, Entry::default());
                order.push_back(queue);
            }
        }
    }
}
