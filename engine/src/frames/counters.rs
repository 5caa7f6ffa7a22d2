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
