//! What computes predictions: the engine, or the same network from scratch each time.

use std::sync::Arc;

use meissner_engine::{
    Admission, Batch, Counters, Engine, EngineError, Event, LatePolicy, LayerCounters, Network, Options,
    Outcome, Prediction, Search, Sensor, StaleReadout, Staleness, Stream,
};

use crate::approximations::Approximations;

/// Forgotten events that are kept before the list is moved up.
const MOST_FORGOTTEN: usize = 1 << 14;

/// Takes events and predicts.
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
enum Backend {
    /// What an event changes, behind a readout that may be stale.
    Incremental(Box<StaleReadout>),
    /// Every row, at every prediction.
    Batch(Box<FromScratch>),
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
            Mode::Batch => Backend::Batch(Box::new(FromScratch::new(network, sensor, late)?)),
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

/// A batch with the engine's verbs: the same gate, the same window, every row at every prediction. It searches by the grid,
/// for speed.
pub struct FromScratch {
    batch: Batch,
    gate: Admission,
    /// Accepted events: with `frozen` in-edges all of them, else at least the window.
    events: Vec<Event>,
    /// Index of the window's oldest event.
    first: usize,
    newest_us: Option<i64>,
    values: Vec<f32>,
    rows: Vec<u64>,
    counters: Counters,
}

impl FromScratch {
    fn new(network: Arc<Network>, sensor: Sensor, late: LatePolicy) -> Result<Self, EngineError> {
        let layers = network.layers().len();
        Ok(Self {
            batch: Batch::new(network, sensor)?.with_search(Search::Grid),
            gate: Admission::new(sensor, late),
            events: Vec::new(),
            first: 0,
            newest_us: None,
            values: Vec::new(),
            rows: vec![0; layers],
            counters: Counters { layers: vec![LayerCounters::default(); layers], ..Counters::default() },
        })
    }

    fn push(&mut self, event: Event) -> Outcome {
        let event = match self.gate.admit(event) {
            Ok(event) => event,
            Err(reason) => return Outcome::Dropped(reason),
        };
        self.expire();
        if self.nodes() == self.batch.network().parts().capacity {
            self.first += 1;
            self.counters.events.evicted += 1;
        }
        self.events.push(event);
        self.newest_us = Some(event.t_us);
        Outcome::Accepted
    }

    fn advance(&mut self, t_us: i64) {
        self.gate.advance(t_us);
        self.expire();
    }

    fn expire(&mut self) {
        let parts = self.batch.network().parts();
        let oldest_kept = self.gate.now_us().map_or(i64::MIN, |now| now.saturating_sub(parts.span_us));
        let expired = self.events[self.first..].iter().take_while(|e| e.t_us < oldest_kept).count();
        self.first += expired;
        self.counters.events.expired += expired as u64;
        // Frozen in-edges are those of the whole stream.
        if !parts.graph.is_frozen() && self.first > MOST_FORGOTTEN.max(self.nodes()) {
            self.events.drain(..self.first);
            self.first = 0;
        }
    }

    fn nodes(&self) -> usize {
        self.events.len() - self.first
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        let stream = Stream {
            events: &self.events,
            epoch_us: self.gate.epoch_us().unwrap_or(0),
            now_us: self.gate.now_us().unwrap_or(0),
        };
        let trace = self.batch.forward(stream)?;
        let network = self.batch.network();
        let mut layers = self.counters.layers.iter_mut().zip(&mut self.rows);
        for (level, trace) in trace.levels.iter().enumerate() {
            let computed = trace.features[0].rows() as u64;
            let of_level = network.level(level).blocks.len() + usize::from(level > 0);
            for (layer, rows) in layers.by_ref().take(of_level) {
                *rows = computed;
                layer.recomputed += computed;
            }
        }
        self.counters.predictions.read += 1;
        self.counters.predictions.cells_recomputed += trace.readout.rows() as u64;
        self.values = trace.prediction;
        let nodes = trace.levels[0].features[0].rows() - trace.levels[0].first;
        Ok(Prediction { values: &self.values, t_us: self.newest_us, nodes, rows: &self.rows })
    }

    fn counters(&self) -> Counters {
        let mut counters = self.counters.clone();
        let (expired, evicted) = (counters.events.expired, counters.events.evicted);
        counters.events = *self.gate.counters();
        (counters.events.expired, counters.events.evicted) = (expired, evicted);
        counters
    }
}
