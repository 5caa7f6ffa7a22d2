//! A frame engine with a clock around each call.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::EngineError;
use meissner_engine::frames::{FrameCounters, FrameEngine, FrameNetwork, FrameOptions, FramePrediction};

use crate::clock::Passed;
use crate::latency::Latency;
use crate::training::{Output, Training};

/// A frame engine that records how long its calls took.
pub(super) struct FramePredictor {
    pub(super) engine: FrameEngine,
    before: FrameCounters,
    /// Time to make frames, for each event, reading or picture.
    pub(super) prepare: Latency,
    pub(super) push: Latency,
    pub(super) predict: Latency,
    /// Time from a reading to the decision after it, for readings that complete a window.
    pub(super) decision: Latency,
    pub(super) training: Training,
    /// Stream time that the input has covered.
    pub(super) passed: Passed,
    /// Time spent since the last prediction.
    update: Duration,
}

impl FramePredictor {
    pub(super) fn new(
        network: Arc<FrameNetwork>,
        options: FrameOptions,
        outputs: &[Output],
    ) -> Result<Self, EngineError> {
        let engine = FrameEngine::with_options(network, options)?;
        Ok(Self {
            before: engine.counters().clone(),
            engine,
            prepare: Latency::new(),
            push: Latency::new(),
            predict: Latency::new(),
            decision: Latency::new(),
            training: Training::new(outputs),
            passed: Passed::default(),
            update: Duration::ZERO,
        })
    }

    pub(super) fn resume(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        self.engine.restore_bytes(bytes)?;
        self.before = self.engine.counters().clone();
        Ok(())
    }

    /// Adds time spent in making a frame. [`Self::prepare`] records complete frames.
    pub(super) fn spent(&mut self, spent: Duration) {
        self.update += spent;
    }

    pub(super) fn prepared(&mut self, spent: Duration) {
        self.prepare.record(spent);
        self.spent(spent);
    }

    /// Pushes `frame`, (channels, rows, columns), row-major.
    pub(super) fn push(&mut self, frame: &[f32]) -> Result<(), EngineError> {
        let start = Instant::now();
        let pushed = self.engine.push(frame);
        let spent = start.elapsed();
        self.push.record(spent);
        self.update += spent;
        pushed
    }

    /// Predicts, and passes the prediction to `read`. The time of `read` counts too.
    pub(super) fn predict<T, E: From<EngineError>>(
        &mut self,
        read: impl FnOnce(FramePrediction<'_>) -> Result<T, E>,
    ) -> Result<T, E> {
        let start = Instant::now();
        let read = self.engine.predict().map_err(E::from).and_then(read);
        let spent = start.elapsed();
        self.predict.record(spent);
        self.update += spent;
        read
    }

    /// Resets to the state before the first frame.
    pub(super) fn reset(&mut self) {
        let start = Instant::now();
        self.engine.reset();
        self.update += start.elapsed();
    }

    /// Time spent since the last call.
    pub(super) fn take_update(&mut self) -> Duration {
        std::mem::take(&mut self.update)
    }

    pub(super) fn counters(&self) -> FrameCounters {
        self.engine.counters().since(&self.before)
    }
}
