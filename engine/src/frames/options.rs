//! Options of a frame engine.

use std::fmt;

use meissner_kernels::Isa;

/// Which computations are skipped.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Skip {
    /// None: everything is computed. This is the oracle.
    Nothing,
    /// Values that no change reaches are kept. The bits are those of [`Self::Nothing`].
    #[default]
    Exact,
    /// As [`Self::Exact`], but a pixel that changed by at most this value in every channel keeps
    /// its values: an approximation.
    Tolerance(f32),
}

impl fmt::Display for Skip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing => f.write_str("nothing"),
            Self::Exact => f.write_str("exact"),
            Self::Tolerance(tolerance) => write!(f, "tolerance {tolerance}"),
        }
    }
}

/// Options of a [`FrameEngine`](super::FrameEngine).
///
/// ```
/// use meissner_engine::frames::{FrameOptions, Skip};
///
/// let options = FrameOptions::new().with_skip(Skip::Tolerance(1e-3)).with_two_threads(true);
/// assert_eq!((options.sparse, options.memory_limit), (false, 4 << 30));
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
#[must_use]
pub struct FrameOptions {
    /// Instruction set of the kernels, the processor's best by default. It affects no result.
    pub isa: Isa,
    /// Which computations are skipped. The default is [`Skip::Exact`].
    pub skip: Skip,
    /// Whether frames are mostly zero, as event frames are: each layer's output for zeros is
    /// stored, and reused for pixels that only zeros reach. Same bits, twice the memory. Default:
    /// off.
    pub sparse: bool,
    /// Whether two threads share the rows of large maps. The bits are the same. Default: off.
    pub two_threads: bool,
    /// Limit of [`FrameNetwork::engine_bytes`](super::FrameNetwork::engine_bytes). Default:
    /// [`Self::MEMORY_LIMIT`].
    pub memory_limit: u128,
}

impl Default for FrameOptions {
    fn default() -> Self {
        Self {
            isa: Isa::best(),
            skip: Skip::Exact,
            sparse: false,
            two_threads: false,
            memory_limit: Self::MEMORY_LIMIT,
        }
    }
}

impl FrameOptions {
    /// Default of [`Self::memory_limit`]: 4 GiB, as for the engine over events.
    pub const MEMORY_LIMIT: u128 = 1 << 32;

    /// The default options.
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether an engine stores the layers' outputs for a frame of zeros.
    pub(super) fn stores_background(self) -> bool {
        self.sparse && self.skip != Skip::Nothing
    }

    /// Sets [`Self::isa`].
    pub fn with_isa(self, isa: Isa) -> Self {
        Self { isa, ..self }
    }

    /// Sets [`Self::skip`].
    pub fn with_skip(self, skip: Skip) -> Self {
        Self { skip, ..self }
    }

    /// Sets [`Self::sparse`].
    pub fn with_sparse(self, sparse: bool) -> Self {
        Self { sparse, ..self }
    }

    /// Sets [`Self::two_threads`].
    pub fn with_two_threads(self, two_threads: bool) -> Self {
        Self { two_threads, ..self }
    }

    /// Sets [`Self::memory_limit`].
    pub fn with_memory_limit(self, memory_limit: u128) -> Self {
        Self { memory_limit, ..self }
    }
}
