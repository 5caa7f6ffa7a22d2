//! Windows of all recordings as one network reads them, and what it makes of them.
//!
//! Recordings are shared by threads, each with an engine of its own. Every window starts from the state before the first
//! frame, so neither the number of threads nor the order reaches a bit of a result.

use meissner_engine::EngineError;
use meissner_engine::frames::{Convolution, FrameEngine};
use meissner_models::systems::slip::SlipWindows;
use meissner_models::{FrameDescription, Weights};
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::error::CliError;
use crate::slip::SlipData;
use meissner_pipeline::model::frame_network;

/// The windows of every recording.
pub(crate) struct Windows {
    /// Of each recording (windows, steps, frame).
    frames: Vec<Vec<f32>>,
    /// Windows of each recording.
    pub(crate) counts: Vec<usize>,
    /// Values of a window, and of a frame.
    lengths: (usize, usize),
}

impl Windows {
    /// The windows of `data` as `description` reads them.
    pub(crate) fn cut(data: &SlipData, description: &FrameDescription) -> Result<Self, CliError> {
        let mut windows = SlipWindows::new(description)?;
        let lengths = (windows.steps() * windows.frame_len(), windows.frame_len());
        let mut cut = Self { frames: Vec::new(), counts: Vec::new(), lengths };
        for index in 0..data.recordings.len() {
            let mut frames = Vec::new();
            cut.counts.push(data.cut(index, &mut windows, &mut frames, None)?);
            cut.frames.push(frames);
        }
        Ok(cut)
    }

    /// All windows, by recording.
    pub(crate) fn all(&self) -> Vec<Vec<usize>> {
        self.counts.iter().map(|&count| (0..count).collect()).collect()
    }

    /// The frames of a window of a recording, its last `steps` alone.
    ///
    /// # Panics
    /// Where there is no such recording or window, or it has fewer steps.
    pub(crate) fn frames(
        &self,
        recording: usize,
        window: usize,
        steps: usize,
    ) -> impl Iterator<Item = &[f32]> {
        let (window_len, frame_len) = self.lengths;
        let frames = &self.frames[recording][window * window_len..][..window_len];
        frames[window_len - steps * frame_len..].chunks_exact(frame_len)
    }

    /// Frames of a window.
    pub(crate) fn steps(&self) -> usize {
        self.lengths.0 / self.lengths.1
    }

    /// The outputs of `engine` for the windows `chosen` of each recording, in that order, from the last `steps` frames of
    /// each.
    pub(crate) fn logits(
        &self,
        pool: &ThreadPool,
        engine: &FrameEngine,
        chosen: &[Vec<usize>],
        steps: usize,
    ) -> Result<Vec<Vec<f32>>, EngineError> {
        let of_recording = |engine: &mut FrameEngine, (recording, chosen): (usize, &Vec<usize>)| {
            let mut logits = Vec::new();
            for &window in chosen {
                engine.reset();
                for frame in self.frames(recording, window, steps) {
                    engine.push(frame)?;
                }
                logits.extend_from_slice(engine.predict()?.values);
            }
            Ok(logits)
        };
        let recordings = || {
            let recordings = chosen.par_iter().enumerate();
            recordings.map_init(|| engine.clone(), of_recording).collect::<Vec<_>>()
        };
        // The first error in the order of the recordings, not of time.
        pool.install(recordings).into_iter().collect()
    }
}

/// An engine of `description` with `weights`, which `label` names.
pub(crate) fn engine(
    description: &FrameDescription,
    weights: &Weights,
    label: &str,
) -> Result<FrameEngine, CliError> {
    let (network, _) = frame_network(description, (weights, label.to_owned()), Convolution::Direct, false)?;
    Ok(FrameEngine::new(network)?)
}
