//! The sliding window: nodes in order of arrival.

use std::ops::Range;

use crate::memory::{FixedVec, Memory};
use crate::metric::Node;

pub(crate) const CHUNK: u32 = 1 << CHUNK_LOG2;
const CHUNK_LOG2: u32 = 6;

/// Nodes by slot, which a node keeps while in the window. Successive nodes have successive slots
/// within a chunk, so recent nodes' data lie together. The chunk freed last is used first: a window
/// that never fills does not touch the rest of its memory.
#[derive(Clone, Debug)]
pub(crate) struct Window {
    capacity: u32,
    /// Nodes of the chunks that have been used.
    nodes: FixedVec<Node>,
    /// Number of each chunk's first node, counted from the first of all. Numbers wrap.
    starts: FixedVec<u32>,
    free: FixedVec<u32>,
    /// The chunk of number n is at n / [`CHUNK`], modulo the length, which is a power of two.
    chunks: Vec<u32>,
    /// The number of the oldest node, or of the next one if there is none.
    pub(crate) first: u32,
    len: u32,
}

impl Window {
    pub(crate) fn new(capacity: usize, memory: &mut Memory) -> Self {
        let slots = Self::slots_for(capacity);
        let chunks = slots / CHUNK as usize;
        Self {
            capacity: capacity as u32,
            nodes: memory.room(slots),
            starts: memory.room(chunks),
            free: memory.room(chunks),
            chunks: memory.copies(0, chunks.next_power_of_two()),
            first: 0,
            len: 0,
        }
    }

    /// Slots of a window for `capacity` nodes: its first and last chunk can be partly filled.
    pub(crate) fn slots_for(capacity: usize) -> usize {
        let chunk = CHUNK as usize;
        ((capacity + chunk - 2) / chunk + 1) * chunk
    }

    /// Number of slots that have ever been used; they are the first ones.
    #[inline]
    pub(crate) fn slots_used(&self) -> usize {
        self.nodes.len()
    }

    pub(crate) fn len(&self) -> usize {
        self.len as usize
    }

    pub(crate) fn is_full(&self) -> bool {
        self.len == self.capacity
    }

    /// Appends `node`, the newest; returns its slot. Panics if the window is full.
    pub(crate) fn push(&mut self, node: Node) -> u32 {
        assert!(!self.is_full(), "the window must have room");
        let number = self.first.wrapping_add(self.len);
        if number.is_multiple_of(CHUNK) {
            self.begin_chunk(number);
        }
        self.len += 1;
        let slot = self.slot_of(self.len - 1);
        self.nodes[slot as usize] = node;
        slot
    }

    fn begin_chunk(&mut self, number: u32) {
        let chunk = self.free.pop().unwrap_or_else(|| {
            let slots = self.nodes.len() + CHUNK as usize;
            self.nodes.resize(slots, Node::default());
            self.starts.push(0);
            self.starts.len() as u32 - 1
        });
        self.starts[chunk as usize] = number;
        let place = self.place_of(number);
        self.chunks[place] = chunk;
    }

    /// Number of nodes earlier than `t`; they are the first ones.
    pub(crate) fn earlier_than(&self, t: i64) -> u32 {
        self.slots().take_while(|&slot| self.node(slot).t < t).count() as u32
    }

    /// Removes the oldest `count` nodes. Panics if there are fewer.
    pub(crate) fn pop(&mut self, count: u32) {
        assert!(count <= self.len, "the window must hold that many");
        // Chunks that end before the next node.
        for chunk in 0..(self.first % CHUNK + count) >> CHUNK_LOG2 {
            let number = self.first.wrapping_add(chunk << CHUNK_LOG2);
            let place = self.place_of(number);
            self.free.push(self.chunks[place]);
        }
        self.first = self.first.wrapping_add(count);
        self.len -= count;
    }

    pub(crate) fn clear(&mut self) {
        self.pop(self.len);
    }

    #[inline]
    pub(crate) fn node(&self, slot: u32) -> Node {
        self.nodes[slot as usize]
    }

    /// Index of the node at `slot` in the window; 0 is the oldest. For a free or reused slot:
    /// larger than that of any node that was in the window with its last one.
    #[inline]
    pub(crate) fn age_rank(&self, slot: u32) -> u32 {
        (self.starts[(slot >> CHUNK_LOG2) as usize] + slot % CHUNK).wrapping_sub(self.first)
    }

    pub(crate) fn slots(&self) -> impl Iterator<Item = u32> + '_ {
        self.slots_of(0..self.len)
    }

    #[inline]
    pub(crate) fn slot_of(&self, index: u32) -> u32 {
        let number = self.first.wrapping_add(index);
        self.chunks[self.place_of(number)] * CHUNK + number % CHUNK
    }

    pub(crate) fn slots_of(&self, indices: Range<u32>) -> impl Iterator<Item = u32> + '_ {
        indices.map(|index| self.slot_of(index))
    }

    fn place_of(&self, number: u32) -> usize {
        (number >> CHUNK_LOG2) as usize & (self.chunks.len() - 1)
    }
}
