//! A frame engine that skips beside one that computes everything.

use std::sync::Arc;

use meissner_engine::EngineError;
use meissner_engine::frames::{FrameEngine, FrameNetwork, FrameOptions, Skip};

use crate::difference::Difference;
use crate::incremental::{Checked, Incremental, values};
use crate::step::Step;

/// A frame engine, and one over the same frames that computes every value of every frame.
pub(crate) struct CheckedFrames<E> {
    engine: E,
    whole: FrameEngine,
    values: u64,
    refused: u64,
}

impl<E> CheckedFrames<E> {
    /// `engine`, new, of `network`.
    pub(crate) fn of(engine: E, network: Arc<FrameNetwork>) -> Result<Self, EngineError> {
        let whole = FrameEngine::with_options(network, FrameOptions::new().with_skip(Skip::Nothing))?;
        Ok(Self { engine, whole, values: 0, refused: 0 })
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
            Step::Snapshot => self.engine.detour([vec![1.0; self.whole.network().input().values()]]),
            Step::Bytes => self.engine.through_bytes(),
        };
        done.map_err(|error| Difference::failed("a call of the engine", &error))
    }

    fn compare(&mut self) -> Result<(), Difference> {
        let expected = values(&mut self.whole);
        self.values += expected.as_ref().map_or(0, Vec::len) as u64;
        self.refused += u64::from(!Difference::of_predictions(&values(&mut self.engine), &expected)?);
        Ok(())
    }

    fn counts(&self) -> (u64, u64) {
        (self.values, self.refused)
    }
}
