//! The graph of a window alone: what training needs of a batch, so that training and inference see the same one.

use super::{Batch, LevelTrace, Stream, events, pool};
use crate::EngineError;
use crate::network::Pooling;

/// What layers of a network read from on one window. It depends on the network's graph, poolings and readout, not on its
/// weights.
#[derive(Clone, Debug)]
pub struct Graph {
    /// The event level, then one per pooling. The only feature of each is what would enter its first block if nothing
    /// were computed below: the polarity, and its maxima.
    pub levels: Vec<LevelTrace>,
    /// The readout's cell of each row of the last level that is in the window, row by row of its grid.
    pub readout: Vec<usize>,
}

impl Batch {
    /// Neighbourhoods, cells and positions on `stream`, without computing a layer. Cost: the search, and O(edges).
    ///
    /// # Errors
    /// [`EngineError::Stream`] as [`Self::forward`].
    pub fn graph(&self, stream: Stream<'_>) -> Result<Graph, EngineError> {
        stream.check(self.sensor)?;
        let mut levels = vec![events::level(self, stream)];
        let mut below_pooling = None;
        for (pooling, level) in &self.network.parts().pooled {
            let of_input = Pooling { from: 0, ..pooling.clone() };
            let below = &levels[levels.len() - 1];
            levels.push(pool::level(self, (&of_input, level), below, below_pooling, stream));
            below_pooling = Some(pooling);
        }
        let readout = self.readout_cells(&levels[levels.len() - 1], levels.len() == 1, stream);
        Ok(Graph { levels, readout })
    }
}
