//! Queues of nodes, one per grid cell, in blocks from one store.
//!
//! Nodes enter a queue at its end and leave at its start. A queue is a chain of blocks of two cache
//! lines, of which only the first and last can be partly filled. The store has all blocks that a
//! bounded number of nodes can need, however the nodes are spread: nothing is allocated later.

use std::ops::Range;

use meissner_kernels::prefetch;

use crate::memory::{FixedVec, Memory};

pub(crate) const NODES: usize = 8;
const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Entry {
    pub(crate) t: i64,
    pub(crate) slot: u32,
    pub(crate) x: u16,
    pub(crate) y: u16,
}

/// Nodes in two cache lines, one array per field: a search computes a block's distances at once.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(128))]
pub(crate) struct Block {
    pub(crate) times: [i64; NODES],
    pub(crate) slots: [u32; NODES],
    pub(crate) x: [u16; NODES],
    pub(crate) y: [u16; NODES],
}

impl Block {
    #[inline]
    pub(crate) fn entry(&self, at: usize) -> Entry {
        Entry { t: self.times[at], slot: self.slots[at], x: self.x[at], y: self.y[at] }
    }

    #[inline]
    fn set(&mut self, at: usize, Entry { t, slot, x, y }: Entry) {
        (self.times[at], self.slots[at], self.x[at], self.y[at]) = (t, slot, x, y);
    }
}

/// The neighbours of a block in its queue.
#[derive(Clone, Copy, Debug)]
struct Links {
    /// The next older block; undefined for the first.
    before: u32,
    /// The next younger block, or the next free block.
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

#[derive(Clone, Debug)]
pub(crate) struct Queues {
    chains: Vec<Chain>,
    /// The blocks used so far: memory that is not needed is never touched.
    blocks: FixedVec<Block>,
    links: FixedVec<Links>,
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
        Self {
            chains: memory.copies(EMPTY, queues),
            blocks: memory.room(most),
            links: memory.room(most),
            most,
            free: 0,
        }
    }

    /// Maximum number of blocks of `nodes` nodes in `queues` queues. n nodes of one queue need at
    /// most 1 + ceil((n - 1) / `NODES`) blocks: one each for the first two nodes, then one per
    /// `NODES` nodes.
    fn blocks(queues: usize, nodes: usize) -> usize {
        let pairs = queues.saturating_mul(2);
        if nodes <= pairs { nodes } else { pairs + (nodes - pairs) / NODES }
    }

    #[inline]
    pub(crate) fn queue(&self, queue: usize) -> Queue<'_> {
        Queue { chain: &self.chains[queue], blocks: &self.blocks, links: &self.links }
    }

    /// Appends a node. Panics if the queues already hold as many nodes as they were made for, and
    /// no block has room.
    #[inline]
    pub(crate) fn push(&mut self, queue: usize, entry: Entry) {
        let chain = &mut self.chains[queue];
        if usize::from(chain.end) == NODES {
            let block = self.free;
            if block as usize == self.blocks.len() {
                assert!(self.blocks.len() < self.most, "queues hold as many nodes as they were made for");
                self.blocks.push(Block::default());
                self.links.push(Links { before: NONE, after: block + 1 });
            }
            self.free = self.links[block as usize].after;
            if chain.nodes == 0 {
                (chain.first, chain.start) = (block, 0);
            } else {
                self.links[chain.last as usize].after = block;
                self.links[block as usize].before = chain.last;
            }
            (chain.last, chain.end) = (block, 0);
        }
        self.blocks[chain.last as usize].set(chain.end.into(), entry);
        chain.end += 1;
        chain.nodes += 1;
    }

    #[inline]
    pub(crate) fn pop(&mut self, queue: usize) -> Option<Entry> {
        let chain = &mut self.chains[queue];
        if chain.nodes == 0 {
            return None;
        }
        let entry = self.blocks[chain.first as usize].entry(chain.start.into());
        chain.start += 1;
        chain.nodes -= 1;
        if chain.nodes == 0 || usize::from(chain.start) == NODES {
            let freed = chain.first;
            let after = std::mem::replace(&mut self.links[freed as usize].after, self.free);
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
            self.links[chain.last as usize].after = self.free;
            self.free = chain.first;
            *chain = EMPTY;
        }
    }
}

