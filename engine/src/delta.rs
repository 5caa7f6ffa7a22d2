//! Changes of a graph in one step, passed downstream from level to level.

use crate::room::Room;

/// Changes of one level's graph by one insertion or some expiries. Downstream inserts rows first and removes rows last.
#[derive(Clone, Debug)]
pub(crate) struct Delta {
    /// New rows.
    pub(crate) entered: Room<u32>,
    /// Removed edges (source, reader).
    pub(crate) removed: Room<(u32, u32)>,
    /// New edges (source, reader).
    pub(crate) added: Room<(u32, u32)>,
    /// Removed rows; their slots still hold their positions.
    pub(crate) left: Room<u32>,
    /// Rows whose neighbourhood changed, including the entered rows. A row may occur twice.
    pub(crate) rewired: Room<u32>,
}

/// Number of removed edges at which the changes of a joint expiry are passed on in part.
pub(crate) const PART: usize = 256;

impl Delta {
    /// No changes, for a window of `capacity` events with at most `most` neighbours each; edges are recorded if
    /// `edges`. An event that comes or goes changes its own edges, and at most one in and one out of any other event.
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

    /// Bytes that [`Self::new`] allocates.
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
