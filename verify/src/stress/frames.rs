//! A frame network, run over frames in three ways: skipping values that no change reaches, computing all values, and in f64.

use std::sync::Arc;
use std::time::Instant;

use meissner_engine::EngineError;
use meissner_engine::frames::{
    Convolution, FrameEngine, FrameLayer, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameOptions, Skip,
};
use meissner_reference::{Difference, FrameReference};

use super::Run;
use super::result::{CaseResult, Errors};
use crate::error::VerifyError;
use meissner_kernels::random::Random;

/// The frame of a step.
pub(super) type Frames = fn(step: u64, &mut Random, frame: &mut [f32]);

/// A network and its frames.
#[derive(Clone, Debug)]
pub(super) struct FrameRun {
    pub(super) parts: FrameNetworkParts,
    pub(super) convolution: Convolution,
    pub(super) frames: Frames,
    pub(super) steps: u64,
}

/// Most frames that are timed.
const TIMED: u64 = 20_000;
/// Frames from one reading of all layers to the next.
const LAYERS_EVERY: u64 = 997;

/// A layer that reads the one before.
pub(super) fn layer(name: &str, from: usize, kind: FrameLayerKind) -> FrameLayer {
    FrameLayer { name: name.to_owned(), from, kind }
}

impl FrameRun {
    fn engine(&self, skip: Skip) -> Result<FrameEngine, EngineError> {
        let network = Arc::new(FrameNetwork::new(self.parts.clone(), self.convolution)?);
        FrameEngine::with_options(network, FrameOptions::new().with_skip(skip))
    }

    /// The first `steps` frames, in order, for `take`.
    fn each(
        &self,
        steps: u64,
        mut take: impl FnMut(u64, &[f32]) -> Result<(), EngineError>,
    ) -> Result<(), EngineError> {
        let (mut random, mut frame) = (Random::new(1), vec![0.0; self.parts.input.values()]);
        (0..steps).try_for_each(|step| {
            (self.frames)(step, &mut random, &mut frame);
            take(step, &frame)
        })
    }
}

impl Run for FrameRun {
    fn network(&self) -> String {
        match self.convolution {
            Convolution::Direct => format!("{}, directly", self.parts.name),
            Convolution::Winograd(tile) => format!("{}, F({1} x {1})", self.parts.name, tile.size()),
            Convolution::Kn2row => format!("{}, kn2row", self.parts.name),
        }
    }

    fn compare(&self, result: &mut CaseResult) -> Result<(), VerifyError> {
        let mut skipping = self.engine(Skip::Exact)?;
        let mut whole = self.engine(Skip::Nothing)?;
        let mut reference = FrameReference::new(self.parts.clone())?;
        let mut wide = Vec::with_capacity(self.parts.input.values());
        let mut errors = Difference::default();
        self.each(self.steps, |step, frame| {
            skipping.push(frame)?;
            whole.push(frame)?;
            wide.clear();
            wide.extend(frame.iter().map(|&v| f64::from(v)));
            let want = reference.push(&wide);
            let got = skipping.predict().map(|prediction| prediction.values.to_vec());
            if let Ok(got) = &got {
                errors.add_all(got, want);
            }
            result.compare(&got, &whole.predict().map(|prediction| prediction.values.to_vec()));
            if step % LAYERS_EVERY == 0 || step + 1 == self.steps {
                let layers = (0..self.parts.layers.len()).flat_map(|layer| reference.layer(layer));
                result.largest_activation = layers.fold(result.largest_activation, |m, v| m.max(v.abs()));
            }
            Ok(())
        })?;
        result.steps = self.steps;
        result.prediction = (errors.values > 0).then(|| Errors::from(&errors));
        Ok(())
    }

    fn time_us(&self) -> Result<f64, EngineError> {
        let mut engine = self.engine(Skip::Nothing)?;
        let steps = self.steps.min(TIMED);
        // Making the frames is not timed.
        let mut frames = Vec::with_capacity(self.parts.input.values() * steps as usize);
        self.each(steps, |_, frame| {
            frames.extend_from_slice(frame);
            Ok(())
        })?;
        let start = Instant::now();
        for frame in frames.chunks_exact(self.parts.input.values()) {
            engine.push(frame)?;
            // A prediction that is refused is timed, too.
            let _ = engine.predict();
        }
        Ok(start.elapsed().as_secs_f64() * 1e6 / steps as f64)
    }
}