#[derive(Clone, Copy)]
pub(crate) struct Queue<'a> {
    chain: &'a Chain,
    blocks: &'a [Block],
    links: &'a [Links],
}
impl<'a> Queue<'a> {
    #[inline(always)]
    pub(crate) fn len(self) -> usize {
        self.chain.nodes as usize
    }

    /// Asks for the block of `place`, if the queue has blocks.
    #[inline(always)]
    pub(crate) fn prefetch(self, place: Place) {
        prefetch(self.blocks.get(place.block as usize).map_or(&[], std::slice::from_ref));
    }

    #[inline(always)]
    pub(crate) fn block(self, place: Place) -> &'a Block {
        &self.blocks[place.block as usize]
    }

    /// The nodes before `place` in its block.
    #[inline(always)]
    pub(crate) fn nodes_before(self, place: Place) -> Range<usize> {
        let start = if place.block == self.chain.first { self.chain.start.into() } else { 0 };
        start..place.at as usize
    }

    /// Slot of the last node before `place` in its block, which has one.
    #[inline(always)]
    pub(crate) fn latest_before(self, place: Place) -> u32 {
        self.block(place).slots[place.at as usize - 1]
    }

    /// The nodes from `place` on in its block.
    #[inline(always)]
    pub(crate) fn nodes_from(self, place: Place) -> Range<usize> {
        let end = if place.block == self.chain.last { self.chain.end.into() } else { NODES };
        place.at as usize..end
    }

    /// The end of the block before that of `place`, if there is one.
    #[inline(always)]
    pub(crate) fn previous(self, place: Place) -> Option<Place> {
        (place.block != self.chain.first)
            .then(|| Place { block: self.links[place.block as usize].before, at: NODES as u32 })
    }

    /// The start of the block after that of `place`, if there is one.
    #[inline(always)]
    pub(crate) fn next(self, place: Place) -> Option<Place> {
        (place.block != self.chain.last)
            .then(|| Place { block: self.links[place.block as usize].after, at: 0 })
    }

    #[inline(always)]
    pub(crate) fn start(self) -> Place {
        Place { block: self.chain.first, at: self.chain.start.into() }
    }

    #[inline(always)]
    pub(crate) fn end(self) -> Place {
        Place { block: self.chain.last, at: self.chain.end.into() }
    }

    pub(crate) fn iter(self) -> impl Iterator<Item = Entry> + 'a {
        let first = (self.len() > 0).then(|| self.start());
        let places = std::iter::successors(first, move |&place| self.next(place));
        places.flat_map(move |place| self.nodes_from(place).map(move |at| self.block(place).entry(at)))
    }

    /// Start of the nodes later than `t`, in a queue ordered by time. O(1) if there are none;
    /// otherwise one step per block from the nearer end.
    #[inline(always)]
    pub(crate) fn later_than(self, t: i64) -> Place {
        let end = self.end();
        let newest = self.block(end).times[end.at as usize - 1];
        if newest <= t { end } else { self.walk_to(t, newest) }
    }

    /// [`Self::later_than`] if the newest node, of time `newest`, is later than `t`.
    fn walk_to(self, t: i64, newest: i64) -> Place {
        let mut place = self.start();
        let oldest = self.block(place).times[place.at as usize];
        if newest - t < t.saturating_sub(oldest) {
            place = self.end();
            while let Some(previous) = self.previous(place).filter(|_| self.block(place).times[0] > t) {
                place = previous;
            }
        } else {
            while let Some(next) = self.next(place).filter(|_| self.block(place).times[NODES - 1] <= t) {
                place = next;
            }
        }
        let all = self.nodes_before(Place { at: NODES as u32, ..place }).start
            ..self.nodes_from(Place { at: 0, ..place }).end;
        let later = self.block(place).times[all.clone()].iter().take_while(|&&time| time <= t).count();
        Place { at: (all.start + later) as u32, ..place }
    }

    /// [`Self::later_than`] for times that never decrease, in an unchanging queue.
    #[inline]
    pub(crate) fn later_than_onwards(self, t: i64, cursor: &mut Cursor) -> Place {
        let mut place = cursor.0.unwrap_or(self.start());
        loop {
            let Range { start, end } = self.nodes_from(place);
            let later = self.block(place).times[start..end].iter().take_while(|&&time| time <= t).count();
            place.at = (start + later) as u32;
            match self.next(place).filter(|_| start + later == end) {
                Some(next) => place = next,
                None => return *cursor.0.insert(place),
            }
        }
    }
}
