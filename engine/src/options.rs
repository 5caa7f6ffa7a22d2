//! Options of an engine over events, and switches that only tests set.

use meissner_kernels::Isa;

use crate::{LatePolicy, RestartPolicy};

/// Options of an [`Engine`](crate::Engine).
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
    /// How late events are handled. By default they are dropped.
    pub late: LatePolicy,
    /// Rule for restarts of the sensor's clock. By default the engine resets.
    pub restart: RestartPolicy,
    /// Instruction set of the kernels, the processor's best by default. It affects no result.
    pub isa: Isa,
    /// Whether to measure stages for [`Engine::stage_times`](crate::Engine::stage_times), which
    /// costs tens of nanoseconds each. Default: off.
    pub stage_times: bool,
    /// Limit of the state in bytes. Default: 4 GiB.
    pub memory_limit: u128,
    /// Largest change of a row's values that does not propagate, in the layer's units. Default: 0,
    /// exact; else an approximation.
    ///
    /// A recomputed row that differs from the stored one by at most the tolerance in every channel
    /// keeps the stored values; a new row is always stored. Every stored row is thus within the
    /// tolerance of what its stored inputs give. Pooled maxima and the readout are exact over
    /// stored rows, and so are event rows of `frozen` networks.
    pub tolerance: f32,
    /// Whether two threads share the rows of large blocks, with the same bits. Call the engine on a
    /// thread of a rayon pool of at least two (such as one with `use_current_thread`): on any other
    /// thread, handing over work takes longer than computing on one thread. Default: off.
    pub two_threads: bool,
    /// Whether to record which rows are computed, for
    /// [`Engine::computed_rows`](crate::Engine::computed_rows): up to 8 bytes for each row of each
    /// layer, allocated with the engine, and about a nanosecond a row. Default: off.
    pub record_rows: bool,
    pub(crate) hooks: TestHooks,
}

/// Switches that only tests set. Results do not depend on them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TestHooks {
    /// Fill rows that leave with NaN: a stale read is an [`EngineError::NotANumber`].
    pub(crate) poison: bool,
    /// Two threads share every block, however few its rows are.
    pub(crate) share_all: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            late: LatePolicy::default(),
            restart: RestartPolicy::default(),
            isa: Isa::best(),
            stage_times: false,
            memory_limit: 1 << 32,
            tolerance: 0.0,
            two_threads: false,
            record_rows: false,
            hooks: TestHooks::default(),
        }
    }
}

impl Options {
    /// The default options.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets [`Self::late`].
    pub fn with_late(self, late: LatePolicy) -> Self {
        Self { late, ..self }
    }

    /// Sets [`Self::restart`].
    pub fn with_restart(self, restart: RestartPolicy) -> Self {
        Self { restart, ..self }
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

    /// Sets [`Self::two_threads`].
    pub fn with_two_threads(self, two_threads: bool) -> Self {
        Self { two_threads, ..self }
    }

    /// Sets [`Self::record_rows`].
    pub fn with_record_rows(self, record_rows: bool) -> Self {
        Self { record_rows, ..self }
    }

    /// For tests: fills rows that leave with NaN.
    #[doc(hidden)]
    pub fn with_poison(mut self, poison: bool) -> Self {
        self.hooks.poison = poison;
        self
    }

    /// For tests: two threads, which share every block.
    #[doc(hidden)]
    pub fn with_all_shared(mut self) -> Self {
        self.hooks.share_all = true;
        self.with_two_threads(true)
    }
}
