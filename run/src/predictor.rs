//! The engine of a run over events, after its filters: incremental, or from scratch.

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner_engine::filters::{Chain, EventFilter};
use meissner_engine::{
    BatchEngine, Counters, Decision, Engine, EngineError, Event, EventCounters, Network, Options, Outcome,
    Prediction, Search, Sensor, StaleReadout,
};

use crate::approximations::{ApproximationReport, Approximations};

/// A network over events after filters, incremental or from scratch.
#[derive(Clone)]
pub struct EventPredictor {
    chain: Chain,
    backend: Backend,
    before: Counters,
    /// Counts of the events in front of the engine.
    decided: EventCounters,
}

/// How predictions are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Recompute the rows that an event changes.
    #[default]
    Incremental,
    /// Recompute every row at every prediction.
    Batch,
}

impl Mode {
    /// Its name in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Incremental => "incremental",
            Self::Batch => "batch",
        }
    }
}

/// The engine of a mode. Each wraps the one before it only if requested.
#[derive(Clone)]
enum Backend {
    Incremental(Box<Engine>),
    Stale(Box<StaleReadout>),
    Batch(Box<BatchEngine>),
}

/// The result of an expression for any engine.
macro_rules! any {
    ($backend:expr, $engine:ident => $result:expr) => {
        match $backend {
            Backend::Incremental($engine) => $result,
            Backend::Stale($engine) => $result,
            Backend::Batch($engine) => $result,
        }
    };
}

impl Backend {
    fn engine(&self) -> Option<&Engine> {
        match self {
            Self::Incremental(engine) => Some(engine),
            Self::Stale(readout) => Some(readout.engine()),
            Self::Batch(_) => None,
        }
    }

    fn counters(&self) -> Counters {
        match self {
            Self::Batch(batch) => batch.counters(),
            Self::Incremental(engine) => engine.counters(),
            Self::Stale(readout) => readout.engine().counters(),
        }
    }
}

impl EventPredictor {
    /// A predictor with the filters, tolerance and staleness of `approximations`; the network was
    /// [adapted](Approximations::adapt). [`Mode::Batch`] uses filters and policies only.
    ///
    /// # Errors
    /// The engine refuses the sensor, an option or an approximation.
    pub fn new(
        mode: Mode,
        network: Arc<Network>,
        sensor: Sensor,
        approximations: &Approximations,
        options: Options,
    ) -> Result<Self, EngineError> {
        let backend = match mode {
            Mode::Incremental if approximations.is_stale() => {
                Backend::Stale(Box::new(approximations.readout(network, sensor, options)?))
            }
            Mode::Incremental => {
                let options = options.with_tolerance(approximations.tolerance.unwrap_or(0.0));
                Backend::Incremental(Box::new(Engine::with_options(network, sensor, options)?))
            }
            Mode::Batch => {
                let batch =
                    BatchEngine::new(network, sensor)?.with_late(options.late).with_restart(options.restart);
                Backend::Batch(Box::new(batch.with_search(Search::Grid)))
            }
        };
        let before = Counters { layers: backend.counters().layers, ..Counters::default() };
        let decided = EventCounters::default();
        Ok(Self { chain: approximations.chain(sensor)?, backend, before, decided })
    }

    /// Continues from the state in `bytes`: incremental, with a readout that is never stale.
    ///
    /// # Errors
    /// As [`Engine::restore_bytes`].
    pub fn resume(mut self, bytes: &[u8]) -> Result<Self, EngineError> {
        let mut engine = match self.backend {
            Backend::Incremental(engine) => engine,
            Backend::Stale(readout) => Box::new(readout.into_engine()),
            Backend::Batch(_) => return Ok(self),
        };
        engine.restore_bytes(bytes)?;
        self.before = engine.counters();
        self.backend = Backend::Incremental(engine);
        Ok(self)
    }

