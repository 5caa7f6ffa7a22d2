//! What one step changed in a graph: the message that goes downstream, from level to level.

use crate::room::Room;

/// Changes of one level's graph by one insertion, or by some of what expires. Downstream lets rows enter first and leave last.
#[derive(Clone, Debug)]
pub(crate) struct Delta {
    /// Rows that are new.
    pub(crate) entered: Room<u32>,
    /// Edges (source, reader) that are gone.
    pub(crate) removed: Room<(u32, u32)>,
    /// Edges (source, reader) that are new.
    pub(crate) added: Room<(u32, u32)>,
    /// Rows that are gone; their slots still tell where they were.
    pub(crate) left: Room<u32>,
    /// Rows whose neighbourhood changed, the entered ones among them. A row may stand here twice.
    pub(crate) rewired: Room<u32>,
}

/// Edges that are gone from which on those that expire together are handed on in parts.
pub(crate) const PART: usize = 256;

impl Delta {
    /// No changes of a window of `capacity` events of at most `most` neighbours each, of whose edges something is told if
    /// `edges`. An event that comes or goes changes its own edges, and at most one out and one in of every other event.
    pub(crate) fn new(capacity: usize, most: usize, edges: bool) -> Self {
        let pairs = Self::pairs(capacity, most, edges);
        Self {
            entered: Room::new(1),
            removed: Room::new(pairs),
            added: Room::new(pairs),
            left: Room::new(capacity),
            rewired: Room::new(Self::rewired(capacity)),
        }
    }

    fn pairs(capacity: usize, most: usize, edges: bool) -> usize {
        if edges { PART + capacity + most } else { 0 }
    }

    fn rewired(capacity: usize) -> usize {
        PART + capacity
    }

    /// Bytes that [`Self::new`] takes.
    pub(crate) fn bytes(capacity: usize, most: usize, edges: bool) -> usize {
        2 * Room::<(u32, u32)>::bytes(Self::pairs(capacity, most, edges))
            + Room::<u32>::bytes(1 + capacity + Self::rewired(capacity))
    }

    pub(crate) fn clear(&mut self) {
        self.entered.clear();
        self.removed.clear();
        self.added.clear();
        self.left.clear();
        self.rewired.clear();
    }
}
