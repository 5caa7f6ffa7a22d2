//! Counts of computed and avoided work of a frame network.

/// Pixels of one layer since the engine was made; a layer over vectors counts as one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameLayerCounters {
    /// Computed.
    pub computed: u64,
    /// Kept, because nothing in their receptive field had changed.
    pub skipped: u64,
    /// Taken from the layer's output for a frame of zeros, because only zeros reached them.
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
    /// Counts since `earlier`, an earlier state of the same engine's counters.
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
