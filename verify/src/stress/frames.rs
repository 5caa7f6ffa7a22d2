//! A frame network, run over frames in three ways: skipping values that no change reaches, computing all values, and in f64.

use std::sync::Arc;
use std::time::Instant;

use meissner_engine::EngineError;
use meissner_engine::frames::{
    Convolution, FrameEngine, FrameLayer, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameOptions, Skip,
};
use meissner_reference::{Difference, FrameReference};

use super::result::{CaseResult, Errors, Expect};
use crate::error::VerifyError;
use meissner_models::random::Random;

/// The frame of a step.
pub(super) type Frames = fn(step: u64, &mut Random, frame: &mut [f32]);

/// A network and its frames.
#[derive(Clone, Debug)]
pub(super) struct FrameRun {
    pub(super) parts: FrameNetworkParts,
    pub(super) convolution: Convolution,
    pub(super) frames: Frames,
}

/// A run, and its expected result.
#[derive(Clone, Debug)]
pub(super) struct FrameCase {
    pub(super) group: &'static str,
    pub(super) name: &'static str,
    pub(super) run: FrameRun,
    pub(super) steps: u64,
    pub(super) expect: Expect,
    /// Largest relative error of a prediction.
    pub(super) within: f64,
    /// The run with which its time is compared.
    pub(super) ordinary: FrameRun,
}

/// Frames that are timed.
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

    /// The convolution, for a column of names.
    fn label(&self) -> String {
        match self.convolution {
            Convolution::Direct => format!("{}, directly", self.parts.name),
            Convolution::Winograd(tile) => format!("{}, F({1} x {1})", self.parts.name, tile.size()),
        }
    }

    /// Microseconds of a frame and the prediction after it, mean over `steps`; making the frames is not counted.
    fn us_a_frame(&self, steps: u64) -> Result<f64, EngineError> {
        let mut engine = self.engine(Skip::Nothing)?;
        let mut random = Random::new(1);
        let mut frame = vec![0.0; self.parts.input.values()];
        let mut frames = Vec::with_capacity(frame.len() * steps as usize);
        for step in 0..steps {
            (self.frames)(step, &mut random, &mut frame);
            frames.extend_from_slice(&frame);
        }
        let start = Instant::now();
        for frame in frames.chunks_exact(frame.len()) {
            engine.push(frame)?;
            // A prediction that is refused is timed, too.
            let _ = engine.predict();
        }
        Ok(start.elapsed().as_secs_f64() * 1e6 / steps as f64)
    }
}

impl FrameCase {
    /// Runs the case, with `passes` of timing.
    pub(super) fn run(&self, passes: usize) -> Result<CaseResult, VerifyError> {
        let parts = &self.run.parts;
        let mut row = CaseResult::new(self.group, self.name, self.run.label());
        let mut skipping = self.run.engine(Skip::Exact)?;
        let mut whole = self.run.engine(Skip::Nothing)?;
        let mut reference = FrameReference::new(parts.clone())?;
        let mut random = Random::new(1);
        let mut frame = vec![0.0; parts.input.values()];
        let mut wide = Vec::with_capacity(frame.len());
        let mut errors = Difference::default();
        for step in 0..self.steps {
            (self.run.frames)(step, &mut random, &mut frame);
            skipping.push(&frame)?;
            whole.push(&frame)?;
            wide.clear();
            wide.extend(frame.iter().map(|&v| f64::from(v)));
            let want = reference.push(&wide);
            let got = skipping.predict().map(|prediction| prediction.values.to_vec());
            if let Ok(got) = &got {
                errors.add_all(got, want);
            }
            row.compare(&got, &whole.predict().map(|prediction| prediction.values.to_vec()));
            if step % LAYERS_EVERY == 0 || step + 1 == self.steps {
                let layers = (0..parts.layers.len()).flat_map(|layer| reference.layer(layer));
                row.largest_activation = layers.fold(row.largest_activation, |m, v| m.max(v.abs()));
            }
        }
        row.steps = self.steps;
        row.prediction = (errors.values > 0).then(|| Errors::from(&errors));
        let (mut own, mut ordinary) = (f64::INFINITY, f64::INFINITY);
        let steps = self.steps.min(TIMED);
        for _ in 0..passes {
            ordinary = ordinary.min(self.ordinary.us_a_frame(steps)?);
            own = own.min(self.run.us_a_frame(steps)?);
        }
        if passes > 0 {
            (row.us, row.times_ordinary) = (Some(own), Some(own / ordinary));
        }
        Ok(row.judge(self.expect, self.within))
    }
}
