//! A frame engine that skips beside one that computes everything.

use std::sync::Arc;

use meissner_engine::EngineError;
use meissner_engine::frames::{FrameEngine, FrameNetwork, FrameOptions, Skip};

use crate::difference::Difference;
use crate::incremental::{Checked, Incremental};
use crate::step::Step;

/// A frame engine, and one over the same frames that computes every value of every frame.
#[derive(Clone, Debug)]
pub struct CheckedFrames<E = FrameEngine> {
    /// The engine.
    pub engine: E,
    whole: FrameEngine,
    values: u64,
    refused: u64,
}

impl<E: Incremental<Input = Vec<f32>>> CheckedFrames<E> {
    /// `engine`, new, of `network`.
    ///
    /// # Errors
    /// As [`FrameEngine::with_options`].
    pub fn of(engine: E, network: impl Into<Arc<FrameNetwork>>) -> Result<Self, EngineError> {
        let whole = FrameEngine::with_options(network, FrameOptions::new().with_skip(Skip::Nothing))?;
        Ok(Self { engine, whole, values: 0, refused: 0 })
    }

    /// Compares the predictions, bit for bit.
    ///
    /// # Errors
    /// They differ.
    pub fn compare(&mut self) -> Result<(), Difference> {
        let expected = self.whole.predict().map(|prediction| prediction.values.to_vec());
        self.values += expected.as_ref().map_or(0, Vec::len) as u64;
        self.refused += u64::from(!Difference::of_predictions(&self.engine.predict(), &expected)?);
        Ok(())
    }
}

impl<E: Incremental<Input = Vec<f32>>> Checked for CheckedFrames<E> {
    type Input = Vec<f32>;

    fn step(&mut self, step: &Step<Vec<f32>>) -> Result<(), Difference> {
        let done = match step {
            Step::Push(frame) => self.whole.push(frame).and_then(|()| self.engine.push(frame).map(drop)),
            Step::Advance(_) | Step::Predict => Ok(()),
            Step::Reset => {
                self.whole.reset();
                self.engine.reset();
                Ok(())
            }
            Step::Snapshot => {
                let snapshot = self.engine.snapshot();
                let ones = vec![1.0; self.whole.network().input().values()];
                let pushed = self.engine.push(&ones);
                let _ = self.engine.predict();
                pushed.and_then(|_| self.engine.restore(&snapshot))
            }
            Step::Bytes => {
                let bytes = self.engine.to_bytes();
                self.engine.reset();
                self.engine.restore_bytes(&bytes)
            }
        };
        done.map_err(|error| Difference::failed("a call of the engine", &error))
    }

    fn compare(&mut self) -> Result<(), Difference> {
        self.compare()
    }

    fn counts(&self) -> (u64, u64) {
        (self.values, self.refused)
    }
}
