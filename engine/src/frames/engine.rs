//! A running frame network: takes frames, gives predictions, keeps state in between.

use std::fmt;
use std::sync::Arc;

use meissner_kernels::Isa;

use super::compile::FrameNetwork;
use super::options::{FrameOptions, Skip};
use super::step::{Cell, State};
use crate::EngineError;
use crate::counters::FrameCounters;
use crate::error::option;
use crate::snapshot::{Content, Kind, Reader, SnapshotOf, Stored, Writer, check_network, differs};

/// A prediction of a frame network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramePrediction<'a> {
    /// The values; (channels, height, width) for an image.
    pub values: &'a [f32],
    /// Number of frames since the last reset.
    pub frames: u64,
    /// How unlike the newest frames are to those of the training: above 1, fewer than 1 of 1,000 of
    /// these were ([`TrainingFrames::unlikeness`]). `None` if the network has no statistics of its
    /// training.
    ///
    /// [`TrainingFrames::unlikeness`]: super::TrainingFrames::unlikeness
    pub unlike: Option<f32>,
}

/// The state of a [`FrameEngine`] at one moment; see [`FrameEngine::snapshot`].
pub type FrameSnapshot = SnapshotOf<FrameEngine>;

/// A frame network and its state.
///
/// ```
/// use meissner_engine::frames::{Convolution, FrameEngine, FrameLayer, FrameLayerKind};
/// use meissner_engine::frames::{FrameNetwork, FrameNetworkParts, FrameShape};
///
/// // The last two frames of one value each.
/// let kind = FrameLayerKind::Delay { frames: 2 };
/// let delay = FrameLayer { name: "delay".to_owned(), from: 0, kind };
/// let input = FrameShape::Vector(1);
/// let (name, layers) = ("two".to_owned(), vec![delay]);
/// let parts = FrameNetworkParts { name, input, layers, training: None };
/// let mut engine = FrameEngine::new(FrameNetwork::new(parts, Convolution::Direct)?)?;
/// engine.push(&[3.0])?;
/// engine.push_slice(&[4.0, 5.0])?;
/// assert_eq!(engine.predict()?.values, [4.0, 5.0]);
/// # Ok::<(), meissner_engine::EngineError>(())
/// ```
#[derive(Clone)]
pub struct FrameEngine {
    network: Arc<FrameNetwork>,
    options: FrameOptions,
    state: State,
}

impl Stored for FrameEngine {
    const KIND: Kind = Kind::Frames;

    fn to_bytes_with(&self, note: &[u8]) -> Vec<u8> {
        self.to_bytes_with(note)
    }
}

impl FrameEngine {
    /// An engine with the default [`FrameOptions`].
    ///
    /// # Errors
    /// As [`Self::with_options`].
    pub fn new(network: impl Into<Arc<FrameNetwork>>) -> Result<Self, EngineError> {
        Self::with_options(network, FrameOptions::default())
    }

    /// An engine before its first frame.
    ///
    /// # Errors
    /// [`EngineError::Option`] for a tolerance below 0 or not finite, [`EngineError::FrameMemory`]
    /// beyond the memory limit (before any allocation), [`EngineError::Layer`] for too large a map.
    pub fn with_options(
        network: impl Into<Arc<FrameNetwork>>,
        options: FrameOptions,
    ) -> Result<Self, EngineError> {
        let network = network.into();
        if let Skip::Tolerance(tolerance) = options.skip
            && !(tolerance.is_finite() && tolerance >= 0.0)
        {
            return Err(option("tolerance", "a finite number that is not negative", tolerance));
        }
        let (bytes, limit) = (network.engine_bytes(options), options.memory_limit);
        if bytes > limit {
            return Err(EngineError::FrameMemory { network: network.name().to_owned(), bytes, limit });
        }
        let state = State::new(&network, options)?;
        Ok(Self { network, options, state })
    }

    /// The network.
    pub fn network(&self) -> &Arc<FrameNetwork> {
        &self.network
    }

