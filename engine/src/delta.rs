//! Changes of a graph in one step, passed downstream from level to level.

use crate::memory::{FixedVec, Memory};

/// Changes of a level's graph by an insertion or expiries: insert rows first, remove them last.
#[derive(Clone, Debug)]
pub(crate) struct Delta {
    /// New rows.
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

/// Number of removed edges at which the changes of a joint expiry are passed on in part.
pub(crate) const PART: usize = 256;

impl Delta {
    /// No changes yet, for `capacity` events with at most `most` neighbours; edges are recorded if
    /// `edges`. An event changes its own edges, and at most one in and one out of any other.
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
