//! The engine with a clock around everything that costs time.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::EngineError;
use meissner_engine::frames::{FrameCounters, FrameEngine, FrameNetwork, FrameOptions};

use crate::latency::Latency;

/// Takes frames and predicts, and knows how long that took.
pub struct FramePredictor {
    engine: FrameEngine,
    options: FrameOptions,
    /// What was counted before this run.
    before: FrameCounters,
    /// Making of frames, for each event, reading or picture.
    pub prepare: Latency,
    /// Pushes of frames.
    pub push: Latency,
    /// Predictions.
    pub predict: Latency,
    /// From a reading to the decision behind it, for readings that have one.
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

    /// Goes on from the state in `bytes`.
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

    /// So much time went into making a frame; [`Self::prepare`] counts what belongs together.
    pub fn spent(&mut self, spent: Duration) {
        self.update += spent;
    }

    /// Making a frame took so long.
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

    /// Predicts, and lets `read` make of it what it is wanted for, on the same clock.
    ///
    /// # Errors
    /// As [`FrameEngine::predict`], and those of `read`.
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

    /// Back to the state before the first frame.
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
