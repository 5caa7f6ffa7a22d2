//! A frame network that runs: frames in, predictions out, state between them.

use std::sync::Arc;

use meissner_kernels::Isa;

use super::compile::FrameNetwork;
use super::counters::FrameCounters;
use super::step::State;
use crate::EngineError;

/// What need not be computed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Skip {
    /// Everything is computed: the oracle.
    Nothing,
    /// What no change reaches keeps its values; the same bits as [`Self::Nothing`].
    #[default]
    Exact,
    /// The same, and a pixel that moved by no more than this in any channel counts as unchanged and keeps its values: an
    /// approximation.
    Tolerance(f32),
}

/// How a frame engine runs.
#[derive(Clone, Copy, Debug)]
pub struct FrameOptions {
    /// Instructions.
    pub isa: Isa,
    /// What need not be computed.
    pub skip: Skip,
    /// Whether frames are mostly zero, as those of events: what a layer makes of zeros is kept, and taken where nothing else
    /// reaches. The same bits; twice the memory.
    pub sparse: bool,
    /// Whether the rows of large maps are shared by two threads; the same bits.
    pub two_threads: bool,
}

impl Default for FrameOptions {
    fn default() -> Self {
        Self { isa: Isa::best(), skip: Skip::Exact, sparse: false, two_threads: false }
    }
}

/// A prediction of a frame network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramePrediction<'a> {
    /// The values, (channels, height, width) for an image.
    pub values: &'a [f32],
    /// Frames since the last reset.
    pub frames: u64,
}

/// State of a frame engine at one moment; see [`FrameEngine::snapshot`].
#[derive(Clone, Debug)]
pub struct FrameSnapshot(State);

/// A frame network and its state.
#[derive(Clone, Debug)]
pub struct FrameEngine {
    network: Arc<FrameNetwork>,
    options: FrameOptions,
    state: State,
}

impl FrameEngine {
    /// An engine before its first frame.
    ///
    /// # Errors
    /// [`EngineError::Option`] for a tolerance that is negative or not finite, [`EngineError::Layer`] where a map is too large.
    pub fn new(network: Arc<FrameNetwork>, options: FrameOptions) -> Result<Self, EngineError> {
        if let Skip::Tolerance(tolerance) = options.skip
            && !(tolerance.is_finite() && tolerance >= 0.0)
        {
            let expected = "a finite number that is not negative".to_owned();
            return Err(EngineError::Option { what: "tolerance", expected, found: tolerance.to_string() });
        }
        let state = State::new(&network, options)?;
        Ok(Self { network, options, state })
    }

    /// The network.
    pub fn network(&self) -> &Arc<FrameNetwork> {
        &self.network
    }

    /// Takes the next frame, (channels, height, width) for an image. Layers with a state, and what they read, run; the others
    /// wait for [`Self::predict`].
    ///
    /// # Errors
    /// [`EngineError::Option`] for another number of values, or one that is not finite: nothing has changed then.
    pub fn push(&mut self, frame: &[f32]) -> Result<(), EngineError> {
        let expected = self.network.input().values();
        if frame.len() != expected {
            let (expected, found) =
                (format!("{expected} ({})", self.network.input()), frame.len().to_string());
            return Err(EngineError::Option { what: "values of a frame", expected, found });
        }
        // Without a branch, so that it takes vectors.
        let finite = frame.iter().fold(true, |finite, v| finite & v.is_finite());
        if let Some(at) = (!finite).then(|| frame.iter().position(|v| !v.is_finite())).flatten() {
            let (expected, found) = ("finite values".to_owned(), format!("{} as value {at}", frame[at]));
            return Err(EngineError::Option { what: "frame", expected, found });
        }
        self.state.push(&self.network, self.options, frame);
        Ok(())
    }

    /// The prediction after the last frame; before the first, for a frame of zeros.
    ///
    /// # Errors
    /// [`EngineError::NotANumber`] with the first layer that holds NaN.
    pub fn predict(&mut self) -> Result<FramePrediction<'_>, EngineError> {
        self.state.predict(&self.network, self.options);
        if self.state.prediction().iter().any(|v| v.is_nan()) {
            let layer = self.state.not_a_number(&self.network);
            return Err(EngineError::NotANumber { layer, rows: 1 });
        }
        Ok(FramePrediction { values: self.state.prediction(), frames: self.state.frames() })
    }

    /// Back to the state before the first frame. Counters go on.
    pub fn reset(&mut self) {
        self.state.reset(&self.network);
    }

    /// The state, to go back to.
    pub fn snapshot(&self) -> FrameSnapshot {
        FrameSnapshot(self.state.clone())
    }

    /// Goes back to `snapshot`, which an engine of the same network and options made; counters too.
    ///
    /// # Errors
    /// [`EngineError::Snapshot`] where it is another network's.
    pub fn restore(&mut self, snapshot: &FrameSnapshot) -> Result<(), EngineError> {
        let (expected, found) = (self.state.layout(), snapshot.0.layout());
        if expected != found {
            return Err(EngineError::Snapshot { what: "layers of", expected, found });
        }
        self.state.clone_from(&snapshot.0);
        Ok(())
    }

    /// Counts since the engine was made.
    pub fn counters(&self) -> &FrameCounters {
        self.state.counters()
    }

    /// Bytes of activations and state.
    pub fn state_bytes(&self) -> usize {
        self.state.bytes()
    }
}
