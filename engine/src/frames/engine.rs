//! A frame network that runs: frames in, predictions out, state between them.

use std::fmt;
use std::sync::Arc;

use meissner_kernels::Isa;

use super::compile::FrameNetwork;
use super::counters::FrameCounters;
use super::options::{FrameOptions, Skip};
use super::step::State;
use crate::EngineError;
use crate::snapshot::{Kind, Reader, Writer, differs};

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
pub struct FrameSnapshot(FrameEngine);

impl FrameSnapshot {
    /// As [`FrameEngine::to_bytes`].
    pub fn to_bytes(&self) -> Vec<u8> {
        self.0.to_bytes()
    }
}

/// A frame network and its state.
///
/// ```
/// use std::sync::Arc;
///
/// use meissner_engine::frames::{Convolution, FrameEngine, FrameLayer, FrameLayerKind, FrameNetwork};
/// use meissner_engine::frames::{FrameNetworkParts, FrameOptions, FrameShape};
///
/// // The last two frames of one value each.
/// let delay = FrameLayer { name: "delay".to_owned(), from: 0, kind: FrameLayerKind::Delay { frames: 2 } };
/// let parts = FrameNetworkParts { name: "two".to_owned(), input: FrameShape::Vector(1), layers: vec![delay] };
/// let network = Arc::new(FrameNetwork::new(parts, Convolution::Direct)?);
/// let mut engine = FrameEngine::new(network, FrameOptions::default())?;
/// engine.push(&[3.0])?;
/// engine.push(&[5.0])?;
/// assert_eq!(engine.predict()?.values, [3.0, 5.0]);
/// # Ok::<(), meissner_engine::EngineError>(())
/// ```
#[derive(Clone)]
pub struct FrameEngine {
    network: Arc<FrameNetwork>,
    options: FrameOptions,
    state: State,
}

impl FrameEngine {
    /// An engine before its first frame.
    ///
    /// # Errors
    /// [`EngineError::Option`] for a tolerance that is negative or not finite, [`EngineError::FrameMemory`] beyond the memory
    /// limit, before any of it is taken; [`EngineError::Layer`] where a map is too large.
    pub fn new(network: Arc<FrameNetwork>, options: FrameOptions) -> Result<Self, EngineError> {
        if let Skip::Tolerance(tolerance) = options.skip
            && !(tolerance.is_finite() && tolerance >= 0.0)
        {
            let expected = "a finite number that is not negative".to_owned();
            return Err(EngineError::Option { what: "tolerance", expected, found: tolerance.to_string() });
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
        FrameSnapshot(self.clone())
    }

    /// Goes back to `snapshot`, counters too. Options that reach no result (all but [`FrameOptions::skip`] and
    /// [`FrameOptions::sparse`]) stay this engine's own.
    ///
    /// # Errors
    /// [`EngineError::Snapshot`] where it was taken with an unequal network ([`FrameNetwork::fingerprint`]), or with another
    /// way to skip; the engine stays as it is.
    pub fn restore(&mut self, snapshot: &FrameSnapshot) -> Result<(), EngineError> {
        let other = &snapshot.0;
        self.check_network(other.network.fingerprint(), other.network.name())?;
        self.check_skip(other.options.skip, other.options.sparse)?;
        self.state.clone_from(&other.state);
        Ok(())
    }

    /// The state as bytes, for [`Self::restore_bytes`], in this process or another; about as many as
    /// [`Self::state_bytes`].
    pub fn to_bytes(&self) -> Vec<u8> {
        self.to_bytes_with(&[])
    }

    /// The same with a note of the caller's, which [`crate::snapshot_note`] gives back; the checksum covers it, too.
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

    /// Goes on from the state that [`Self::to_bytes`] of an engine with an equal network and the same [`FrameOptions::skip`]
    /// and [`FrameOptions::sparse`] wrote: what follows, counters included, is as if that engine had gone on.
    ///
    /// Cost: O(bytes). Beside the bytes, at most once more the memory that this engine takes.
    ///
    /// # Errors
    /// [`EngineError::Snapshot`] where the bytes are of another version, network, or way to skip;
    /// [`EngineError::SnapshotBytes`] where they are cut short, changed, or do not fit, also where a value is not finite: such
    /// a state predicts nothing. The engine stays as it is then.
    pub fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        let mut from = Reader::open(bytes, Kind::Frames)?;
        let fingerprint = from.u64("network")?;
        let name = from.text("network's name")?;
        self.check_network(fingerprint, &name)?;
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

    fn check_network(&self, fingerprint: u64, name: &str) -> Result<(), EngineError> {
        if fingerprint == self.network.fingerprint() {
            return Ok(());
        }
        let of = |name: &str, fingerprint: u64| format!("{name:?} with fingerprint {fingerprint:#018x}");
        let expected = of(self.network.name(), self.network.fingerprint());
        Err(differs("network", expected, of(name, fingerprint)))
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

    /// Goes on with another instruction set.
    pub(crate) fn set_isa(&mut self, isa: Isa) {
        self.options.isa = isa;
    }

    /// Counts since the engine was made.
    pub fn counters(&self) -> &FrameCounters {
        self.state.counters()
    }

    /// Bytes of activations and state; [`FrameNetwork::engine_bytes`] counts the room to work in, too.
    pub fn state_bytes(&self) -> usize {
        self.state.bytes()
    }
}

/// How [`Skip`] is written.
fn skip_code(skip: Skip) -> (u8, f32) {
    match skip {
        Skip::Nothing => (0, 0.0),
        Skip::Exact => (1, 0.0),
        Skip::Tolerance(tolerance) => (2, tolerance + 0.0),
    }
}

impl fmt::Debug for FrameEngine {
    /// What tells engines apart, not what they hold.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FrameEngine")
            .field("network", &self.network.name())
            .field("options", &self.options)
            .field("frames", &self.state.frames())
            .finish_non_exhaustive()
    }
}