    /// The engine, in [`Mode::Incremental`].
    pub fn engine(&self) -> Option<&Engine> {
        self.backend.engine()
    }

    /// Current time, as [`Engine::now_us`].
    pub fn now_us(&self) -> Option<i64> {
        match &self.backend {
            Backend::Batch(batch) => batch.now_us(),
            incremental => incremental.engine()?.now_us(),
        }
    }

    /// The time at which `event` would enter, as [`Engine::arrival_us`].
    pub fn arrival_us(&self, event: Event) -> Option<i64> {
        match &self.backend {
            Backend::Batch(batch) => batch.arrival_us(event),
            incremental => incremental.engine()?.arrival_us(event),
        }
    }

    /// Counts the decision of a watch in front of this predictor. A restart resets the predictor.
    pub fn decided(&mut self, decision: &Decision) {
        self.decided.outliers += decision.outliers;
        self.decided.pushed += decision.outliers;
        if decision.restarts {
            self.decided.restarts += 1;
            self.reset();
        }
    }

    /// Forgets all events; counters continue.
    pub fn reset(&mut self) {
        self.chain.reset();
        any!(&mut self.backend, engine => engine.reset());
    }

    /// Whether `event` passes the filters, and how long they took: zero without filters.
    pub fn admit(&mut self, event: Event) -> (bool, Duration) {
        if self.chain.filters().is_empty() {
            return (true, Duration::ZERO);
        }
        let start = Instant::now();
        let passes = self.chain.admit(event);
        (passes, start.elapsed())
    }

    /// Pushes `event`, which has passed the filters.
    pub fn push(&mut self, event: Event) -> Outcome {
        any!(&mut self.backend, engine => engine.push(event))
    }

    /// Pushes the `events` that pass the filters.
    pub fn push_slice(&mut self, events: &[Event]) {
        let passing = events.iter().copied().filter(|&event| self.chain.admit(event));
        match &mut self.backend {
            Backend::Incremental(engine) => engine.push_all(passing),
            Backend::Stale(readout) => readout.push_all(passing),
            Backend::Batch(batch) => passing.filter(|&event| batch.push(event) == Outcome::Accepted).count(),
        };
    }

    /// Advances the clock to `t_us`.
    pub fn advance(&mut self, t_us: i64) {
        any!(&mut self.backend, engine => engine.advance(t_us));
    }

    /// Predicts from the window.
    ///
    /// # Errors
    /// As [`Engine::predict`].
    pub fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        any!(&mut self.backend, engine => engine.predict())
    }

    /// Events in the window.
    pub fn nodes(&self) -> usize {
        match &self.backend {
            Backend::Incremental(engine) => engine.nodes(),
            Backend::Stale(readout) => readout.engine().nodes(),
            Backend::Batch(batch) => batch.nodes(),
        }
    }

    /// Counts of the events that passed the filters in this run.
    pub fn events(&self) -> EventCounters {
        self.counted().events
    }

    fn counted(&self) -> Counters {
        let mut counters = self.backend.counters().since(&self.before);
        let EventCounters { pushed, outliers, restarts, .. } = &mut counters.events;
        *pushed += self.decided.pushed;
        *outliers += self.decided.outliers;
        *restarts += self.decided.restarts;
        counters
    }

    /// Counts of this run: pushed events include filtered ones, read predictions include repeated
    /// ones.
    pub fn counters(&self) -> Counters {
        let mut counters = self.counted();
        counters.events.pushed += self.chain.counters().dropped;
        counters.predictions.read += self.stale();
        counters
    }

    /// The report of `approximations` after this run; `None` if results are exact.
    pub fn report(&self, approximations: &Approximations) -> Option<ApproximationReport> {
        approximations.report(&self.chain, &self.counters(), self.stale())
    }

    fn stale(&self) -> u64 {
        match &self.backend {
            Backend::Stale(readout) => readout.stale(),
            Backend::Incremental(_) | Backend::Batch(_) => 0,
        }
    }
}
