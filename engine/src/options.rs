//! How an engine over events runs: options of its users, and switches of its tests.

use meissner_kernels::Isa;

use crate::LatePolicy;

/// What a user may choose about an [`Engine`](crate::Engine) beside network and sensor.
///
/// ```
/// use meissner_engine::{LatePolicy, Options};
///
/// let options = Options::new().with_tolerance(1e-4).with_late(LatePolicy::Clamp);
/// assert_eq!((options.tolerance, options.memory_limit), (1e-4, 4 << 30));
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
#[must_use]
pub struct Options {
    /// What happens to late events. By default they are dropped.
    pub late: LatePolicy,
    /// Instruction set of the kernels: by default the best one of this processor. Results do not depend on it.
    pub isa: Isa,
    /// Whether to measure how long each stage takes, for [`Engine::stage_times`](crate::Engine::stage_times). It costs
    /// some tens of nanoseconds a stage. Off by default.
    pub stage_times: bool,
    /// Most bytes of state. The default is 4 GiB.
    pub memory_limit: u128,
    /// Largest change of a row's values that does not propagate, in the units of the layer: an approximation. The
    /// default, 0, is exact.
    ///
    /// A recomputed row of a block that is within the tolerance of the stored row in every channel keeps the
    /// stored values. A row that has just entered is always stored. At any time, every stored row is within the
    /// tolerance of the values that its stored inputs give. Pooled maxima and the readout are exact over stored rows, and
    /// so are the event rows of `frozen` networks, which are computed once.
    pub tolerance: f32,
    pub(crate) hooks: TestHooks,
}

/// Switches that only tests set. No result depends on them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TestHooks {
    /// Fill rows that leave with NaN, so that a stale read shows as [`EngineError::NotANumber`](crate::EngineError).
    pub(crate) poison: bool,
    /// Remember which rows were computed, for `Engine::recomputed`.
    pub(crate) record_rows: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            late: LatePolicy::default(),
            isa: Isa::best(),
            stage_times: false,
            memory_limit: 1 << 32,
            tolerance: 0.0,
            hooks: TestHooks::default(),
        }
    }
}

impl Options {
    /// The defaults.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets [`Self::late`].
    pub fn with_late(self, late: LatePolicy) -> Self {
        Self { late, ..self }
    }

    /// Sets [`Self::isa`].
    pub fn with_isa(self, isa: Isa) -> Self {
        Self { isa, ..self }
    }

    /// Sets [`Self::stage_times`].
    pub fn with_stage_times(self, stage_times: bool) -> Self {
        Self { stage_times, ..self }
    }

    /// Sets [`Self::memory_limit`].
    pub fn with_memory_limit(self, memory_limit: u128) -> Self {
        Self { memory_limit, ..self }
    }

    /// Sets [`Self::tolerance`].
    pub fn with_tolerance(self, tolerance: f32) -> Self {
        Self { tolerance, ..self }
    }

    /// For tests: fills rows that leave with NaN.
    #[doc(hidden)]
    pub fn with_poison(mut self, poison: bool) -> Self {
        self.hooks.poison = poison;
        self
    }

    /// For tests: remembers which rows were computed.
    #[doc(hidden)]
    pub fn with_record_rows(mut self, record_rows: bool) -> Self {
        self.hooks.record_rows = record_rows;
        self
    }
}
