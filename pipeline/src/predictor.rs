//! The engine of a run over events: incremental, or the same network from scratch at every prediction.

use std::sync::Arc;
use std::time::Duration;

use meissner_engine::filters::{Chain, EventFilter};
use meissner_engine::{
    BatchEngine, Counters, Engine, EngineError, Event, EventCounters, LatePolicy, Network, Options, Outcome,
    Prediction, Search, Sensor, StaleReadout, Staleness,
};

use crate::approximations::{ApproximationReport, Approximations, FilteredEngine, admit};

/// A network over events behind filters, incremental or from scratch.
#[derive(Clone)]
pub struct EventPredictor {
    backend: Backend,
    /// Counts before this run.
    before: Counters,
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

/// The engine of a mode.
#[derive(Clone)]
enum Backend {
    Incremental(Box<FilteredEngine>),
    Batch(Chain, Box<BatchEngine>),
}

impl EventPredictor {
    /// A predictor over an empty window. [`Mode::Batch`] uses only the filters of `approximations`.
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
                let options = Options::new().with_late(late);
                let engine = FilteredEngine::new(network, sensor, approximations, options)?;
                Backend::Incremental(Box::new(engine))
            }
            Mode::Batch => {
                let batch = BatchEngine::new(network, sensor)?.with_late(late).with_search(Search::Grid);
                Backend::Batch(approximations.chain(sensor)?, Box::new(batch))
            }
        };
        let before = Counters { layers: backend.counters().layers, ..Counters::default() };
        Ok(Self { backend, before })
    }

    /// Continues from the state in `bytes`. Requires [`Mode::Incremental`] and a readout that is never stale.
    ///
    /// # Errors
    /// As [`Engine::restore_bytes`].
    pub fn resume(self, bytes: &[u8]) -> Result<Self, EngineError> {
        let Backend::Incremental(filtered) = self.backend else { return Ok(self) };
        let mut engine = filtered.readout.into_engine();
        engine.restore_bytes(bytes)?;
        let before = engine.counters();
        let readout = StaleReadout::new(engine, Staleness::default())?;
        let filtered = FilteredEngine { readout, ..*filtered };
        Ok(Self { backend: Backend::Incremental(Box::new(filtered)), before })
    }

    /// The engine, in [`Mode::Incremental`].
    pub fn engine(&self) -> Option<&Engine> {
        match &self.backend {
            Backend::Incremental(filtered) => Some(filtered.engine()),
            Backend::Batch(..) => None,
        }
    }

    /// Forgets all events; counters continue.
    pub fn reset(&mut self) {
        match &mut self.backend {
            Backend::Incremental(filtered) => filtered.reset(),
            Backend::Batch(chain, batch) => {
                chain.reset();
                batch.reset();
            }
        }
    }

    /// Whether `event` passes the filters, and how long they took.
    pub fn admit(&mut self, event: Event) -> (bool, Duration) {
        match &mut self.backend {
            Backend::Incremental(filtered) => admit(&mut filtered.chain, event),
            Backend::Batch(chain, _) => admit(chain, event),
        }
    }

    /// Pushes `event`, which has passed the filters.
    pub fn push(&mut self, event: Event) -> Outcome {
        match &mut self.backend {
            Backend::Incremental(filtered) => filtered.readout.push(event),
            Backend::Batch(_, batch) => batch.push(event),
        }
    }

    /// Advances the clock to `t_us`.
    pub fn advance(&mut self, t_us: i64) {
        match &mut self.backend {
            Backend::Incremental(filtered) => filtered.readout.advance(t_us),
            Backend::Batch(_, batch) => batch.advance(t_us),
        }
    }

    /// Predicts from the window.
    ///
    /// # Errors
    /// As [`Engine::predict`].
    pub fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        match &mut self.backend {
            Backend::Incremental(filtered) => filtered.readout.predict(),
            Backend::Batch(_, batch) => batch.predict(),
        }
    }

    /// Events in the window.
    pub fn nodes(&self) -> usize {
        match &self.backend {
            Backend::Incremental(filtered) => filtered.engine().nodes(),
            Backend::Batch(_, batch) => batch.nodes(),
        }
    }

    /// Counts of the events that passed the filters in this run.
    pub fn events(&self) -> EventCounters {
        self.backend.counters().since(&self.before).events
    }

    /// Counts of this run. Events that a filter dropped count as pushed, and repeated predictions count as read.
    pub fn counters(&self) -> Counters {
        let mut counters = self.backend.counters().since(&self.before);
        let (chain, stale) = self.beside();
        counters.events.pushed += chain.counters().dropped;
        counters.predictions.read += stale;
        counters
    }

    /// The report of `approximations` after this run; `None` if results are exact.
    pub fn report(&self, approximations: &Approximations) -> Option<ApproximationReport> {
        let (chain, stale) = self.beside();
        approximations.report(chain, &self.counters(), stale)
    }

    /// The filters, and the number of repeated predictions.
    fn beside(&self) -> (&Chain, u64) {
        match &self.backend {
            Backend::Incremental(filtered) => (&filtered.chain, filtered.readout.stale()),
            Backend::Batch(chain, _) => (chain, 0),
        }
    }
}

impl Backend {
    fn counters(&self) -> Counters {
        match self {
            Self::Incremental(filtered) => filtered.engine().counters(),
            Self::Batch(_, batch) => batch.counters(),
        }
    }
}
