//! The sliding window: a ring of nodes in order of arrival.

use crate::metric::Node;

/// Nodes by slot. A node keeps its slot while it is in the window; slots are used round and round.
#[derive(Clone, Debug)]
pub(crate) struct Window {
    nodes: Vec<Node>,
    /// Arrivals before the oldest node.
    first: u64,
    /// Arrivals so far.
    next: u64,
}

impl Window {
    pub(crate) fn new(capacity: usize) -> Self {
        Self { nodes: vec![Node::default(); capacity], first: 0, next: 0 }
    }

    pub(crate) fn len(&self) -> usize {
        (self.next - self.first) as usize
    }

    pub(crate) fn is_full(&self) -> bool {
        self.len() == self.nodes.len()
    }

    /// Appends `node`, the newest; its slot.
    pub(crate) fn push(&mut self, node: Node) -> u32 {
        debug_assert!(!self.is_full(), "the window must have room");
        let slot = self.slot(self.next);
        self.nodes[slot as usize] = node;
        self.next += 1;
        slot
    }

    /// Slot and node of the oldest.
    pub(crate) fn oldest(&self) -> Option<(u32, Node)> {
        (self.first < self.next).then(|| {
            let slot = self.slot(self.first);
            (slot, self.node(slot))
        })
    }

    /// Forgets the oldest node.
    pub(crate) fn pop(&mut self) {
        debug_assert!(self.first < self.next, "the window must not be empty");
        self.first += 1;
    }

    pub(crate) fn clear(&mut self) {
        self.first = 0;
        self.next = 0;
    }

    #[inline]
    pub(crate) fn node(&self, slot: u32) -> Node {
        self.nodes[slot as usize]
    }

    /// Place of the node at `slot` in the window, 0 for the oldest. Larger is later.
    #[inline]
    pub(crate) fn age_rank(&self, slot: u32) -> u32 {
        let first = self.slot(self.first);
        if slot >= first { slot - first } else { slot + self.nodes.len() as u32 - first }
    }

    /// Slots from the oldest node to the newest.
    pub(crate) fn slots(&self) -> impl DoubleEndedIterator<Item = u32> + '_ {
        (self.first..self.next).map(|arrival| self.slot(arrival))
    }

    fn slot(&self, arrival: u64) -> u32 {
        (arrival % self.nodes.len() as u64) as u32
    }

    pub(crate) fn bytes(capacity: usize) -> usize {
        capacity * size_of::<Node>()
    }
}
