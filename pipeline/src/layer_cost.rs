//! Multiply-adds of what a frame network computed.

use meissner_engine::frames::{FrameLayerCounters, FrameShape};
use meissner_models::{FrameKind, FrameLayer};

/// What a layer's pixels cost; a layer over vectors has one.
#[derive(Clone, Debug)]
pub struct LayerCost {
    /// Name of the layer.
    pub name: String,
    /// Pixels of its output.
    pub pixels: u64,
    /// Of all its pixels.
    multiply_adds: u64,
    /// Of one pixel that is absorbed: where the frame has nothing, a convolutional LSTM still reads its hidden state.
    absorbed: u64,
}

impl LayerCost {
    /// The cost of `layer`.
    pub fn new(layer: &FrameLayer) -> Self {
        let pixels = match layer.output {
            FrameShape::Image { height, width, .. } => (height * width) as u64,
            FrameShape::Vector(_) => 1,
        };
        let absorbed = match layer.kind {
            // Four gates of 3 x 3.
            FrameKind::ConvLstm { hidden, .. } => (36 * hidden * hidden) as u64,
            _ => 0,
        };
        let (name, multiply_adds) = (layer.name.clone(), layer.multiply_adds as u64);
        Self { name, pixels, multiply_adds, absorbed }
    }

    /// Multiply-adds of the pixels that `counters` counted.
    pub fn of(&self, counters: &FrameLayerCounters) -> u64 {
        // In u128: a recording's pixels times a layer's products can exceed a u64.
        let computed =
            u128::from(counters.computed) * u128::from(self.multiply_adds) / u128::from(self.pixels);
        u64::try_from(computed).unwrap_or(u64::MAX).saturating_add(counters.absorbed * self.absorbed)
    }
}
