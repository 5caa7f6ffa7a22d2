//! What a frame network computed, and what it did not need to.

/// Pixels of one layer, since the engine was made; a layer over vectors has one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameLayerCounters {
    /// Computed.
    pub computed: u64,
    /// Left as they were, because nothing that they read had changed.
    pub skipped: u64,
    /// Taken from what the layer gives without events, because nothing else reached them.
    pub absorbed: u64,
}

/// Counts since a frame engine was made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FrameCounters {
    /// Frames pushed.
    pub frames: u64,
    /// Predictions read.
    pub predictions: u64,
    /// Each layer's pixels.
    pub layers: Vec<FrameLayerCounters>,
}

impl FrameCounters {
    /// What was counted after `earlier`, which the same engine told.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        let layer = |(now, earlier): (&FrameLayerCounters, &FrameLayerCounters)| FrameLayerCounters {
            computed: now.computed.saturating_sub(earlier.computed),
            skipped: now.skipped.saturating_sub(earlier.skipped),
            absorbed: now.absorbed.saturating_sub(earlier.absorbed),
        };
        Self {
            frames: self.frames.saturating_sub(earlier.frames),
            predictions: self.predictions.saturating_sub(earlier.predictions),
            layers: self.layers.iter().zip(&earlier.layers).map(layer).collect(),
        }
    }
}
