//! A frame engine with a clock around each call, and the cost of its layers in multiply-adds.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::EngineError;
use meissner_engine::frames::{
    FrameCounters, FrameEngine, FrameLayerCounters, FrameNetwork, FrameOptions, FrameShape,
};
use meissner_models::{FrameKind, FrameLayer};

use crate::latency::Latency;

/// A frame engine that records how long its calls took.
pub struct FramePredictor {
    engine: FrameEngine,
    options: FrameOptions,
    /// Counts before this run.
    before: FrameCounters,
    /// Time to make frames, for each event, reading or picture.
    pub prepare: Latency,
    /// Pushes of frames.
    pub push: Latency,
    /// Predictions.
    pub predict: Latency,
    /// Time from a reading to the decision after it, for readings that complete a window.
    pub decision: Latency,
    /// Time spent since the last prediction.
    update: Duration,
}

/// A prediction.
#[derive(Clone, Copy, Debug)]
pub struct FramePrediction<'a> {
    /// The network's values.
    pub values: &'a [f32],
    /// Frames that the state has seen.
    pub frames: u64,
}

impl FramePredictor {
    /// An engine of `network` before its first frame.
    ///
    /// # Errors
    /// As [`FrameEngine::new`].
    pub fn new(network: Arc<FrameNetwork>, options: FrameOptions) -> Result<Self, EngineError> {
        let engine = FrameEngine::with_options(network, options)?;
        Ok(Self {
            before: engine.counters().clone(),
            engine,
            options,
            prepare: Latency::new(),
            push: Latency::new(),
            predict: Latency::new(),
            decision: Latency::new(),
            update: Duration::ZERO,
        })
    }

    /// Continues from the state in `bytes`.
    ///
    /// # Errors
    /// As [`FrameEngine::restore_bytes`].
    pub fn resume(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        self.engine.restore_bytes(bytes)?;
        self.before = self.engine.counters().clone();
        Ok(())
    }

    /// The state, with a note.
    pub fn to_bytes_with(&self, note: &[u8]) -> Vec<u8> {
        self.engine.to_bytes_with(note)
    }

    /// The options of the engine.
    pub fn options(&self) -> FrameOptions {
        self.options
    }

    /// Adds time spent in making a frame. [`Self::prepare`] records complete frames.
    pub fn spent(&mut self, spent: Duration) {
        self.update += spent;
    }

    /// Records how long making a frame took.
    pub fn prepared(&mut self, spent: Duration) {
        self.prepare.record(spent);
        self.spent(spent);
    }

    /// Pushes `frame`, (channels, rows, columns), row-major.
    ///
    /// # Errors
    /// As [`FrameEngine::push`].
    pub fn push(&mut self, frame: &[f32]) -> Result<(), EngineError> {
        let start = Instant::now();
        let pushed = self.engine.push(frame);
        let spent = start.elapsed();
        self.push.record(spent);
        self.update += spent;
        pushed
    }

    /// Predicts, and passes the prediction to `read`. The time of `read` counts too.
    ///
    /// # Errors
    /// As [`FrameEngine::predict`], and the errors of `read`.
    pub fn predict<T, E: From<EngineError>>(
        &mut self,
        read: impl FnOnce(FramePrediction<'_>) -> Result<T, E>,
    ) -> Result<T, E> {
        let start = Instant::now();
        let read = match self.engine.predict() {
            Ok(prediction) => read(FramePrediction { values: prediction.values, frames: prediction.frames }),
            Err(error) => Err(error.into()),
        };
        let spent = start.elapsed();
        self.predict.record(spent);
        self.update += spent;
        read
    }

    /// Resets to the state before the first frame.
    pub fn reset(&mut self) {
        let start = Instant::now();
        self.engine.reset();
        self.update += start.elapsed();
    }

    /// Time spent since the last call.
    pub fn take_update(&mut self) -> Duration {
        std::mem::take(&mut self.update)
    }

    /// Counts of this run.
    pub fn counters(&self) -> FrameCounters {
        self.engine.counters().since(&self.before)
    }

    /// Names of the layers, in the order of [`Self::counters`].
    pub fn layers(&self) -> impl Iterator<Item = &str> {
        self.engine.network().layers()
    }
}

/// Multiply-adds of the pixels of a layer. A layer over vectors has one pixel.
#[derive(Clone, Debug)]
pub struct LayerCost {
    /// Name of the layer.
    pub name: String,
    /// Pixels of its output.
    pub pixels: u64,
    /// Multiply-adds of all its pixels.
    multiply_adds: u64,
    /// Multiply-adds of one absorbed pixel. A convolutional LSTM still reads its hidden state if the frame is empty.
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
        // In u128, because the pixels of a recording times the products of a layer can exceed a u64.
        let computed =
            u128::from(counters.computed) * u128::from(self.multiply_adds) / u128::from(self.pixels);
        u64::try_from(computed).unwrap_or(u64::MAX).saturating_add(counters.absorbed * self.absorbed)
    }
}
