//! What computes predictions: the engine, or the same network from scratch each time.

use std::sync::Arc;

use meissner_engine::{
    BatchEngine, Counters, Engine, EngineError, Event, LatePolicy, Network, Options, Outcome, Prediction,
    Search, Sensor, StaleReadout, Staleness,
};

use crate::approximations::Approximations;

/// Takes events and predicts.
#[derive(Clone)]
pub struct Predictor {
    backend: Backend,
    /// What was counted before this run.
    before: Counters,
}

/// How predictions are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Recompute the rows that an event changes.
    #[default]
    Incremental,
    /// Recompute every row, at every prediction.
    Batch,
}

/// The engine of a mode.
#[derive(Clone)]
enum Backend {
    /// What an event changes, behind a readout that may be stale.
    Incremental(Box<StaleReadout>),
    /// Every row, at every prediction.
    Batch(Box<BatchEngine>),
}

impl Predictor {
    /// A predictor over an empty window.
    ///
    /// # Errors
    /// The engine refuses the sensor or an approximation.
    pub fn new(
        mode: Mode,
        network: Arc<Network>,
        sensor: Sensor,
        late: LatePolicy,
        approximations: &Approximations,
    ) -> Result<Self, EngineError> {
        let backend = match mode {
            Mode::Incremental => {
                let tolerance = approximations.tolerance.unwrap_or(0.0);
                let options = Options::new().with_late(late).with_tolerance(tolerance);
                let engine = Engine::with_options(network, sensor, options)?;
                Backend::Incremental(Box::new(StaleReadout::new(engine, approximations.staleness())?))
            }
            Mode::Batch => {
                let batch = BatchEngine::new(network, sensor)?;
                Backend::Batch(Box::new(batch.with_late(late).with_search(Search::Grid)))
            }
        };
        let before = Counters { layers: backend.counters().layers, ..Counters::default() };
        Ok(Self { backend, before })
    }

    /// Goes on from the state in `bytes`. Only for [`Mode::Incremental`], whose readout is not stale.
    ///
    /// # Errors
    /// As [`Engine::restore_bytes`].
    pub fn resume(self, bytes: &[u8]) -> Result<Self, EngineError> {
        let Backend::Incremental(readout) = self.backend else { return Ok(self) };
        let mut engine = readout.into_engine();
        engine.restore_bytes(bytes)?;
        let before = engine.counters();
        let backend = Backend::Incremental(Box::new(StaleReadout::new(engine, Staleness::default())?));
        Ok(Self { backend, before })
    }

    /// The engine, in [`Mode::Incremental`].
    pub fn engine(&self) -> Option<&Engine> {
        match &self.backend {
            Backend::Incremental(readout) => Some(readout.engine()),
            Backend::Batch(_) => None,
        }
    }

    /// Forgets all events; counters go on.
    pub fn reset(&mut self) {
        match &mut self.backend {
            Backend::Incremental(engine) => engine.reset(),
            Backend::Batch(batch) => batch.reset(),
        }
    }

    /// Takes `event`.
    pub fn push(&mut self, event: Event) -> Outcome {
        match &mut self.backend {
            Backend::Incremental(engine) => engine.push(event),
            Backend::Batch(batch) => batch.push(event),
        }
    }

    /// Moves the clock to `t_us`.
    pub fn advance(&mut self, t_us: i64) {
        match &mut self.backend {
            Backend::Incremental(engine) => engine.advance(t_us),
            Backend::Batch(batch) => batch.advance(t_us),
        }
    }

    /// Predicts from the window.
    ///
    /// # Errors
    /// As [`Engine::predict`].
    pub fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        match &mut self.backend {
            Backend::Incremental(engine) => engine.predict(),
            Backend::Batch(batch) => batch.predict(),
        }
    }

    /// Events in the window.
    pub fn nodes(&self) -> usize {
        match &self.backend {
            Backend::Incremental(readout) => readout.engine().nodes(),
            Backend::Batch(batch) => batch.nodes(),
        }
    }

    /// Predictions that stood and were not computed.
    pub fn stale(&self) -> u64 {
        match &self.backend {
            Backend::Incremental(readout) => readout.stale(),
            Backend::Batch(_) => 0,
        }
    }

    /// Counts of what the engine did in this run; predictions that stood are not among them.
    pub fn counters(&self) -> Counters {
        self.backend.counters().since(&self.before)
    }
}

impl Backend {
    fn counters(&self) -> Counters {
        match self {
            Self::Incremental(readout) => readout.engine().counters(),
            Self::Batch(batch) => batch.counters(),
        }
    }
}
