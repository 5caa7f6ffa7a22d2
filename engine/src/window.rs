//! The sliding window: a ring of nodes in order of arrival.

use std::ops::Range;

use crate::memory::Memory;
use crate::metric::Node;

/// Nodes by slot. A node keeps its slot while it is in the window; slots are reused cyclically.
#[derive(Clone, Debug)]
pub(crate) struct Window {
    nodes: Vec<Node>,
    /// Slot of the oldest node.
    first: u32,
    len: u32,
}

impl Window {
    pub(crate) fn new(capacity: usize, memory: &mut Memory) -> Self {
        Self { nodes: memory.copies(Node::default(), capacity), first: 0, len: 0 }
    }

    pub(crate) fn len(&self) -> usize {
        self.len as usize
    }

    pub(crate) fn is_full(&self) -> bool {
        self.len() == self.nodes.len()
    }

    /// Appends `node`, the newest; returns its slot.
    ///
    /// # Panics
    /// If the window is full.
    pub(crate) fn push(&mut self, node: Node) -> u32 {
        assert!(!self.is_full(), "the window must have room");
        let slot = self.wrap(self.first + self.len);
        self.nodes[slot as usize] = node;
        self.len += 1;
        slot
    }

    /// Number of nodes earlier than `t`; they are the first ones.
    pub(crate) fn earlier_than(&self, t: i64) -> u32 {
        self.slots().take_while(|&slot| self.node(slot).t < t).count() as u32
    }

    /// Removes the oldest `count` nodes.
    ///
    /// # Panics
    /// If there are fewer.
    pub(crate) fn pop(&mut self, count: u32) {
        assert!(count <= self.len, "the window must hold that many");
        self.first = self.wrap(self.first + count);
        self.len -= count;
    }

    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    #[inline]
    pub(crate) fn node(&self, slot: u32) -> Node {
        self.nodes[slot as usize]
    }

    /// Index of the node at `slot` in the window; 0 is the oldest.
    #[inline]
    pub(crate) fn age_rank(&self, slot: u32) -> u32 {
        if slot >= self.first { slot - self.first } else { slot + self.nodes.len() as u32 - self.first }
    }

    /// Slots from the oldest node to the newest.
    pub(crate) fn slots(&self) -> impl Iterator<Item = u32> + '_ {
        self.slots_of(0..self.len)
    }

    /// Slot of the node at an index in the window.
    pub(crate) fn slot_of(&self, place: u32) -> u32 {
        self.wrap(self.first + place)
    }

    /// Slots of the nodes at a range of indices in the window.
    pub(crate) fn slots_of(&self, places: Range<u32>) -> impl Iterator<Item = u32> + '_ {
        let capacity = self.nodes.len() as u32;
        let (start, end) = (self.first + places.start, self.first + places.end);
        (start.min(capacity)..end.min(capacity))
            .chain(start.max(capacity) - capacity..end.max(capacity) - capacity)
    }

    /// Wraps `slot`, less than twice the capacity, into the ring.
    fn wrap(&self, slot: u32) -> u32 {
        let capacity = self.nodes.len() as u32;
        if slot >= capacity { slot - capacity } else { slot }
    }
}
