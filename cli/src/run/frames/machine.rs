//! The engine with a clock around everything that costs time.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::EngineError;
use meissner_engine::frames::{FrameCounters, FrameEngine, FrameNetwork, FrameOptions};

use crate::latency::Latency;

/// Takes frames and predicts, and knows how long that took.
pub(super) struct Machine {
    engine: FrameEngine,
    options: FrameOptions,
    /// What was counted before this run.
    before: FrameCounters,
    /// Making of frames, for each event, reading or picture.
    pub(super) prepare: Latency,
    pub(super) push: Latency,
    pub(super) predict: Latency,
    /// From a reading to the decision behind it, for readings that have one.
    pub(super) decision: Latency,
    /// Time spent since the last prediction.
    update: Duration,
}

/// A prediction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Predicted<'a> {
    pub(super) values: &'a [f32],
    /// Frames that the state has seen.
    pub(super) frames: u64,
}

impl Machine {
    pub(super) fn new(network: Arc<FrameNetwork>, options: FrameOptions) -> Result<Self, EngineError> {
        let engine = FrameEngine::new(network, options)?;
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
    pub(super) fn resume(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        self.engine.restore_bytes(bytes)?;
        self.before = self.engine.counters().clone();
        Ok(())
    }

    /// The state, with a note.
    pub(super) fn to_bytes_with(&self, note: &[u8]) -> Vec<u8> {
        self.engine.to_bytes_with(note)
    }

    pub(super) fn options(&self) -> FrameOptions {
        self.options
    }

    /// So much time went into making a frame; [`Self::prepare`] counts what belongs together.
    pub(super) fn spent(&mut self, spent: Duration) {
        self.update += spent;
    }

    /// Making a frame took so long.
    pub(super) fn prepared(&mut self, spent: Duration) {
        self.prepare.record(spent);
        self.spent(spent);
    }

    pub(super) fn push(&mut self, frame: &[f32]) -> Result<(), EngineError> {
        let start = Instant::now();
        let pushed = self.engine.push(frame);
        let spent = start.elapsed();
        self.push.record(spent);
        self.update += spent;
        pushed
    }

    /// Predicts, and lets `read` make of it what it is wanted for, on the same clock.
    pub(super) fn predict<T, E: From<EngineError>>(
        &mut self,
        read: impl FnOnce(Predicted<'_>) -> Result<T, E>,
    ) -> Result<T, E> {
        let start = Instant::now();
        let read = match self.engine.predict() {
            Ok(prediction) => read(Predicted { values: prediction.values, frames: prediction.frames }),
            Err(error) => Err(error.into()),
        };
        let spent = start.elapsed();
        self.predict.record(spent);
        self.update += spent;
        read
    }

    /// Back to the state before the first frame.
    pub(super) fn reset(&mut self) {
        let start = Instant::now();
        self.engine.reset();
        self.update += start.elapsed();
    }

    /// Time spent since the last call.
    pub(super) fn take_update(&mut self) -> Duration {
        std::mem::take(&mut self.update)
    }

    /// Counts of this run.
    pub(super) fn counters(&self) -> FrameCounters {
        self.engine.counters().since(&self.before)
    }

    /// Names of the layers, in the order of [`Self::counters`].
    pub(super) fn layers(&self) -> impl Iterator<Item = &str> {
        self.engine.network().layers()
    }
}