    /// Takes the next frame, (channels, height, width) for an image. Layers with a state, and the
    /// layers that they read, run now; the others run at the next [`Self::predict`].
    ///
    /// # Errors
    /// [`EngineError::FrameLength`] for a wrong number of values, [`EngineError::FrameValue`] for
    /// one that is not finite. The state is then unchanged.
    pub fn push(&mut self, frame: &[f32]) -> Result<(), EngineError> {
        let input = self.network.input();
        if frame.len() != input.values() {
            return Err(EngineError::FrameLength { expected: input, found: frame.len() });
        }
        self.push_slice(frame)
    }

    /// Takes several frames, concatenated in `frames`, as [`Self::push`] takes one.
    ///
    /// # Errors
    /// As [`Self::push`], with indices into all of `frames`. No frame is taken then.
    pub fn push_slice(&mut self, frames: &[f32]) -> Result<(), EngineError> {
        let input = self.network.input();
        if !frames.len().is_multiple_of(input.values()) {
            return Err(EngineError::FrameLength { expected: input, found: frames.len() });
        }
        // Branch-free, so that it vectorises: the exponent of a value that is not finite is all
        // ones.
        let not_finite = f32::INFINITY.to_bits();
        if frames.iter().fold(false, |found, value| found | (value.to_bits() & not_finite == not_finite))
            && let Some((at, &value)) = frames.iter().enumerate().find(|(_, value)| !value.is_finite())
        {
            return Err(EngineError::FrameValue { at, value });
        }
        frames
            .chunks_exact(input.values())
            .for_each(|frame| self.state.push(&self.network, self.options, frame));
        Ok(())
    }

