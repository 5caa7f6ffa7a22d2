//! What one step changed in a graph: the message that goes downstream, from level to level.

/// Changes of one level's graph by one insertion or one expiry. Downstream applies them in the order of the fields.
#[derive(Clone, Debug, Default)]
pub(crate) struct Delta {
    /// Rows that are new.
    pub(crate) entered: Vec<u32>,
    /// Edges (source, reader) that are gone.
    pub(crate) removed: Vec<(u32, u32)>,
    /// Edges (source, reader) that are new.
    pub(crate) added: Vec<(u32, u32)>,
    /// Rows that are gone; their slots still tell where they were.
    pub(crate) left: Vec<u32>,
    /// Rows whose neighbourhood changed, the entered ones among them. A row may stand here twice.
    pub(crate) rewired: Vec<u32>,
}

impl Delta {
    pub(crate) fn clear(&mut self) {
        self.entered.clear();
        self.removed.clear();
        self.added.clear();
        self.left.clear();
        self.rewired.clear();
    }
}