    /// Takes an image that differs from the last frame only in `cells`, at the cost of the change.
    /// Needs the default [`FrameOptions::skip`] and [`FrameOptions::sparse`]. Errors:
    /// [`EngineError::FrameValue`] for a value that is not finite. The state is then unchanged.
    pub(crate) fn push_cells<'a>(
        &mut self,
        cells: impl Iterator<Item = Cell<'a>> + Clone,
    ) -> Result<(), EngineError> {
        debug_assert!(self.options.skip == Skip::Exact && !self.options.sparse);
        for Cell { pixel, values, .. } in cells.clone() {
            if let Some(&value) = values.iter().find(|value| !value.is_finite()) {
                return Err(EngineError::FrameValue { at: pixel, value });
            }
        }
        self.state.push_cells(&self.network, self.options, cells);
        Ok(())
    }

    /// The prediction after the last frame; before the first, that for a frame of zeros.
    ///
    /// # Errors
    /// [`EngineError::NotANumber`] with the first layer that holds NaN.
    pub fn predict(&mut self) -> Result<FramePrediction<'_>, EngineError> {
        self.state.predict(&self.network, self.options);
        if self.state.prediction.iter().any(|v| v.is_nan()) {
            let layer = self.state.not_a_number(&self.network);
            return Err(EngineError::NotANumber { layer, rows: 1 });
        }
        let unlike = self.state.unlikeness(&self.network);
        Ok(FramePrediction { values: &self.state.prediction, frames: self.state.frames, unlike })
    }

    /// Returns to the state before the first frame. Counters are kept.
    pub fn reset(&mut self) {
        self.state.reset(&self.network, self.options);
    }

    /// A copy of the current state, to return to.
    pub fn snapshot(&self) -> FrameSnapshot {
        SnapshotOf(Content::Copy(Box::new(self.clone())))
    }

    /// Returns to the state of `snapshot`, counters included. Options that do not affect results
    /// (all but [`FrameOptions::skip`] and [`FrameOptions::sparse`]) remain this engine's.
    ///
    /// # Errors
    /// [`EngineError::Snapshot`] for an unequal network ([`FrameNetwork::fingerprint`]),
    /// [`FrameOptions::skip`] or [`FrameOptions::sparse`]; for bytes, the errors of
    /// [`Self::restore_bytes`]. The state is then unchanged.
    pub fn restore(&mut self, snapshot: &FrameSnapshot) -> Result<(), EngineError> {
        let other = match &snapshot.0 {
            Content::Copy(engine) => engine,
            Content::Bytes(bytes) => return self.restore_bytes(bytes),
        };
        check_network(self.network.identity(), other.network.identity())?;
        self.check_skip(other.options.skip, other.options.sparse)?;
        self.state.clone_from(&other.state);
        self.state.know(&self.network);
        Ok(())
    }

    /// Encodes the state for [`Self::restore_bytes`], in about [`Self::state_bytes`].
    pub fn to_bytes(&self) -> Vec<u8> {
        self.to_bytes_with(&[])
    }

    /// The same with a note, which [`crate::snapshot_note`] returns and the checksum covers.
    pub fn to_bytes_with(&self, note: &[u8]) -> Vec<u8> {
        let mut to = Writer::new(Kind::Frames);
        to.u64(self.network.fingerprint());
        to.text(self.network.name());
        let (skip, tolerance) = skip_code(self.options.skip);
        to.u8(skip);
        to.u32(tolerance.to_bits());
        to.flag(self.options.sparse);
        self.state.write(&self.network, &mut to);
        to.finish(note)
    }

    /// Restores the state that [`Self::to_bytes`] wrote for an equal network,
    /// [`FrameOptions::skip`] and [`FrameOptions::sparse`]. Results and counters are as if that
    /// engine had continued.
    ///
    /// Cost: O(bytes). In addition to the bytes, needs at most this engine's memory once more.
    ///
    /// # Errors
    /// [`EngineError::Snapshot`] for another version, network or skip option;
    /// [`EngineError::SnapshotBytes`] for bytes that are truncated, changed or do not fit, or a
    /// value that is not finite. The state is then unchanged.
    pub fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        let mut from = Reader::open(bytes, Kind::Frames)?;
        let fingerprint = from.u64("network")?;
        let name = from.text("network's name")?;
        check_network(self.network.identity(), (fingerprint, &name))?;
        let (skip, tolerance) = (from.u8("skip")?, f32::from_bits(from.u32("tolerance")?));
        let skip = match skip {
            0 => Skip::Nothing,
            1 => Skip::Exact,
            2 => Skip::Tolerance(tolerance),
            other => return Err(from.refuse("skip", 5, "0 to 2", other)),
        };
        self.check_skip(skip, from.flag("sparse")?)?;
        let mut state = self.state.clone();
        state.read(&self.network, &mut from)?;
        from.end()?;
        self.state = state;
        Ok(())
    }

    fn check_skip(&self, skip: Skip, sparse: bool) -> Result<(), EngineError> {
        if skip != self.options.skip {
            return Err(differs("skip", self.options.skip, skip));
        }
        if sparse != self.options.sparse {
            return Err(differs("sparse", self.options.sparse, sparse));
        }
        Ok(())
    }

    pub(crate) fn set_isa(&mut self, isa: Isa) {
        self.options.isa = isa;
    }

    /// Counts since the engine was made.
    pub fn counters(&self) -> &FrameCounters {
        &self.state.counters
    }

    /// Bytes of activations and state; [`FrameNetwork::engine_bytes`] adds working space.
    pub fn state_bytes(&self) -> usize {
        self.network.state_bytes(self.options) as usize
    }
}

fn skip_code(skip: Skip) -> (u8, f32) {
    match skip {
        Skip::Nothing => (0, 0.0),
        Skip::Exact => (1, 0.0),
        Skip::Tolerance(tolerance) => (2, tolerance + 0.0),
    }
}

impl fmt::Debug for FrameEngine {
    /// Shows the configuration, not the state.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FrameEngine")
            .field("network", &self.network.name())
            .field("options", &self.options)
            .field("frames", &self.state.frames)
            .finish_non_exhaustive()
    }
}
